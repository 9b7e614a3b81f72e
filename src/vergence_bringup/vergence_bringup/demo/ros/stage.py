"""Places the objects of a running simulated head and moves the eyes to their start."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import PointStamped

from vergence_bringup.demo.ros.recorder import Recorder
from vergence_msgs.action import LookAt

_OUT_OF_SIGHT_M = (10.0, 0.0, -10.0)
_SETTLE_S = 0.7


class Stage:
    """The simulator's movable `objects`: target, distractor, occluder; `check_alive` raises when a node has ended."""

    def __init__(self, recorder: Recorder, check_alive: Callable[[], None], objects: Sequence[str]) -> None:
        self._recorder, self._check_alive = recorder, check_alive
        self._places = {what: recorder.node.create_publisher(PointStamped, f"sim/{what}_pose", 10) for what in objects}

    def wait_until_ready(self) -> None:
        """Wait until every node publishes; raises GraphError."""
        recorder = self._recorder
        recorder.wait_for("ground truth from sim_node", lambda: recorder.truths, 40.0, self._check_alive)
        recorder.wait_for("vergence/edge from edge_metric_node", lambda: recorder.edges, 40.0, self._check_alive)
        recorder.wait_for("gaze/state from gaze_controller_node", lambda: recorder.states, 40.0, self._check_alive)
        recorder.wait_for("vergence/box from box_metric_node", lambda: recorder.boxes, 40.0, self._check_alive)
        for what, publisher in self._places.items():
            recorder.wait_for(
                f"sim_node to subscribe to sim/{what}_pose", publisher.get_subscription_count, 20.0, self._check_alive
            )

    def put(self, what: str, place_m: Sequence[float] | npt.NDArray[np.float64]) -> None:
        """Place an object's centre in rig_base (3,) [m]."""
        message = PointStamped()
        message.header.stamp = self._recorder.node.get_clock().now().to_msg()
        message.header.frame_id = "rig_base"
        message.point.x, message.point.y, message.point.z = (float(value) for value in place_m)
        self._places[what].publish(message)

    def hide(self, what: str) -> None:
        """Place an object out of sight."""
        self.put(what, _OUT_OF_SIGHT_M)

    def clear(self) -> None:
        """Hide everything."""
        for what in self._places:
            self.hide(what)

    def send_eyes(self, version_rad: float, vergence_rad: float, tilt_rad: float) -> None:
        """Move the eyes to these angles and let them settle."""
        goal = LookAt.Goal(kind=LookAt.Goal.ANGLES, time_limit_s=5.0)
        goal.version_rad, goal.vergence_rad, goal.tilt_rad = version_rad, vergence_rad, tilt_rad
        self._recorder.look_at(goal, self._check_alive)
        self.settle()

    def settle(self) -> None:
        """Let the graph run for 0.7 s."""
        self._recorder.settle(_SETTLE_S, self._check_alive)


def class_goal(name: str, time_limit_s: float) -> LookAt.Goal:
    """Return the goal of looking at a detected class, wherever it is."""
    return LookAt.Goal(kind=LookAt.Goal.CLASS, class_name=name, time_limit_s=time_limit_s)
