"""sim_node: the simulated head and room in real time, with the topics of cameras, servos and ground truth."""

import functools
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import PointStamped

from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet
from vergence_msgs.msg import TrueBoxes, TrueVergence
from vergence_rig.rig_file import load_rig
from vergence_sim.parameters import GROUPS, NODE_GROUPS, SimParameters
from vergence_sim.ros.sim_messages import true_boxes, true_vergence
from vergence_sim.ros.world_node import WorldNode
from vergence_sim.simulator import Simulator
from vergence_sim.world import EYES


class SimNode(WorldNode):
    """MuJoCo's world in real time; the simulation's thread owns it and its OpenGL context."""

    alone = False
    """True where this process makes no other simulator, whose memory it would share."""

    def __init__(self, **options: Any) -> None:
        super().__init__("sim_node", NODE_GROUPS, **options)
        self.get_logger().info("the simulated head and room are ready")

    def _prepare(self, settings: ParameterSet) -> None:
        self._rig = load_rig(self._sim_parameters(settings).simulation.rig)
        self._true_vergence = self._qos.create_publisher(TrueVergence, "ground_truth/vergence")
        self._true_boxes = self._qos.create_publisher(TrueBoxes, "ground_truth/boxes")
        self._true_target = self._qos.create_publisher(PointStamped, "ground_truth/target")
        self._place_subscriptions = [
            self._qos.create_subscription(PointStamped, f"sim/{what}_pose", functools.partial(self._on_place, what))
            for what in ("target", "occluder", "distractor")
        ]

    def _make_world(self) -> Simulator:
        return Simulator(self._sim_parameters(self._settings), self._rig, alone=self.alone)

    def _sim_parameters(self, settings: ParameterSet) -> SimParameters:
        return SimParameters(*(settings.get(group) for _, group in GROUPS))  # type: ignore[arg-type]

    def _on_place(self, what: str, message: PointStamped) -> None:
        if message.header.frame_id not in ("", "rig_base"):
            self._refuse(f"frame of sim/{what}_pose must be 'rig_base': got {message.header.frame_id!r}")
            return
        place = (message.point.x, message.point.y, message.point.z)

        def put(simulator: Simulator) -> None:
            if what == "target":
                simulator.place_target(simulator.parameters.target.object, place)
            else:
                simulator.place_object(what, place)

        self._do(put)

    def _publish_truth(self, stamp: Any, world: Simulator) -> None:
        if self._true_vergence.get_subscription_count() or self._true_target.get_subscription_count():
            truth = true_vergence(stamp, "rig_base", world.truth())
            self._true_vergence.publish(truth)
            self._true_target.publish(PointStamped(header=truth.header, point=truth.target_point))
        if self._true_boxes.get_subscription_count():
            boxes = [world.true_boxes(eye) for eye in EYES]
            self._true_boxes.publish(true_boxes(stamp, "left_camera_optical_frame", *boxes))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see `vergence_common.node_main`."""
    SimNode.alone = True
    return run_node(SimNode, args, NODE_GROUPS)
