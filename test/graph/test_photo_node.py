"""photo_node in a graph: photographs seen by both eyes, a command that turns them, the truth, and plain refusals."""

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image, JointState
from skimage.data import stereo_motorcycle

from vergence_common.images import image_to_array
from vergence_common.qos import IMAGE_QOS
from vergence_msgs.msg import TrueVergence
from vergence_sim.ros.photo_node import PhotoNode

pytestmark = pytest.mark.graph

POINTS = [370.0, 250.0, 30.0, 200.0, 300.0, 40.0]


@pytest.fixture(scope="module")
def photographs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("photographs")
    left, right, _ = stereo_motorcycle()
    paths = {"left": str(folder / "a.png"), "right": str(folder / "b.png")}
    for path, image in zip(paths.values(), (left, right), strict=True):
        cv2.imwrite(path, cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    return paths


@pytest.fixture
def photo(graph: Any, photographs: dict[str, str]) -> PhotoNode:
    # Slow frames: many tests may share this machine.
    node: PhotoNode = graph.start(
        PhotoNode, **photographs, points_px=POINTS, **{"head.model": "rolled", "camera.frame_rate_hz": 10.0}
    )
    return node


def test_both_eyes_see_the_photographs(graph: Any, photo: PhotoNode) -> None:
    pictures = [graph.message(Image, f"{eye}/image_raw", qos=IMAGE_QOS) for eye in ("left", "right")]
    info = graph.wait(graph.message(CameraInfo, "left/camera_info"))
    assert (info.width, info.height, info.k[0], info.k[2]) == (480, 320, 539.0, 239.5)
    left, right = (image_to_array(graph.wait(picture)) for picture in pictures)
    assert left.shape == right.shape == (320, 480, 3)
    assert left.std() > 30
    assert np.abs(left.astype(float) - right).mean() > 5


def test_the_truth_follows_the_eyes_to_the_point(graph: Any, photo: PhotoNode) -> None:
    truth = graph.wait(graph.message(TrueVergence, "ground_truth/vergence"))
    assert truth.target == "point 0"
    focal_px = 0.85 * 741
    assert truth.vergence_error_rad == pytest.approx(30 / focal_px, abs=2e-3)
    assert truth.left_visible_share == truth.right_visible_share == 1.0
    command = graph.client.create_publisher(JointState, "joint_command", 10)
    graph.wait_until(command.get_subscription_count, "photo_node to listen")
    pans = [truth.version_error_rad + side * truth.vergence_error_rad / 2 for side in (-1, 1)]
    command.publish(JointState(name=["pan_left", "pan_right", "tilt"], position=[*pans, truth.elevation_error_rad]))
    there = graph.wait(
        graph.message(TrueVergence, "ground_truth/vergence", lambda m: abs(m.vergence_error_rad) < math.radians(1.1))
    )
    # SG90: half a dead band and half the play from where each was sent.
    assert abs(there.version_error_rad) < math.radians(0.6)
    assert graph.set_parameters(photo, point=1).successful
    other = graph.wait(graph.message(TrueVergence, "ground_truth/vergence", lambda m: m.target == "point 1"))
    assert abs(other.version_error_rad) > math.radians(5)


def test_of_a_point_of_unknown_depth_the_left_eye_is_known(graph: Any, photographs: dict[str, str]) -> None:
    values: dict[str, Any] = {"points_px": POINTS[:3], "rays_px": POINTS[3:5], "point": 1, "head.model": "ideal"}
    graph.start(PhotoNode, **photographs, **values, **{"camera.frame_rate_hz": 10.0})
    truth = graph.wait(graph.message(TrueVergence, "ground_truth/vergence"))
    assert truth.target == "point 1"
    # The pixel (200, 300) of 741x500 px, with both eyes straight ahead.
    left, focal_px = 200 - 370, 0.85 * 741
    assert truth.left_error_rad == pytest.approx(math.atan(math.hypot(left, 300 - 249.5) / focal_px), abs=2e-3)
    assert truth.elevation_error_rad == pytest.approx(math.atan((300 - 249.5) / focal_px), abs=2e-3)
    assert truth.left_visible_share == 1.0
    unknown = ("vergence_error_rad", "version_error_rad", "right_error_rad", "right_visible_share", "right_x_px")
    assert all(math.isnan(getattr(truth, name)) for name in unknown)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"left": "nowhere.png"}, "the left photograph 'nowhere.png' cannot be read: No such file"),
        ({"right": __file__}, "is not a picture that OpenCV can decode"),
        ({"right": "SMALLER"}, "both photographs must have one size: left is 741x500, right is 74x50 px"),
        ({"points_px": [900.0, 10.0, 5.0]}, "a point must lie inside both photographs of 741x500 px: got x 900"),
        ({"points_px": [1.0, 2.0]}, "points_px"),
        ({"rays_px": [1.0, 2.0, 3.0]}, "rays_px"),
        ({"points_px": POINTS, "point": 2}, "parameter 'point' must be less than 2"),
        ({"left": None}, "parameter 'left' must be"),
    ],
)
def test_what_cannot_be_shown_ends_it_in_plain_words(
    graph: Any, photographs: dict[str, str], tmp_path: Path, values: dict[str, Any], words: str
) -> None:
    smaller = tmp_path / "small.png"
    cv2.imwrite(str(smaller), np.zeros((50, 74, 3), np.uint8))
    given = {**photographs, **values}
    given = {name: str(smaller) if value == "SMALLER" else value for name, value in given.items() if value is not None}
    with pytest.raises(ValueError, match=words.replace("(", r"\(")):
        graph.start(PhotoNode, **given)
