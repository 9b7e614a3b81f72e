"""The camera's controls as parameters of the node, `control.<name>`."""

import time
from collections.abc import Mapping

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from vergence_camera.control_port import ControlPort
from vergence_camera.errors import CameraError
from vergence_camera.ros.camera_messages import control_descriptor
from vergence_common.diagnostics import OK, WARN, Report

PREFIX = "control."


class NodeControls:
    """Declares the controls once the camera has been seen, validates and applies changes, and holds the lock.

    Make it before the node's other parameters are declared: its check then runs last, and nothing is sent to the
    camera for a request that another check refuses.
    """

    def __init__(self, node: Node, port: ControlPort) -> None:
        self._node, self._port = node, port
        self._declared: set[str] = set()
        self._passive = False
        self._trouble = ""
        self._held_generation = 0
        self._followed: tuple[int, dict[str, object]] | None = None
        self._attached_s = 0.0
        self._seen_generation = 0
        node.add_on_set_parameters_callback(self._on_set)
        overrides: Mapping[str, Parameter] = node._parameter_overrides
        self._given = {
            name.removeprefix(PREFIX): parameter.value
            for name, parameter in overrides.items()
            if name.startswith(PREFIX)
        }
        port.want(self._given)
        self._lock, self._lock_after_s = "off", 0.0

    def configure(self, lock: str, lock_after_s: float) -> None:
        """Take over the lock parameters."""
        if lock != self._lock:
            self._held_generation, self._followed = 0, None
        self._lock, self._lock_after_s = lock, lock_after_s

    def update(self) -> None:
        """Declare what a newly seen camera has; hold its exposure when that is due."""
        generation = self._port.generation
        if generation != self._seen_generation:
            self._seen_generation, self._attached_s = generation, time.monotonic()
            self._declare()
        due = time.monotonic() >= self._attached_s + self._lock_after_s
        if self._lock == "hold" and due and self._held_generation != generation and self._port.attached:
            self._held_generation = generation
            self._take({})

    def follow(self, leader: Mapping[str, object]) -> None:
        """Take the other eye's exposure and white balance over, if that is asked for and they differ."""
        state = (self._port.generation, dict(leader))
        if self._lock == "follow" and self._port.attached and state != self._followed:
            self._take(leader)
            self._followed = None if self._trouble else state

    def report(self) -> Report:
        """Look after the controls (see `update`; a timer of its own would do that no more often) and report on them."""
        self.update()
        values = dict(self._port.values())
        if not values:
            return Report(OK, "no controls: a recording, a stream, or a camera that is away")
        if self._trouble:
            return Report(WARN, self._trouble, values)
        return Report(OK, f"lock: {self._lock}", values)

    def _take(self, leader: Mapping[str, object]) -> None:
        """Lock to `leader` (empty: to itself) and let the parameters show it."""
        try:
            values = self._port.follow(leader)
            self._trouble = ""
        except CameraError as error:
            self._trouble = str(error)
            return
        self._show(values)

    def _show(self, values: Mapping[str, object]) -> None:
        changed = [
            Parameter(PREFIX + name, value=value)
            for name, value in values.items()
            if name in self._declared and self._node.get_parameter(PREFIX + name).value != value
        ]
        if changed:
            self._passive = True
            try:
                self._node.set_parameters(changed)
            finally:
                self._passive = False

    def _declare(self) -> None:
        values = self._port.values()
        specs = self._port.specs()
        for name in self._given.keys() - specs.keys():
            self._node.get_logger().warning(
                f"parameter '{PREFIX}{name}': this camera has no such control; it has {', '.join(specs) or 'none'}"
            )
        self._passive = True
        try:
            for name in specs.keys() - self._declared:
                if name not in values:
                    continue
                # What the YAML gave has been applied; what the camera made of it is shown.
                self._node._parameter_overrides.pop(PREFIX + name, None)
                self._node.declare_parameter(PREFIX + name, values[name], control_descriptor(specs[name]))
                self._declared.add(name)
        finally:
            self._passive = False
        self._show(values)

    def _on_set(self, parameters: list[Parameter]) -> SetParametersResult:
        changes = {p.name.removeprefix(PREFIX): p.value for p in parameters if p.name.startswith(PREFIX)}
        if changes and not self._passive:
            shared = sorted(changes.keys() & set(self._port.locked_names())) if self._lock == "follow" else []
            if shared:
                reason = f"{PREFIX}{shared[0]} is the other eye's here (lock: follow): set it there"
                return SetParametersResult(successful=False, reason=reason)
            try:
                self._port.set(changes)
            except CameraError as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)
