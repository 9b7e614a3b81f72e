"""photo_node: a pair of photographs as the world, in real time, with the topics of cameras, servos and ground truth."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PointStamped
from std_msgs.msg import Header

from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet
from vergence_msgs.msg import TrueVergence
from vergence_rig.geometry import GeometryError, point_at
from vergence_rig.parameters import ParameterError
from vergence_rig.rig import CameraSpec
from vergence_rig.rig_file import load_rig
from vergence_rig.servo import IDEAL
from vergence_sim.camera_parameters import CameraParameters, RightCameraParameters
from vergence_sim.heads import HeadParameters, simulated_head
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.pair import PhotoPoint, read_pair
from vergence_sim.photo.parameters import GROUPS, PhotoParameters, PlantParameters, sim_parameters
from vergence_sim.photo.world import PhotoWorld, cropped
from vergence_sim.ros.world_node import WorldNode
from vergence_sim.world import EYES


class PhotoNode(WorldNode):
    """Both eyes before a pair of photographs, in real time."""

    def __init__(self, **options: Any) -> None:
        super().__init__("photo_node", GROUPS, **options)
        pair, width, height = self._pair, self._rig.left_camera.width_px, self._rig.left_camera.height_px
        self.get_logger().info(
            f"showing two photographs of {pair.width_px}x{pair.height_px} px, focal length {pair.fx_px:.0f} px, "
            f"in views of {width}x{height} px"
        )

    def _prepare(self, settings: ParameterSet) -> None:
        photo = settings.get(PhotoParameters)
        view_px = photo.view_width_px, photo.view_height_px
        # An ideal head is described as one: its driver knows where it is.
        ideal = photo.preset == "ideal"
        rig = load_rig(photo.rig)
        rig = rig.with_servos(IDEAL) if ideal else rig
        head = simulated_head(self._sim_parameters(settings).head, rig)
        self._rig = cropped(rig, *view_px)
        self._head = cropped(head if ideal else settings.get(PlantParameters).fitted(head), *view_px)
        self._pair = read_pair(photo.left, photo.right, photo.fx_px, photo.cx_px or None, photo.cy_px or None)
        for point in photo.points:
            self._pair.check(point)
        self._check_point(photo)
        self._true_vergence = self._qos.create_publisher(TrueVergence, "ground_truth/vergence")
        self._true_target = self._qos.create_publisher(PointStamped, "ground_truth/target")

    def _make_world(self) -> PhotoWorld:
        return PhotoWorld(self._pair, self._sim_parameters(self._settings), self._rig, self._head)

    def _sim_parameters(self, settings: ParameterSet) -> SimParameters:
        return sim_parameters(
            settings.get(PhotoParameters),
            settings.get(HeadParameters),
            settings.get(CameraParameters),
            settings.get(RightCameraParameters),
        )

    def _check_point(self, photo: PhotoParameters) -> None:
        if photo.points and photo.point >= len(photo.points):
            raise ParameterError("point", photo.point, f"less than {len(photo.points)}, the number of points")

    def _publish_truth(self, stamp: Any, world: PhotoWorld) -> None:
        photo = self._settings.get(PhotoParameters)
        if photo.point >= len(photo.points):
            return
        if self._true_vergence.get_subscription_count() or self._true_target.get_subscription_count():
            truth = _true_vergence(stamp, world, photo.points[photo.point], f"point {photo.point}")
            self._true_vergence.publish(truth)
            self._true_target.publish(PointStamped(header=truth.header, point=truth.target_point))


def _true_vergence(stamp: Any, world: PhotoWorld, point: PhotoPoint, name: str) -> TrueVergence:
    """Return the truth about a point; its place is where both rays meet from eyes the rig's baseline apart.

    What needs a disparity that is not known is NaN.
    """
    eyes = world.eye_angles
    try:
        ahead = world.pair.fixation(point)
        place = point_at(ahead.version_rad, ahead.vergence_rad, ahead.tilt_rad, world.rig.baseline_m)
    except GeometryError:
        place = np.full(3, math.nan)
    vergence, version, tilt = world.errors_to(point)
    pixels = {eye: world.project(eye, point) for eye in EYES}
    off, off_principal = world.angles_to_foveas(point), world.angles_to_principal_points(point)
    seen = {eye: _shows(world.lenses[eye].camera, pixels[eye]) for eye in EYES}
    x, y, z = (float(value) for value in place)
    return TrueVergence(
        header=Header(stamp=stamp, frame_id="rig_base"),
        target=name,
        target_point=Point(x=x, y=y, z=z),
        pan_left_rad=eyes.pan_left_rad,
        pan_right_rad=eyes.pan_right_rad,
        tilt_rad=eyes.tilt_rad,
        vergence_error_rad=vergence,
        version_error_rad=version,
        elevation_error_rad=tilt,
        left_error_rad=off[0],
        right_error_rad=off[1],
        left_principal_error_rad=off_principal[0],
        right_principal_error_rad=off_principal[1],
        mean_disparity_px=pixels["left"][0] - pixels["right"][0],
        left_visible_share=seen["left"],
        right_visible_share=seen["right"],
        left_x_px=pixels["left"][0],
        left_y_px=pixels["left"][1],
        right_x_px=pixels["right"][0],
        right_y_px=pixels["right"][1],
    )


def _shows(camera: CameraSpec, pixel: tuple[float, float]) -> float:
    """Return 1 for a pixel in the image, 0 for one outside, NaN for one that is not known."""
    if not all(map(math.isfinite, pixel)):
        return math.nan
    return float(0 <= pixel[0] <= camera.width_px - 1 and 0 <= pixel[1] <= camera.height_px - 1)


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see `vergence_common.node_main`."""
    return run_node(PhotoNode, args, GROUPS)
