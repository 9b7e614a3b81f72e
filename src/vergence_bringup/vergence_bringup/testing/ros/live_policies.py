"""The security policies of all nodes, as the nodes themselves say when they run."""

import tempfile
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter

from vergence_bringup.ros.security_policy import EYES, Endpoints, endpoints_of, policy, with_sometimes
from vergence_bringup.testing.ros.every_node import KINDS, parameters_without_hardware


def live_endpoints(executable: str, namespace: str = "/", domain_id: int | None = None) -> Endpoints:
    """Start a node, ask the graph for what it has, and end it."""
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    with tempfile.TemporaryDirectory() as folder:
        given = parameters_without_hardware(executable, Path(folder))
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        if namespace != "/":
            overrides.append(Parameter("partner", value=f"/{_other(namespace)}/{executable}"))
        node = KINDS[executable](context=context, namespace=namespace, parameter_overrides=overrides)
        try:
            return endpoints_of(node)
        finally:
            close = getattr(node, "close", None)
            if close is not None:
                close()
            node.destroy_node()
            context.try_shutdown()


def live_policy(domain_id: int | None = None) -> str:
    """Return the policy file of every node; the camera's is of both eyes."""
    enclaves = {}
    for executable in sorted(KINDS):
        namespaces = [f"/{eye}" for eye in EYES] if executable == "camera_node" else ["/"]
        enclaves[executable] = [
            (namespace, executable, with_sometimes(executable, live_endpoints(executable, namespace, domain_id)))
            for namespace in namespaces
        ]
    return policy(enclaves)


def _other(namespace: str) -> str:
    return EYES[1 - EYES.index(namespace.strip("/"))]
