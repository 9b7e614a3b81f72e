"""What `vergence identify` finds of printed heads: rendered in lockstep, before cameras without calibration.

Everything that the images can show is compared. Yaw and pan zero are one angle, and are compared as one; so is the lens
in a pan frame that is turned along with the camera. The tilt's zero and the lenses' common height cannot be seen, and
are not compared. Of both eyes the worse counts.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing

import numpy as np

from bench.real_servos import with_real_servos
from bench.results import Row
from vergence_calibration.geometry.identify_geometry import FoundGeometry, Look, identify_geometry
from vergence_calibration.geometry.poses import PoseParameters
from vergence_calibration.identification.axis_log import EYES, EyeCamera, IdentifyParameters, stair_moves, step_moves
from vergence_calibration.identification.seen_motion import shrunk
from vergence_calibration.lost_motion import staircase
from vergence_rig.camera import CameraModel
from vergence_rig.rig import JOINT_NAMES, Rig, default_rig
from vergence_sim.parameters import SimParameters
from vergence_sim.printed_head import printed_head
from vergence_sim.simulator import Simulator

REST_S = 0.45  # a look of a running head: its rest, and the wait for the next pair
_UNCALIBRATED = "rig.yaml as shipped"


def real_head(seed: int) -> Rig:
    """Return the printed head of a seed with servos as they come out of the box."""
    return with_real_servos(printed_head(seed), np.random.default_rng([seed, 43]))


class LockstepHead:
    """The simulated head of a seed, as `identify_geometry` turns it."""

    def __init__(self, seed: int) -> None:
        parameters = SimParameters.of({"world.seed": seed, "seed": seed, "head.camera_info": "none"})
        self.rig, self.truth = default_rig(), real_head(seed)
        self.simulator = Simulator(parameters, self.rig, head=self.truth)

    def cameras(self) -> Mapping[str, EyeCamera]:
        """See LookingHead."""
        return {eye: EyeCamera(CameraModel(self.rig.camera(eye == "left")), False) for eye in EYES}

    def look(self, joints_rad: Mapping[str, float]) -> Look:
        """See LookingHead."""
        self.simulator.command(joints_rad)
        self.simulator.advance(REST_S)
        frame = self.simulator.capture()
        pictures = {"left": frame.left, "right": frame.right}
        sizes = {eye: (picture.shape[1], picture.shape[0]) for eye, picture in pictures.items()}
        reported = self.simulator.joint_states()
        small = {eye: shrunk(picture, sizes[eye][0]) for eye, picture in pictures.items()}
        return Look([reported[name] for name in JOINT_NAMES], small, sizes)

    def close(self) -> None:
        """Free the renderer."""
        self.simulator.close()


def identified(seed: int) -> tuple[FoundGeometry, Rig, float]:
    """Return what is found of the printed head of a seed, the true head, and the time that finding it takes [s].

    The time is that of the simulated moves of both halves of `vergence identify`, and that of the geometry's computing.
    """
    with closing(LockstepHead(seed)) as head:
        rendering_s = 0.0
        look = head.look

        def timed_look(joints_rad: Mapping[str, float]) -> Look:
            nonlocal rendering_s
            began_s = time.perf_counter()
            seen = look(joints_rad)
            rendering_s += time.perf_counter() - began_s
            return seen

        head.look = timed_look  # type: ignore[method-assign]
        began_s = time.perf_counter()
        found = identify_geometry(head, head.rig, PoseParameters())
        computing_s = time.perf_counter() - began_s - rendering_s
        return found, head.truth, computing_s + head.simulator.time_s + _timing_moves_s()


def rows(heads: Sequence[tuple[FoundGeometry, Rig, float]], say: Callable[[str], None]) -> list[Row]:
    """Return the rows of heads as `identified` returns them."""
    errors, before, took_s = [], [], []
    ratios: list[float] = []
    for number, (found, truth, took) in enumerate(heads):
        errors.append(errors_of(found.rig, truth))
        before.append(errors_of(default_rig(), truth))
        ratios += _ratios(found, truth)
        took_s.append(took)
        say(f"head {number}: " + ", ".join(f"{name} {value:.3g}" for name, value in errors[-1].items()))
    units = {"lens_mm": "mm", "tilt_axis_mm": "mm", "mount_deg": "deg", "zero_deg": "deg", "principal_px": "px"}
    found_rows = [Row("geometry.identify_s", float(np.median(took_s)), "s")]
    for name in errors[0]:
        found_error, start_error = (float(np.median([one[name] for one in some])) for some in (errors, before))
        found_rows.append(Row(f"geometry.{name}", found_error, units.get(name, "1"), _UNCALIBRATED, start_error))
    found_rows.append(Row("geometry.within_two_sigma", float(np.mean(np.abs(ratios) < 2.0)), "share of all values"))
    return found_rows


def errors_of(rig: Rig, truth: Rig) -> dict[str, float]:
    """Return how far a rig is from the true head, by row: of both eyes, or all joints, the worst."""
    found, true = rig.in_eye_angles(), truth.in_eye_angles()
    lenses, mounts, zeros, focals, centres = [], [], [], [], []
    heights = [_heights(head) for head in (found, true)]
    for k, left in enumerate((True, False)):
        mine, other = found.mount(left), true.mount(left)
        up = 0.5 * ((heights[0][0] - heights[0][1]) - (heights[1][0] - heights[1][1]))
        lenses.append(math.hypot(mine.lens_x_m - other.lens_x_m, mine.lens_y_m - other.lens_y_m, up))
        mounts += [abs(mine.roll_rad - other.roll_rad), abs(mine.pitch_rad - other.pitch_rad)]
        zeros.append(abs(rig.eye_angles((0, 0, 0))[k] - truth.eye_angles((0, 0, 0))[k]))
        camera, real = rig.camera(left), truth.camera(left)
        focals += [abs(camera.fx_px / real.fx_px - 1), abs(camera.fy_px / real.fy_px - 1)]
        centres.append(math.hypot(camera.cx_px - real.cx_px, camera.cy_px - real.cy_px))
    scales = [abs(rig.joints[name].scale - truth.joints[name].scale) for name in JOINT_NAMES]
    axis = np.subtract(_tilt_axis(rig), _tilt_axis(truth))
    return {
        "lens_mm": 1e3 * max(lenses),
        "tilt_axis_mm": 1e3 * float(np.hypot(*axis)),
        "length": abs(_lens_baseline(found) / _lens_baseline(true) - 1.0),
        "mount_deg": math.degrees(max(mounts)),
        "zero_deg": math.degrees(max(zeros)),
        "scale": max(scales),
        "focal": max(focals),
        "principal_px": max(centres),
    }


def _lens_baseline(rig: Rig) -> float:
    """Return the distance between the lenses with both eyes straight ahead [m]: all distances are as far off."""
    return rig.baseline_m + rig.left_mount.lens_y_m - rig.right_mount.lens_y_m


def _heights(rig: Rig) -> tuple[float, float]:
    return (
        rig.left_mount.axis_z_m + rig.left_mount.lens_z_m,
        rig.right_mount.axis_z_m + rig.right_mount.lens_z_m,
    )


def _tilt_axis(rig: Rig) -> tuple[float, float]:
    """Return the tilt axis (x, z) [m] against the middle of the pan axes and of the lenses' heights."""
    middle_x = 0.5 * (rig.left_mount.axis_x_m + rig.right_mount.axis_x_m)
    return rig.tilt_axis_x_m - middle_x, rig.tilt_axis_z_m - 0.5 * sum(_heights(rig))


