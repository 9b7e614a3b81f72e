"""A head as it comes off a printer: nothing stands quite where rig.yaml's defaults have it."""

import math
from dataclasses import replace

import numpy as np

from vergence_rig.rig import CameraSpec, EyeMount, Joints, Rig, default_rig

LENS_AHEAD_M, TILT_AXIS_BELOW_M = 0.022, 0.045

_MM, _DEG = 1e-3, math.pi / 180.0
_DISTORTION = np.array([-0.04, 0.02, 0.0, 0.0, 0.0])
_DISTORTION_OFF = np.array([0.01, 0.005, 5e-4, 5e-4, 0.0])


def printed_head(seed: int) -> Rig:
    """Return a head with the default's baseline, image size and joint limits, all else a seeded amount off.

    Lenses about 22 mm before their pan axes and up to 4 mm beside them, at heights up to 1.5 mm apart, the tilt axis
    about 45 mm below. Cameras rolled up to 2 degrees, pitched up to 2 degrees apart, yawed up to 3. Horn zeros up to 4
    degrees off, joints turning 0.95 to 1.05 times what is commanded. Principal points up to 25 px off, focal lengths 1
    to 3 % apart.
    """
    random = np.random.default_rng([seed, 15])

    def off(most: float) -> float:
        return float(random.uniform(-most, most))

    rig = default_rig()
    pitch_rad, pitch_apart_rad = off(1.0 * _DEG), off(2.0 * _DEG)
    mounts = [
        EyeMount(
            axis_x_m=off(1.0 * _MM),
            axis_z_m=off(0.25 * _MM),
            lens_x_m=LENS_AHEAD_M + off(2.0 * _MM),
            lens_y_m=off(4.0 * _MM),
            lens_z_m=off(0.5 * _MM),
            roll_rad=off(2.0 * _DEG),
            pitch_rad=pitch_rad + side * 0.5 * pitch_apart_rad,
            yaw_rad=off(3.0 * _DEG),
        )
        for side in (1.0, -1.0)
    ]
    joints = [replace(joint, zero_rad=off(4.0 * _DEG), scale=1.0 + off(0.05)) for _, joint in rig.joints.items()]
    apart = float(random.uniform(0.01, 0.03) * random.choice([-1.0, 1.0]))
    middle = 1.0 + off(0.02)
    cameras = [
        _camera(camera, middle * (1.0 + side * 0.5 * apart), random)
        for camera, side in ((rig.left_camera, 1.0), (rig.right_camera, -1.0))
    ]
    return replace(
        rig,
        left_camera=cameras[0],
        right_camera=cameras[1],
        joints=Joints(*joints),
        left_mount=mounts[0],
        right_mount=mounts[1],
        tilt_axis_x_m=off(4.0 * _MM),
        tilt_axis_z_m=-TILT_AXIS_BELOW_M + off(3.0 * _MM),
    )


def _camera(camera: CameraSpec, focal: float, random: np.random.Generator) -> CameraSpec:
    centre = random.uniform(-25.0, 25.0, 2)
    distortion = _DISTORTION + random.uniform(-1.0, 1.0, 5) * _DISTORTION_OFF
    return camera.replaced(
        fx_px=camera.fx_px * focal,
        fy_px=camera.fy_px * focal * (1.0 + float(random.uniform(-0.002, 0.002))),
        cx_px=camera.cx_px + float(centre[0]),
        cy_px=camera.cy_px + float(centre[1]),
        distortion=tuple(distortion.tolist()),
    )
