"""What eye_rotation_node says reaches the controller's distance, and what cannot be is refused and reported."""

import math
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from vergence_common.stamps import to_stamp
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_msgs.msg import EyeRotation
from vergence_rig.rig import JOINT_NAMES

pytestmark = pytest.mark.graph

VERGENCE_RAD = 0.06


class Encoder:
    """Publishes resting joints, and readings of them, with the present time."""

    def __init__(self, graph: Any) -> None:
        self.graph = graph
        self.joints = graph.client.create_publisher(JointState, "joint_states", 10)
        self.readings = graph.client.create_publisher(EyeRotation, "vergence/eye_rotation", 10)
        for publisher in (self.joints, self.readings):
            graph.wait_until(lambda p=publisher: p.get_subscription_count() > 0, "the controller subscribes")

    def rest(self) -> float:
        """Publish the joints and return the stamp."""
        now_s = float(self.graph.client.get_clock().now().nanoseconds * 1e-9)
        positions = [-0.5 * VERGENCE_RAD, 0.5 * VERGENCE_RAD, 0.0]
        header = Header(stamp=to_stamp(now_s))
        self.joints.publish(JointState(header=header, name=list(JOINT_NAMES), position=positions))
        return now_s

    def read(self, off_rad: float, status: int = EyeRotation.STATUS_OK) -> None:
        """Publish a vergence that is off the joints'."""
        header = Header(stamp=to_stamp(self.rest()), frame_id="left")
        self.readings.publish(
            EyeRotation(
                header=header,
                vergence_rad=VERGENCE_RAD + off_rad,
                sigma_rad=3e-4,
                status=status,
                reason="" if status == EyeRotation.STATUS_OK else "rejected",
            )
        )

    def until(self, done: Any, off_rad: float, status: int = EyeRotation.STATUS_OK) -> None:
        """Read again and again until `done`; each reading is newer than the joints' rest."""

        def asked() -> bool:
            if not done():
                self.read(off_rad, status)
                self.graph.executor.spin_once(timeout_sec=0.05)
                return False
            return True

        self.graph.wait_until(asked, "the controller has made up its mind")


def values(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


@pytest.fixture
def node(graph: Any) -> GazeControllerNode:
    started: GazeControllerNode = graph.start(GazeControllerNode)
    return started


def test_a_reading_moves_the_vergence_that_the_controller_reckons_with(graph: Any, node: GazeControllerNode) -> None:
    encoder, learnt = Encoder(graph), node._controller.vergence_offset
    off_rad = 0.001
    encoder.until(lambda: learnt.accepted >= 2, off_rad)
    assert learnt.offset_rad == pytest.approx(off_rad, abs=2e-4)
    assert math.sqrt(learnt.variance) <= 3e-4
    status = graph.diagnostic("gaze", lambda s: int(values(s).get("eye_rotations_accepted", "0")) >= 2)
    assert "eye_rotation_rejection" not in values(status)


def test_a_reading_beyond_servos_and_mounts_is_refused_and_reported(graph: Any, node: GazeControllerNode) -> None:
    encoder, learnt = Encoder(graph), node._controller.vergence_offset
    encoder.until(lambda: learnt.rejected >= 2 and "contradicts" in learnt.rejection, 0.09)
    assert learnt.accepted == 0
    assert learnt.offset_rad == 0.0
    status = graph.diagnostic("gaze", lambda s: "contradicts" in values(s).get("eye_rotation_rejection", ""))
    assert values(status)["eye_rotations_accepted"] == "0"


def test_what_the_encoder_does_not_believe_itself_is_not_counted(graph: Any, node: GazeControllerNode) -> None:
    encoder, learnt = Encoder(graph), node._controller.vergence_offset
    for _ in range(5):
        encoder.read(0.001, EyeRotation.STATUS_UNCERTAIN)
    encoder.until(lambda: learnt.accepted >= 1, 0.001)
    assert learnt.offset_rad == pytest.approx(0.001, abs=3e-4)
    encoder.read(0.3, EyeRotation.STATUS_CONTRADICTORY)
    before = learnt.accepted
    encoder.until(lambda: learnt.accepted > before, 0.001)
    assert learnt.offset_rad == pytest.approx(0.001, abs=3e-4)