def _ratios(found: FoundGeometry, truth: Rig) -> Sequence[float]:
    """Return the errors of all compared values in their own standard deviations."""
    own, true = found.rig.in_eye_angles(), truth.in_eye_angles()
    ratios: list[float] = []
    for k, eye in enumerate(EYES):
        left = eye == "left"
        mine, other, camera, real = own.mount(left), true.mount(left), found.rig.camera(left), truth.camera(left)
        differences = {
            "lens_x_m": mine.lens_x_m - other.lens_x_m,
            "lens_y_m": mine.lens_y_m - other.lens_y_m,
            "roll_rad": mine.roll_rad - other.roll_rad,
            "pitch_rad": mine.pitch_rad - other.pitch_rad,
            "zero_rad": found.rig.eye_angles((0, 0, 0))[k] - truth.eye_angles((0, 0, 0))[k],
            "scale": found.rig.joints[f"pan_{eye}"].scale - truth.joints[f"pan_{eye}"].scale,
            "log_focal": math.log(camera.fx_px / real.fx_px),
            "cx_px": camera.cx_px - real.cx_px,
            "cy_px": camera.cy_px - real.cy_px,
        }
        ratios += [value / found.of(name, eye)[1] for name, value in differences.items()]
    return ratios


def _timing_moves_s() -> float:
    """Return the time of the rests of the other half of `vergence identify`, which finds the latencies [s]."""
    p = IdentifyParameters()
    amplitude_rad = math.radians(p.amplitude_deg)
    moves = stair_moves(staircase(amplitude_rad, p.stairs, 1), p.rest_s) + step_moves(amplitude_rad, p.steps, p.rest_s)
    return len(JOINT_NAMES) * (sum(move.rest_s for move in moves) + 2 * p.rest_s)
