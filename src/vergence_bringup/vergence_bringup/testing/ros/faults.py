"""The faults that are injected into the graph: what each does, which diagnostic names it, and what the head does.

docs/faults.md is made of this table, and test/faults tries every row.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from sensor_msgs.msg import CameraInfo, Image, JointState

from vergence_bringup.testing.ros.faulty_head import FaultyHead, Shown
from vergence_common.stamps import from_nanoseconds, to_nanoseconds

HOLDS, LOOKS_ON = (
    "holds still, is not verged; a goal ends with NO_IMAGES or NO_FEEDBACK",
    "goes on with what is measured",
)
_S = 1_000_000_000


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes:
        name: in words, as in the table.
        inject: changes the head; `FaultyHead.heal` ends it.
        source: end of the name of the diagnostic that names it.
        words: what that diagnostic then says.
        head: what the head does meanwhile.
        wall_moves: whether what is looked at comes nearer meanwhile, so that eyes that stay are no longer verged.
    """

    name: str
    inject: Callable[[FaultyHead], None]
    source: str
    words: str
    head: str
    wall_moves: bool = False


def _pictures(change: Callable[[list[Any]], list[Any]]) -> Callable[[FaultyHead], None]:
    """Return what replaces the pictures of every pair."""

    def inject(head: FaultyHead) -> None:
        def show(shown: Shown) -> None:
            shown.pictures = change(shown.pictures)

        head.show = show

    return inject


def _frozen(left: bool, right: bool) -> Callable[[FaultyHead], None]:
    def inject(head: FaultyHead) -> None:
        held: list[Any] = []

        def show(shown: Shown) -> None:
            held.extend(shown.pictures if not held else [])
            shown.pictures = [
                kept if froze else new for kept, froze, new in zip(held, (left, right), shown.pictures, strict=True)
            ]

        head.show = show

    return inject


def _stamps(change: Callable[[list[int]], list[int]]) -> Callable[[FaultyHead], None]:
    def inject(head: FaultyHead) -> None:
        def show(shown: Shown) -> None:
            shown.stamps_ns = change(shown.stamps_ns)

        head.show = show

    return inject


def _slow(head: FaultyHead) -> None:
    def show(shown: Shown) -> None:
        if shown.number % 13:
            shown.pictures = [None, None]

    head.show = show


def _messages(change: Callable[[Image], None]) -> Callable[[FaultyHead], None]:
    def inject(head: FaultyHead) -> None:
        def show(shown: Shown) -> None:
            shown.change = change

        head.show = show

    return inject


def _encoding(message: Image) -> None:
    message.encoding = "32FC1"


def _step(message: Image) -> None:
    message.step -= 1


def _half_size(pictures: list[Any]) -> list[Any]:
    return [pictures[0], np.ascontiguousarray(pictures[1][::2, ::2])]


def _noise(pictures: list[Any]) -> list[Any]:
    random = np.random.default_rng()
    return [pictures[0], random.integers(0, 256, pictures[1].shape, dtype=np.uint8)]


def _cameras(change: Callable[[CameraInfo], None]) -> Callable[[FaultyHead], None]:
    def inject(head: FaultyHead) -> None:
        head.describe = change

    return inject


def _focal(message: CameraInfo) -> None:
    message.k[0] = 1.0


def _distortion(message: CameraInfo) -> None:
    message.d = [0.0, 0.0, 0.0, 0.0, 1e308]


def _joints(change: Callable[[JointState], list[JointState]]) -> Callable[[FaultyHead], None]:
    def inject(head: FaultyHead) -> None:
        head.report = change

    return inject


def _foreign(message: JointState) -> list[JointState]:
    message.name = [f"arm_{name}" for name in message.name]
    return [message]


def _nan(message: JointState) -> list[JointState]:
    message.position[0] = float("nan")
    return [message]


def _velocities(message: JointState) -> list[JointState]:
    message.position, message.velocity = [], [0.0, 0.0, 0.0]
    return [message]


def _shifted(by_s: float) -> Callable[[JointState], list[JointState]]:
    def change(message: JointState) -> list[JointState]:
        message.header.stamp = from_nanoseconds(to_nanoseconds(message.header.stamp) + round(by_s * _S))
        return [message]

    return change


def _zero_stamp(message: JointState) -> list[JointState]:
    message.header.stamp = from_nanoseconds(0)
    return [message]


def _frozen_reports(head: FaultyHead) -> None:
    held = head.joints_rad.tolist()

    def report(message: JointState) -> list[JointState]:
        message.position = held
        return [message]

    head.report = report


def _stuck(head: FaultyHead) -> None:
    head.follows = False


