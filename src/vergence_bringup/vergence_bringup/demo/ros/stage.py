"""What stands before the eyes at a station, and the eyes' start: the simulated room's objects."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import PointStamped

from vergence_bringup.demo.photographs import PhotoFigures
from vergence_bringup.demo.ros.recorder import Recorder
from vergence_bringup.demo.stations import Station
from vergence_common.stamps import to_stamp
from vergence_msgs.action import LookAt

_OUT_OF_SIGHT_M = (10.0, 0.0, -10.0)
_SETTLE_S = 0.7


class Stage:
    """The eyes of a running head before a world, which subclasses change; `check_alive` raises when a node has ended.

    `source` is the executable that stands for cameras, servos and world.
    """

    source = ""

    def __init__(self, recorder: Recorder, check_alive: Callable[[], None]) -> None:
        self._recorder, self._check_alive = recorder, check_alive

    def wait_until_ready(self) -> None:
        """Wait until every node publishes; raises GraphError."""
        recorder = self._recorder
        recorder.time.begin(self._check_alive)
        recorder.wait_for(f"ground truth from {self.source}", lambda: recorder.truths, 40.0, self._check_alive)
        recorder.wait_for("vergence/edge from edge_metric_node", lambda: recorder.edges, 40.0, self._check_alive)
        recorder.wait_for("gaze/state from gaze_controller_node", lambda: recorder.states, 40.0, self._check_alive)
        recorder.wait_for("vergence/box from box_metric_node", lambda: recorder.boxes, 40.0, self._check_alive)

    def clear(self) -> None:
        """Take away what the last station showed."""

    def show(self, station: Station) -> None:
        """Show a station's target; the eyes are at its start."""
        raise NotImplementedError

    def set_moving(self, station: Station, moving: bool) -> None:
        """Begin or end the motion of a station's target."""
        raise NotImplementedError

    def photo_figures(self, station: Station, truth: Any) -> PhotoFigures | None:
        """Return what a TrueVergence message at rest says of a point of photographs; None in a room."""
        return None

    def send_eyes(self, version_rad: float, vergence_rad: float, tilt_rad: float) -> None:
        """Move the eyes to these angles and let them settle."""
        goal = LookAt.Goal(kind=LookAt.Goal.ANGLES, time_limit_s=5.0)
        goal.version_rad, goal.vergence_rad, goal.tilt_rad = version_rad, vergence_rad, tilt_rad
        self._recorder.look_at(goal, self._check_alive)
        self.settle()

    def settle(self) -> None:
        """Let the graph run for 0.7 s."""
        self._recorder.settle(_SETTLE_S, self._check_alive)


class RoomStage(Stage):
    """The simulated room's movable `objects`: target, distractor, occluder."""

    source = "sim_node"

    def __init__(self, recorder: Recorder, check_alive: Callable[[], None], objects: Sequence[str]) -> None:
        super().__init__(recorder, check_alive)
        self._places = {what: recorder.node.create_publisher(PointStamped, f"sim/{what}_pose", 10) for what in objects}

    def wait_until_ready(self) -> None:
        """Wait until every node publishes and sim_node places objects; raises GraphError."""
        super().wait_until_ready()
        for what, publisher in self._places.items():
            self._recorder.time.wait_for_answer(
                f"sim_node to subscribe to sim/{what}_pose", publisher.get_subscription_count, 20.0, self._check_alive
            )

    def put(self, what: str, place_m: Sequence[float] | npt.NDArray[np.float64]) -> None:
        """Place an object's centre in rig_base (3,) [m]."""
        message = PointStamped()
        message.header.stamp = to_stamp(self._recorder.now_s())
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

    def show(self, station: Station) -> None:
        """Place a station's target, and its distractor if it has one."""
        self._recorder.set_parameters(self.source, {"target.object": station.target}, self._check_alive)
        if station.distractor_m:
            self.put("distractor", station.distractor_m)
        self.put("target", station.place_m or self._fixation_m())

    def set_moving(self, station: Station, moving: bool) -> None:
        """Begin or end the motion of a station's target."""
        motion = dict(station.motion) if moving else {"motion.kind": "static"}
        self._recorder.set_parameters(self.source, motion, self._check_alive)

    def _fixation_m(self) -> Sequence[float]:
        """Return the fixation point (3,) [m] that the controller reports while the eyes rest."""
        now = self._recorder.now_s()
        entry = self._recorder.wait_for(
            "gaze/fixation_point from gaze_controller_node",
            lambda: next((entry for entry in self._recorder.fixations[-1:] if entry.arrival_s >= now), None),
            5.0,
            self._check_alive,
        )
        point = entry.message.point
        return point.x, point.y, point.z


def class_goal(name: str, time_limit_s: float) -> LookAt.Goal:
    """Return the goal of looking at a detected class, wherever it is."""
    return LookAt.Goal(kind=LookAt.Goal.CLASS, class_name=name, time_limit_s=time_limit_s)
