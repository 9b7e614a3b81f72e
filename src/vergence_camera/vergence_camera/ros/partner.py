"""The other eye's camera node: its stamps from camera_info, its device and controls from its parameters."""

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import CameraInfo

from vergence_camera.devices import SystemTree, choose, find_devices
from vergence_camera.errors import CameraError
from vergence_camera.pair import EyeCamera, SkewMeter, faults_of_pair
from vergence_camera.ros.camera_controls import PREFIX
from vergence_common.diagnostics import OK, STALE, WARN, Report
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_nanoseconds

_PERIOD_S = 1.0


class PartnerCamera:
    """Requests the other camera node's parameters once a second and compares the two cameras.

    `locked_names` returns the controls to request; `changed` is called with their values after every reply.
    """

    def __init__(
        self,
        node: Node,
        partner: str,
        tree: SystemTree,
        locked_names: Callable[[], Sequence[str]],
        changed: Callable[[dict[str, Any]], None],
    ) -> None:
        self._node, self._name, self._tree = node, partner, tree
        self._locked_names, self._changed = locked_names, changed
        self.skew = SkewMeter()
        self._values: dict[str, Any] = {}
        self._requested_s_ago = 0
        self._pending: Any = None
        self._client = AsyncParameterClient(node, partner)
        namespace = partner.rpartition("/")[0]
        node.create_subscription(CameraInfo, f"{namespace}/camera_info", self._on_camera_info, IMAGE_QOS)
        node.create_timer(_PERIOD_S, self._request, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def report(self, own: EyeCamera, max_skew_s: float) -> Report:
        """Return the diagnostic of the pair."""
        skew_s = self.skew.skew_s()
        if skew_s != skew_s:
            return Report(STALE, f"no camera_info from {self._name}")
        controls = {name.removeprefix(PREFIX): value for name, value in self._values.items() if PREFIX in name}
        other = EyeCamera(self._name, self._controller(), self.skew.other_rate_hz(), controls)
        faults = faults_of_pair(own, other, skew_s, max_skew_s)
        values = {"skew_ms": round(skew_s * 1e3, 2), "partner_rate_hz": round(other.rate_hz, 2)}
        return (
            Report(WARN, "; ".join(faults), values)
            if faults
            else Report(OK, "cameras synchronised, settings match", values)
        )

    def _on_camera_info(self, message: CameraInfo) -> None:
        self.skew.add_other(to_nanoseconds(message.header.stamp))

    def _request(self) -> None:
        if not self._client.services_are_ready():
            return
        # A partner that ends before its reply never sends one: the request is repeated after some seconds.
        self._requested_s_ago += 1
        if self._pending is not None and not self._pending.done() and self._requested_s_ago < 5:
            return
        self._requested_s_ago = 0
        self._pending = self._client.list_parameters(prefixes=["control"])
        self._pending.add_done_callback(self._on_list)

    def _on_list(self, future: Any) -> None:
        wanted = {PREFIX + name for name in self._locked_names()}
        names = ["device", *sorted(wanted & set(future.result().result.names))]
        self._pending = self._client.get_parameters(names)
        self._pending.add_done_callback(lambda answer: self._on_values(names, answer))

    def _on_values(self, names: list[str], future: Any) -> None:
        values = future.result().values
        self._values = {name: parameter_value_to_python(value) for name, value in zip(names, values, strict=False)}
        self._changed({n.removeprefix(PREFIX): v for n, v in self._values.items() if n.startswith(PREFIX)})

    def _controller(self) -> str:
        """Return the partner's USB controller; empty if it is not a camera of this machine."""
        try:
            return choose(str(self._values.get("device", "")), find_devices(self._tree)).controller
        except CameraError:
            return ""
