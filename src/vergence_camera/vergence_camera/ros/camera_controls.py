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


class CameraControls:
    """Declares the controls once the camera is connected, validates and applies changes, and keeps the lock.

    Create it before the node's other parameters are declared: its check then runs last, and nothing is sent to the
    camera for a request that another check refuses.
    """

    def __init__(self, node: Node, port: ControlPort) -> None:
        self._node, self._port = node, port
        self._declared: set[str] = set()
        self._own_change = False
        self._problem = ""
        self._held_generation = 0
        self._followed: tuple[int, dict[str, object]] | None = None
        self._attached_s = 0.0
        self._known_generation = 0
        node.add_on_set_parameters_callback(self._on_set)
        overrides: Mapping[str, Parameter] = node._parameter_overrides
        self._given = {
            name.removeprefix(PREFIX): parameter.value
            for name, parameter in overrides.items()
            if name.startswith(PREFIX)
        }
        port.set_initial(self._given)
        self._lock, self._lock_after_s = "off", 0.0

    def configure(self, lock: str, lock_after_s: float) -> None:
        """Set the lock parameters."""
        if lock != self._lock:
            self._held_generation, self._followed = 0, None
        self._lock, self._lock_after_s = lock, lock_after_s

    def update(self) -> None:
        """Declare the controls of a newly connected camera; fix its exposure when that is due."""
        generation = self._port.generation
        if generation != self._known_generation:
            self._known_generation, self._attached_s = generation, time.monotonic()
            self._declare()
        due = time.monotonic() >= self._attached_s + self._lock_after_s
        if self._lock == "hold" and due and self._held_generation != generation and self._port.attached:
            self._held_generation = generation
            self._lock_to({})

    def follow(self, leader: Mapping[str, object]) -> None:
        """Copy the other eye's exposure and white balance, if lock is 'follow' and they differ."""
        state = (self._port.generation, dict(leader))
        if self._lock == "follow" and self._port.attached and state != self._followed:
            self._lock_to(leader)
            self._followed = None if self._problem else state

    def report(self) -> Report:
        """Call `update` (once a second is often enough for it) and return the diagnostic."""
        self.update()
        values = dict(self._port.values())
        if not values:
            return Report(OK, "no controls: the source is a recording, a stream, or a camera that is not connected")
        if self._problem:
            return Report(WARN, self._problem, values)
        return Report(OK, f"lock: {self._lock}", values)

    def _lock_to(self, leader: Mapping[str, object]) -> None:
        """Lock to `leader` (empty: to itself) and update the parameters."""
        try:
            values = self._port.follow(leader)
            self._problem = ""
        except CameraError as error:
            self._problem = str(error)
            return
        self._update_parameters(values)

    def _update_parameters(self, values: Mapping[str, object]) -> None:
        changed = [
            Parameter(PREFIX + name, value=value)
            for name, value in values.items()
            if name in self._declared and self._node.get_parameter(PREFIX + name).value != value
        ]
        if changed:
            self._own_change = True
            try:
                self._node.set_parameters(changed)
            finally:
                self._own_change = False

    def _declare(self) -> None:
        values = self._port.values()
        specs = self._port.specs()
        for name in self._given.keys() - specs.keys():
            self._node.get_logger().warning(
                f"there is no parameter '{PREFIX}{name}': the camera has {', '.join(specs) or 'none'}"
            )
        self._own_change = True
        try:
            for name in specs.keys() - self._declared:
                if name not in values:
                    continue
                # The YAML's value has been applied; the parameter shows what the camera made of it.
                self._node._parameter_overrides.pop(PREFIX + name, None)
                self._node.declare_parameter(PREFIX + name, values[name], control_descriptor(specs[name]))
                self._declared.add(name)
        finally:
            self._own_change = False
        self._update_parameters(values)

    def _on_set(self, parameters: list[Parameter]) -> SetParametersResult:
        changes = {p.name.removeprefix(PREFIX): p.value for p in parameters if p.name.startswith(PREFIX)}
        if changes and not self._own_change:
            shared = sorted(changes.keys() & set(self._port.locked_names())) if self._lock == "follow" else []
            if shared:
                reason = f"{PREFIX}{shared[0]} follows the partner (lock: follow): set it on the partner"
                return SetParametersResult(successful=False, reason=reason)
            try:
                self._port.set(changes)
            except CameraError as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)
