"""A goal for a face before photographs of it, turned, scaled and lit: how far from between the eyes the gaze rests.

The detector is built from the face's own picture, or is the ONNX file that VERGENCE_FACE_MODEL names.
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from std_msgs.msg import Header

from bench.heads import joints_of, simulated
from bench.photos_data import photographs_rig
from bench.photos_lockstep import CONTROL_PERIOD_S, Image, Lockstep, calibrated, clock_s
from bench.results import Row
from vergence.pair_metric import PairMetric
from vergence_common.stamps import to_stamp
from vergence_gaze.estimation.observations import Observation
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.ros import gaze_messages
from vergence_metric.boxes import BoxMeasurement, Detector
from vergence_metric.boxes.parameters import BoxMetricParameters, DetectorParameters
from vergence_metric.measurement.parameters import PairMeasurementParameters
from vergence_metric.pairs.pairing import Pair
from vergence_metric.ros.box_messages import box_vergence_message
from vergence_metric.testing.face_panels import FacePanel, PanelView
from vergence_metric.testing.face_pictures import astronaut
from vergence_metric.testing.onnx_face_matcher import build_face_matcher
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import CameraSpec, Rig, default_rig
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.pair import PhotoPair, PhotoPoint
from vergence_sim.photo.world import PhotoWorld, cropped

TRIALS = 12
MODEL = "VERGENCE_FACE_MODEL"
_PHOTO_PX = 1200, 900
_BOX_PERIOD_S = 0.2
_AWAKE_S, _LIMIT_S, _REST_S = 0.3, 5.0, 1.0
_START_RAD = 0.12


def rows(say: Callable[[str], None]) -> list[Row]:
    """Look at faces, one photograph after another."""
    cv2.setNumThreads(1)
    given = os.environ.get(MODEL, "")
    with TemporaryDirectory() as folder:
        path = given or str(build_face_matcher(Path(folder) / "face.onnx", astronaut()))
        detector = Detector(DetectorParameters(model=path), threads=2)
        say(detector.describe())
        ends = [_looked(detector, seed, say) for seed in range(TRIALS)]
    off = [math.degrees(end.off_rad) for end in ends if end.verged]
    median, worst = (float(np.median(off)), max(off)) if off else (math.nan, math.nan)
    which = f"degrees, median of {TRIALS} faces, detected by {Path(given).name if given else 'the built detector'}"
    return [
        Row("people.point_deg", median, which),
        Row("people.point_worst_deg", worst, "degrees, of those verged on"),
        Row("people.faces_verged", len(off) / TRIALS, "share of the faces"),
    ]


@dataclass(frozen=True)
class _End:
    """How a goal ended: whether the eyes verged, and how far version and tilt are from between the eyes."""

    verged: bool
    off_rad: float


def _looked(detector: Detector, seed: int, say: Callable[[str], None]) -> _End:
    """Ask for a face before one photograph of it."""
    rng = np.random.default_rng([seed, 21])
    distance = float(np.exp(rng.uniform(math.log(0.5), math.log(2.0))))
    place = (distance, distance * float(rng.uniform(-0.2, 0.2)), distance * float(rng.uniform(-0.12, 0.12)))
    turned, gain = (float(rng.normal(0.0, 0.2)), float(rng.normal(0.0, 0.1))), float(rng.uniform(0.6, 1.2))
    pair, point = _photographs(FacePanel(astronaut(), place, *turned, gain), seed)
    base = photographs_rig()
    rig = cropped(simulated(base), base.left_camera.width_px, base.left_camera.height_px)
    world = PhotoWorld(pair, SimParameters.of({"seed": seed}), rig, rig)
    aside = EyeAngles(*(float(value) for value in rng.uniform(-_START_RAD, _START_RAD, 3)))
    start = pair.fixation(point)
    pans = np.clip([start.pan_left_rad + aside.pan_left_rad, start.pan_right_rad + aside.pan_left_rad], -0.4, 0.4)
    eyes = EyeAngles(float(pans[0]), float(pans[1]), start.tilt_rad + 0.5 * aside.tilt_rad)
    world.head.place(joints_of(rig, eyes), 0.0, dict.fromkeys(joints_of(rig, eyes), 0.0))
    lockstep = Lockstep(world, rig)
    lockstep.metric = MetricOfFaces(rig, world, detector)
    lockstep.advance_to(_AWAKE_S)
    lockstep.controller.look_at(Goal(GoalKind.CLASS, class_name="face"), clock_s(world.time_s))
    since = [math.inf, False]

    def note(command: object) -> None:
        verged = bool(command.report.verged)  # type: ignore[attr-defined]
        since[0] = min(since[0], world.time_s) if verged else math.inf

    lockstep.on_step = note
    while world.time_s < _AWAKE_S + _LIMIT_S and world.time_s - since[0] < _REST_S:
        lockstep.advance_to(world.time_s + CONTROL_PERIOD_S)
    _, version, tilt = world.errors_to(point)
    end = _End(math.isfinite(since[0]), math.hypot(version, tilt))
    how = "verged" if end.verged else "not verged"
    say(f"face at {distance:.2f} m: {how}, {math.degrees(end.off_rad):.2f} degrees from between the eyes")
    return end


def _photographs(panel: FacePanel, seed: int) -> tuple[PhotoPair, PhotoPoint]:
    """Return photographs of a panel by two parallel cameras, and the point between the eyes in them."""
    width, height = _PHOTO_PX
    rig = default_rig()
    camera = rig.left_camera.replaced(
        width_px=width, height_px=height, cx_px=0.5 * (width - 1), cy_px=0.5 * (height - 1)
    )
    view = PanelView(seed, rig=_with_camera(rig, camera))
    parallel = EyeAngles(0.0, 0.0, 0.0)
    (left, right), _ = view.images([panel], parallel)
    seen = [view.pixels(eye, parallel, np.array([panel.point_m]))[0] for eye in (True, False)]
    point = PhotoPoint(float(seen[0][0]), float(seen[0][1]), float(seen[0][0] - seen[1][0]))
    return PhotoPair(left, right, camera.fx_px, camera.cx_px, camera.cy_px), point


def _with_camera(rig: Rig, camera: CameraSpec) -> Rig:
    return replace(rig, left_camera=camera, right_camera=camera)


class MetricOfFaces(PairMetric):
    """The tracker on every pair and the detector on one in a while, as both metric nodes send them."""

    def __init__(self, rig: Rig, world: PhotoWorld, detector: Detector) -> None:
        super().__init__(rig, calibrated(world), PairMeasurementParameters())
        parameters = BoxMetricParameters(detector=DetectorParameters(model=str(detector.path)))
        self._boxes = BoxMeasurement(parameters, Kinematics(rig), detector)
        self._due_s = -math.inf

    def observe(self, pair: Pair[Image]) -> list[Observation]:
        """See PairMetric."""
        seen, stamp_s = super().observe(pair), pair.left_stamp_ns * 1e-9
        if stamp_s < self._due_s or self.images is None:
            return seen
        self._due_s = stamp_s + _BOX_PERIOD_S
        cameras = (self.images[0].ideal, self.images[1].ideal)
        drawn = self.ideal.draw(pair.left, pair.right)
        result = self._boxes.measure(*drawn, stamp_s, self.eyes_at(pair), cameras)
        focal_px = cameras[0].fx_px
        message = box_vergence_message(result, Header(stamp=to_stamp(stamp_s)), pair.skew_ns * 1e-9, focal_px)
        return [*seen, gaze_messages.box_sighting(message, focal_px)]
