"""Points in frames of tf are transformed at their stamp. tf2 is replaced here: the wheels have none."""

import sys
import types
from typing import Any

import pytest
from builtin_interfaces.msg import Time as Stamp
from geometry_msgs.msg import Point, Transform, TransformStamped
from rclpy.node import Node
from rclpy.time import Time

from vergence_gaze.joints.frames import FrameError
from vergence_gaze.ros.point_frames import PointFrames

from .conftest import Graph

pytestmark = pytest.mark.graph


class TransformException(Exception):  # noqa: N818 - tf2's own name
    pass


class ExtrapolationException(TransformException):
    pass


class Buffer:
    """A frame whose x is its time [s], from 10 to 20 s."""

    asked_s: list[float] = []  # noqa: RUF012 - cleared by the fixture

    def lookup_transform(self, target: str, source: str, time: Time) -> TransformStamped:
        asked_s = time.nanoseconds * 1e-9
        Buffer.asked_s.append(asked_s)
        if source != "arm":
            raise TransformException(f"no frame {source}")
        if asked_s and not 10.0 <= asked_s <= 20.0:
            raise ExtrapolationException(f"{asked_s:.3f} s is not in the buffer")
        found = TransformStamped(transform=Transform())
        found.transform.translation.x = asked_s or 20.0
        found.transform.rotation.w = 1.0
        found.header.stamp = Stamp(sec=20)
        return found


class NoJoints:
    """A controller that transforms nothing by itself."""

    def frame_to_rig(self, point_m: Any, frame: str, stamp_s: float) -> tuple[float, float, float]:
        raise FrameError(f"not of the head: {frame}")


@pytest.fixture
def frames(graph: Graph, monkeypatch: pytest.MonkeyPatch) -> PointFrames:
    tf2: Any = types.ModuleType("tf2_ros")
    tf2.Buffer, tf2.TransformListener = Buffer, lambda buffer, node: None
    tf2.TransformException, tf2.ExtrapolationException = TransformException, ExtrapolationException
    monkeypatch.setitem(sys.modules, "tf2_ros", tf2)
    Buffer.asked_s = []
    return PointFrames(graph.add(Node("frames", context=graph.context)), NoJoints())  # type: ignore[arg-type]


def test_a_point_is_transformed_at_its_stamp_not_at_the_newest_time(frames: PointFrames) -> None:
    assert frames.in_rig(Point(y=1.0), "arm", 12.5) == pytest.approx((12.5, 1.0, 0.0))
    assert Buffer.asked_s == [12.5]


def test_without_a_stamp_it_is_the_newest(frames: PointFrames) -> None:
    assert frames.in_rig(Point(), "arm", float("nan"))[0] == pytest.approx(20.0)


def test_a_fresh_point_may_be_a_little_ahead_of_tf(frames: PointFrames) -> None:
    assert frames.in_rig(Point(), "arm", 20.1)[0] == pytest.approx(20.0)


@pytest.mark.parametrize(("frame", "stamp_s"), [("arm", 21.0), ("arm", 9.0), ("leg", 12.0)])
def test_what_tf_does_not_have_is_refused(frames: PointFrames, frame: str, stamp_s: float) -> None:
    with pytest.raises(FrameError, match=f"got '{frame}'"):
        frames.in_rig(Point(), frame, stamp_s)
