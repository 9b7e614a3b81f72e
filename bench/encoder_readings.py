"""What the visual encoder reads of a simulated head: from features that are drawn, or from rendered images.

Drawn features serve hundreds of runs; their number and errors are those that bench_encoder measured on rendered rooms.
Either way the cameras differ from their calibration by the deviations that the encoder assumes.
"""

import math

import numpy as np
import numpy.typing as npt

from bench.heads import joints_of
from vergence_gaze.estimation.observations import EyeRotationObservation
from vergence_gaze.testing.fake_head import FakeHead
from vergence_metric.eye_rotation.encoder import EyeRotationReading as Reading
from vergence_metric.eye_rotation.encoder import VisualEncoder
from vergence_metric.eye_rotation.parameters import EncoderParameters, RestParameters
from vergence_metric.eye_rotation.relative_rotation import RigPrior, relative_rotation
from vergence_metric.pairs.ideal_images import IdealImages
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, rotation_rig_from_eye
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator

Array = npt.NDArray[np.float64]

PARAMETERS = EncoderParameters()
REST_RAD = RestParameters().max_joint_rad
MATCHES = 190
WRONG_SHARE = 0.05
COMMON_NOISE_PX = 0.08
FRAME_NOISE_PX = 0.05
READINGS_PER_REST = 3


def miscalibrated(spec: CameraModel, random: np.random.Generator) -> CameraModel:
    """Return a camera as a calibration might have found it, off by the deviations that the encoder assumes."""
    focal = 1.0 + random.normal(0.0, PARAMETERS.prior.focal_sigma)
    centre = random.normal(0.0, PARAMETERS.prior.centre_sigma_px, 2)
    distortion = spec.distortion.copy()
    distortion[0] += random.normal(0.0, PARAMETERS.prior.distortion_sigma)
    k = [spec.fx_px * focal, 0, spec.cx_px + centre[0], 0, spec.fy_px * focal, spec.cy_px + centre[1], 0, 0, 1]
    return CameraModel.from_camera_info_values(spec.width_px, spec.height_px, k, distortion.tolist())


class RestCounter:
    """Counts how often in succession a head's joints have reported the same angles."""

    def __init__(self) -> None:
        self._angles: Array | None = None
        self.times = 0

    def update(self, head: FakeHead) -> bool:
        """Update with the joints' angles reported now."""
        angles = np.array([head.reported_rad[name] for name in JOINT_NAMES])
        same = self._angles is not None and bool(np.abs(angles - self._angles).max() <= REST_RAD)
        self.times = self.times + 1 if same else 0
        self._angles = angles
        return same


def reported_eyes_rad(head: FakeHead) -> Array:
    """Return the angles of the eyes (3,) that a head's reported joints stand for, by its description."""
    return np.array(head.rig.eye_angles([head.reported_rad[name] for name in JOINT_NAMES]))


