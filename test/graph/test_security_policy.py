"""config/security allows every node what it has in the running graph, and little else."""

from pathlib import Path
from xml.etree import ElementTree

import pytest

from vergence_bringup.node_table import NODES
from vergence_bringup.ros.security_policy import EYES, OPERATOR, Endpoints, with_sometimes
from vergence_bringup.testing.ros.every_node import KINDS
from vergence_bringup.testing.ros.live_policies import live_endpoints

pytestmark = pytest.mark.graph

FILE = Path(__file__).resolve().parents[2] / "config" / "security" / "vergence.policy.xml"


def _allowed(executable: str, namespace: str) -> Endpoints:
    (profile,) = ElementTree.parse(FILE).findall(
        f"enclaves/enclave[@path='/vergence/{executable}']/profiles/profile[@ns='{namespace}'][@node='{executable}']"
    )

    def names(group: str, element: str, verb: str) -> frozenset[str]:
        return frozenset(one.text or "" for one in profile.findall(f"{group}[@{verb}='ALLOW']/{element}"))

    return Endpoints(
        names("topics", "topic", "publish"),
        names("topics", "topic", "subscribe"),
        names("services", "service", "reply"),
        names("services", "service", "request"),
        names("actions", "action", "execute"),
        names("actions", "action", "call"),
    )


def test_every_node_of_the_table_has_an_enclave() -> None:
    paths = {enclave.get("path") for enclave in ElementTree.parse(FILE).findall("enclaves/enclave")}
    assert paths == {f"/vergence/{name}" for name in (*NODES, OPERATOR)}
    assert set(KINDS) == set(NODES)


@pytest.mark.parametrize("executable", sorted(KINDS))
def test_a_node_is_allowed_what_it_has(executable: str, domain_id: int, request: pytest.FixtureRequest) -> None:
    if executable == "sim_node":
        request.getfixturevalue("opengl")
    for namespace in [f"/{eye}" for eye in EYES] if executable == "camera_node" else ["/"]:
        live, allowed = live_endpoints(executable, namespace, domain_id), _allowed(executable, namespace)
        assert allowed == with_sometimes(executable, live), "run: python tools/write_security_policy.py"


@pytest.mark.parametrize("topic", ["/joint_command", "/servo_node/commands", "/joint_trajectory"])
def test_only_controller_and_operator_may_command_the_joints(topic: str) -> None:
    may = {
        enclave.get("path")
        for enclave in ElementTree.parse(FILE).findall("enclaves/enclave")
        if any(one.text == topic for one in enclave.findall("profiles/profile/topics[@publish='ALLOW']/topic"))
    }
    assert may <= {"/vergence/gaze_controller_node", f"/vergence/{OPERATOR}"}
