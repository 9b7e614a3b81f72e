"""What is estimated of a head's geometry, what is known of it before, and the rig that follows from the estimate.

Some quantities cannot be seen, and stay as rig.yaml has them:

- the tilt's zero: without gravity the whole world may be tilted instead;
- each camera's yaw: yaw and the pan's zero are one angle, of which the zero is estimated;
- the pan axes' mean x and heights and the lenses' mean height: only how lenses stand to the tilt axis shows;
- the baseline, the one length that must be given: images alone have no scale.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vergence_calibration.identification.axis_log import EYES, EyeCamera
from vergence_rig.rig import CameraSpec, EyeMount, Joints, JointSpec, Rig

Array = npt.NDArray[np.float64]

EYE_UNKNOWNS = (
    "lens_x_m",
    "lens_y_m",
    "roll_rad",
    "pitch_rad",
    "zero_rad",
    "scale",
    "half_play_rad",
    "log_focal",
    "log_aspect",
    "cx_px",
    "cy_px",
    "k1",
    "k2",
    "p1",
    "p2",
)
"""Of each eye; `log_focal` is the logarithm of focal length over the start's, `log_aspect` that of fy / fx over the
start's, `half_play_rad` half the pan's play."""

HEAD_UNKNOWNS = (
    "lens_z_apart_m",
    "axis_x_apart_m",
    "tilt_scale",
    "tilt_half_play_rad",
    "tilt_axis_x_m",
    "tilt_axis_z_m",
)
"""Of both eyes together; `lens_z_apart_m` is the left lens's height above the right one's, `axis_x_apart_m` how far the
left pan axis stands before the right one."""

CAMERA_UNKNOWNS = EYE_UNKNOWNS[EYE_UNKNOWNS.index("log_focal") :]

NAMES = tuple(f"{eye}.{name}" for eye in EYES for name in EYE_UNKNOWNS) + HEAD_UNKNOWNS
"""Every unknown, in the order of all vectors and covariances."""

_DEG = math.pi / 180.0
_SIGMA_M = 0.03
_APART_SIGMA_M, _AXES_APART_SIGMA_M = 0.005, 0.002
_TILT_AXIS_SIGMA_M = 0.05
_MOUNT_SIGMA_RAD = 4.0 * _DEG
_ZERO_SIGMA_RAD = 6.0 * _DEG
_SCALE_SIGMA = 0.05
_FOCAL_SIGMA = 0.1
_CENTRE_SHARE = 0.03  # of the image's width
_ASPECT_SIGMA, _TANGENTIAL_SIGMA = 0.003, 0.001
_K1_SIGMA, _K2_SIGMA = 0.1, 0.1
_LEAST_PLAY_SIGMA_RAD = 0.05 * _DEG
_UNIFORM_TO_SIGMA = 1.0 / math.sqrt(3.0)


def index(name: str, eye: str = "") -> int:
    """Return where an unknown stands in NAMES."""
    return NAMES.index(f"{eye}.{name}" if eye else name)


@dataclass(frozen=True)
class Prior:
    """What is known before: means and standard deviations (G,) as NAMES; 0 for what is held.

    `joint_sigma_rad` (3,) is of each joint's deviation at rest, as JOINT_NAMES.
    """

    means: Array
    sigmas: Array
    joint_sigma_rad: Array


def prior_of(rig: Rig, cameras: Mapping[str, EyeCamera]) -> Prior:
    """Return the prior that a rig and its cameras give: a calibrated camera is held, all else may be off by a lot."""
    means, sigmas = np.zeros(len(NAMES)), np.zeros(len(NAMES))

    def put(name: str, mean: float, sigma: float, eye: str = "") -> None:
        means[index(name, eye)], sigmas[index(name, eye)] = mean, sigma

    for eye in EYES:
        mount, joint, camera = rig.mount(eye == "left"), rig.joints[f"pan_{eye}"], cameras[eye]
        put("lens_x_m", mount.lens_x_m, _SIGMA_M, eye)
        put("lens_y_m", mount.lens_y_m, _SIGMA_M, eye)
        put("roll_rad", mount.roll_rad, _MOUNT_SIGMA_RAD, eye)
        put("pitch_rad", mount.pitch_rad, _MOUNT_SIGMA_RAD, eye)
        put("zero_rad", joint.zero_rad, _ZERO_SIGMA_RAD, eye)
        put("scale", joint.scale, _SCALE_SIGMA, eye)
        put("half_play_rad", joint.servo.half_play_rad, _play_sigma(joint), eye)
        model, free = camera.model, 0.0 if camera.calibrated else 1.0
        centre_px = _CENTRE_SHARE * model.width_px
        bent = not camera.calibrated and model.distortion_model == "plumb_bob"
        k1, k2, p1, p2 = model.distortion[:4] if bent and len(model.distortion) else (0.0,) * 4
        put("log_focal", 0.0, free * _FOCAL_SIGMA, eye)
        put("log_aspect", 0.0, free * _ASPECT_SIGMA, eye)
        put("cx_px", model.cx_px, free * centre_px, eye)
        put("cy_px", model.cy_px, free * centre_px, eye)
        put("k1", k1, free * _K1_SIGMA, eye)
        put("k2", k2, free * _K2_SIGMA, eye)
        put("p1", p1, free * _TANGENTIAL_SIGMA, eye)
        put("p2", p2, free * _TANGENTIAL_SIGMA, eye)
    put("lens_z_apart_m", rig.left_mount.lens_z_m - rig.right_mount.lens_z_m, _APART_SIGMA_M)
    put("axis_x_apart_m", rig.left_mount.axis_x_m - rig.right_mount.axis_x_m, _AXES_APART_SIGMA_M)
    put("tilt_scale", rig.tilt.scale, _SCALE_SIGMA)
    put("tilt_half_play_rad", rig.tilt.servo.half_play_rad, _play_sigma(rig.tilt))
    put("tilt_axis_x_m", rig.tilt_axis_x_m, _TILT_AXIS_SIGMA_M)
    put("tilt_axis_z_m", rig.tilt_axis_z_m, _TILT_AXIS_SIGMA_M)
    at_rest = [_UNIFORM_TO_SIGMA * joint.servo.uncertainty_rad for _, joint in rig.joints.items()]
    return Prior(means, sigmas, np.maximum(at_rest, _LEAST_PLAY_SIGMA_RAD))


def _play_sigma(joint: JointSpec) -> float:
    return max(0.5 * joint.servo.half_play_rad, _LEAST_PLAY_SIGMA_RAD)


def rig_of(rig: Rig, values: Array, cameras: Mapping[str, EyeCamera]) -> Rig:
    """Return the rig with estimated values (G,); plays stay, and so does the camera of rig.yaml of a calibrated eye."""
    higher_m = values[index("lens_z_apart_m")] - (rig.left_mount.lens_z_m - rig.right_mount.lens_z_m)
    ahead_m = values[index("axis_x_apart_m")] - (rig.left_mount.axis_x_m - rig.right_mount.axis_x_m)
    mounts, pans, specs = {}, {}, {}
    for eye, side in zip(EYES, (0.5, -0.5), strict=True):
        found = {name: float(values[index(name, eye)]) for name in EYE_UNKNOWNS}
        mounts[eye] = _mount(rig.mount(eye == "left"), found, side * float(higher_m), side * float(ahead_m))
        pans[eye] = replace(
            rig.joints[f"pan_{eye}"], zero_rad=round(found["zero_rad"], 6), scale=round(found["scale"], 6)
        )
        spec = rig.camera(eye == "left")
        specs[eye] = spec if cameras[eye].calibrated else _camera(cameras[eye], found)
    tilt = replace(rig.tilt, scale=round(float(values[index("tilt_scale")]), 6))
    return replace(
        rig,
        left_mount=mounts["left"],
        right_mount=mounts["right"],
        left_camera=specs["left"],
        right_camera=specs["right"],
        joints=Joints(pans["left"], pans["right"], tilt),
        tilt_axis_x_m=round(float(values[index("tilt_axis_x_m")]), 6),
        tilt_axis_z_m=round(float(values[index("tilt_axis_z_m")]), 6),
    )


def _mount(mount: EyeMount, found: Mapping[str, float], higher_m: float, ahead_m: float) -> EyeMount:
    names = ("lens_x_m", "lens_y_m", "roll_rad", "pitch_rad")
    return mount.replaced(
        **{name: round(found[name], 6) for name in names},
        lens_z_m=round(mount.lens_z_m + higher_m, 6),
        axis_x_m=round(mount.axis_x_m + ahead_m, 6),
    )


def _camera(camera: EyeCamera, found: Mapping[str, float]) -> CameraSpec:
    model, grown = camera.model, math.exp(found["log_focal"])
    return CameraSpec(
        width_px=model.width_px,
        height_px=model.height_px,
        fx_px=round(grown * model.fx_px, 2),
        fy_px=round(grown * math.exp(found["log_aspect"]) * model.fy_px, 2),
        cx_px=round(found["cx_px"], 2),
        cy_px=round(found["cy_px"], 2),
        distortion=(*(round(found[name], 5) for name in ("k1", "k2", "p1", "p2")), 0.0),
    )