_LEFT, _RIGHT, _PICTURES = (
    "edge_metric_node: left images",
    "edge_metric_node: right images",
    "edge_metric_node: pictures",
)
_PAIRS, _CAMERAS = "edge_metric_node: pairs", "edge_metric_node: cameras"
_JOINTS, _GAZE = "edge_metric_node: joint_states", "gaze_controller_node: gaze"

FAULTS: tuple[Fault, ...] = (
    Fault("the left camera sends nothing", _pictures(lambda p: [None, p[1]]), _LEFT, "no image for", HOLDS, True),
    Fault("both cameras send nothing", _pictures(lambda p: [None, None]), _LEFT, "no image for", HOLDS, True),
    Fault(
        "the left image is frozen, with new stamps",
        _frozen(True, False),
        _PICTURES,
        "left image is frozen",
        HOLDS,
        True,
    ),
    Fault("both images are frozen, with new stamps", _frozen(True, True), _PICTURES, "image is frozen", HOLDS, True),
    Fault(
        "one camera feeds both eyes", _pictures(lambda p: [p[0], p[0]]), _PICTURES, "show the same picture", HOLDS, True
    ),
    Fault("both images are black", _pictures(lambda p: [np.zeros_like(x) for x in p]), _PICTURES, "is black", HOLDS),
    Fault(
        "the right image is black", _pictures(lambda p: [p[0], np.zeros_like(p[1])]), _PICTURES, "is black", LOOKS_ON
    ),
    Fault(
        "the left image is white", _pictures(lambda p: [np.full_like(p[0], 255), p[1]]), _PICTURES, "is white", LOOKS_ON
    ),
    Fault("the right image is noise", _pictures(_noise), _PICTURES, "nothing but noise", LOOKS_ON),
    Fault(
        "the right image is mirrored",
        _pictures(lambda p: [p[0], cv2.flip(p[1], 1)]),
        _PICTURES,
        "is mirrored",
        LOOKS_ON,
    ),
    Fault(
        "the left image is upside down",
        _pictures(lambda p: [cv2.flip(p[0], -1), p[1]]),
        _PICTURES,
        "upside down",
        LOOKS_ON,
    ),
    Fault("left and right image are swapped", _pictures(lambda p: [p[1], p[0]]), _PICTURES, "swapped", LOOKS_ON, True),
    Fault("the cameras send 1.5 images a second", _slow, _LEFT, "slower than needed", LOOKS_ON),
    Fault("all stamps of images are zero", _stamps(lambda s: [0, 0]), _LEFT, "they are zero", HOLDS, True),
    Fault("stamps of images stand", _stamps(lambda s: [5 * _S, 5 * _S]), _RIGHT, "stamps must increase", HOLDS),
    Fault("stamps of images are 10 s old", _stamps(lambda s: [x - 10 * _S for x in s]), _LEFT, "s old", HOLDS),
    Fault(
        "stamps of images are 10 s ahead",
        _stamps(lambda s: [x + 10 * _S for x in s]),
        _LEFT,
        "ahead of the clock",
        HOLDS,
    ),
    Fault(
        "the right eye's stamps are 1.5 s late",
        _stamps(lambda s: [s[0], s[1] - 3 * _S // 2]),
        _PAIRS,
        "no pair",
        HOLDS,
    ),
    Fault("images of an unknown encoding", _messages(_encoding), _LEFT, "encoding must be one of", HOLDS, True),
    Fault("images with a wrong step", _messages(_step), _RIGHT, "step must be at least", HOLDS),
    Fault("eyes of two sizes", _pictures(_half_size), _CAMERAS, "right/camera_info", LOOKS_ON),
    Fault("camera_info with a focal length of 1 px", _cameras(_focal), _CAMERAS, "fx must be", LOOKS_ON),
    Fault("camera_info with distortion 1e308", _cameras(_distortion), _CAMERAS, "distortion must be", LOOKS_ON),
    Fault("joint_states stop", _joints(lambda m: []), _JOINTS, "have stopped", HOLDS),
    Fault("joint_states with foreign names", _joints(_foreign), _GAZE, "joint_states", HOLDS),
    Fault("joint_states with NaN", _joints(_nan), _JOINTS, "must be a finite angle", HOLDS),
    Fault("joint_states with velocities alone", _joints(_velocities), _JOINTS, "positions must be given", HOLDS),
    Fault("joint_states with stamps at zero", _joints(_zero_stamp), _JOINTS, "the stamp must be set", HOLDS),
    Fault("joint_states 0.3 s late", _joints(_shifted(-0.3)), _GAZE, "joint_states are late", HOLDS),
    Fault("joint_states 1 s in the future", _joints(_shifted(1.0)), _JOINTS, "must not be in the future", HOLDS),
    Fault("a stuck servo", _stuck, _GAZE, "do not follow their commands", HOLDS, True),
    Fault("joint_states frozen, servos turn", _frozen_reports, _GAZE, "do not follow their commands", HOLDS, True),
)