class DrawnFeatures:
    """The encoder's readings of features of a room that are drawn about the head; one object for one run."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._rest = RestCounter()
        random = np.random.default_rng([seed, 1])
        self._bend = random.normal(0.0, (PARAMETERS.prior.focal_sigma, PARAMETERS.prior.distortion_sigma), (2, 2))
        self._centre = random.normal(0.0, PARAMETERS.prior.centre_sigma_px, (2, 2))

    def __call__(self, head: FakeHead) -> EyeRotationObservation | None:
        """Return the reading, None while the eyes move or when they have been read often enough."""
        if not self._rest.update(head) or self._rest.times > READINGS_PER_REST:
            return None
        focal_px = head.rig.left_camera.fx_px
        angles = reported_eyes_rad(head)
        # One pose has one set of features, whose errors last; a frame adds little of its own.
        lasting = np.random.default_rng([self._seed, *(np.abs(angles) * 1e6).astype(int).tolist()])
        passing = np.random.default_rng([self._seed, round(head.time_s * 1e4) + 10**6])
        points = self._points(head, lasting)
        seen = np.array([np.concatenate([head.project(p, left=True), head.project(p, left=False)]) for p in points])
        seen += lasting.normal(0.0, COMMON_NOISE_PX / focal_px, seen.shape)
        seen += passing.normal(0.0, FRAME_NOISE_PX / focal_px, seen.shape)
        wrong = lasting.random(MATCHES) < WRONG_SHARE
        seen[wrong, 2:] = lasting.uniform(-0.4, 0.4, (int(wrong.sum()), 2))
        views = []
        for eye, view in enumerate((seen[:, :2], seen[:, 2:])):
            focal, lens = self._bend[eye]
            square = (view**2).sum(axis=1, keepdims=True)
            views.append(view * (1.0 + focal + lens * square) + self._centre[eye] / focal_px)
        prior = RigPrior(
            focal=PARAMETERS.prior.focal_sigma,
            distortion=PARAMETERS.prior.distortion_sigma,
            centre_rad=PARAMETERS.prior.centre_sigma_px / focal_px,
        )
        found = relative_rotation(views[0], views[1], float(angles[0]), float(angles[1]), prior)
        return EyeRotationObservation(head.time_s, 0.0, found.vergence_rad, found.sigma_rad)

    @staticmethod
    def _points(head: FakeHead, random: np.random.Generator) -> list[Array]:
        version, tilt = 0.5 * float(head.true_rad[0] + head.true_rad[1]), float(head.true_rad[2])
        turn = rotation_rig_from_eye(version, tilt)
        aside, up = random.uniform(-0.45, 0.45, MATCHES), random.uniform(-0.38, 0.38, MATCHES)
        depth = random.uniform(0.6, 4.0, MATCHES)
        return list((np.column_stack([np.ones(MATCHES), aside, up]) * depth[:, None]) @ turn.T)


class RenderedRooms:
    """The encoder on what a camera in a rendered room sees; the room stays, `begin` places the target of a run."""

    def __init__(self, rig: Rig, parameters: SimParameters) -> None:
        self._simulator = Simulator(parameters, rig)
        self._encoder = VisualEncoder(PARAMETERS, rig)
        self._images = IdealImages(rig)
        self._models = [CameraModel(self._simulator.lenses[eye].camera) for eye in ("left", "right")]
        self.readings: list[Reading] = []
        """Every reading since the start, accepted or not."""
        self.errors_rad: list[float] = []
        """Error of each accepted reading against the true vergence [rad]."""

    def begin(self, point_m: Array, seed: int) -> None:
        """Put a target somewhere for a run that begins now, with cameras that are miscalibrated anew."""
        random = np.random.default_rng([seed, 2])
        eyes = self._images.set_cameras(
            (miscalibrated(self._models[0], random), miscalibrated(self._models[1], random))
        )
        self._ideal = eyes[0].ideal, eyes[1].ideal
        self._simulator.place_target("cube", point_m)
        self._rest = RestCounter()

    def __call__(self, head: FakeHead) -> EyeRotationObservation | None:
        """Return what is read of the head as it stands, None while it moves or has been read often enough."""
        if not self._rest.update(head) or self._rest.times > READINGS_PER_REST:
            return None
        real = self._simulator.head.real
        self._simulator.set_head(joints_of(real, dict(zip(JOINT_NAMES, head.true_rad.tolist(), strict=True))))
        pair = self._simulator.capture()
        eyes = EyeAngles(*reported_eyes_rad(head).tolist())
        reading = self._encoder.measure(*self._images.draw(pair.left, pair.right), eyes, self._ideal)
        self.readings.append(reading)
        if not reading.ok or reading.rotation is None:
            return EyeRotationObservation(head.time_s, 0.0, math.nan, math.nan, usable=False, reason=reading.reason)
        found = reading.rotation
        self.errors_rad.append(found.vergence_rad - float(head.true_rad[1] - head.true_rad[0]))
        return EyeRotationObservation(head.time_s, 0.0, found.vergence_rad, found.sigma_rad)

    def close(self) -> None:
        """Free the renderer."""
        self._simulator.close()
