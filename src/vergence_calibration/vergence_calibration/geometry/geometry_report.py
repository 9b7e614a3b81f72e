"""A found geometry as lines for a person and as the record in rig.yaml."""

import math
from typing import Any

from vergence_calibration.geometry.identify_geometry import FoundGeometry
from vergence_calibration.geometry.unknowns import CAMERA_UNKNOWNS, NAMES
from vergence_calibration.identification.axis_log import EYES

_DIGITS = 6


def geometry_lines(found: FoundGeometry) -> list[str]:
    """Return what was found, each value with its standard deviation."""
    before_px, now_px = found.residual_before_px, found.residual_px
    lines = [
        f"geometry from {found.points} things seen from {found.poses} poses, with the baseline of "
        f"{1e3 * found.rig.baseline_m:g} mm as given: {before_px:.2f} px from where the old geometry sees them "
        f"and {now_px:.2f} px from where the new one does (medians)"
    ]
    for eye in EYES:
        lines.append(
            f"  {eye} lens {_mm(found, 'lens_x_m', eye)} before its pan axis and {_mm(found, 'lens_y_m', eye)} left of "
            f"it; camera rolled {_deg(found, 'roll_rad', eye)}, pitched {_deg(found, 'pitch_rad', eye)}"
        )
        scale, sigma = found.of("scale", eye)
        lines.append(
            f"  pan_{eye} zero {_deg(found, 'zero_rad', eye)} (with the camera's yaw of rig.yaml kept), scale "
            f"{scale:.4f} +- {sigma:.4f}"
        )
        if not found.cameras[eye].calibrated:
            focal, centre = found.of("log_focal", eye), [found.of(name, eye) for name in ("cx_px", "cy_px")]
            focal_px = found.rig.camera(eye == "left").fx_px
            (cx, cx_sigma), (cy, cy_sigma) = centre
            lines.append(
                f"  {eye} camera, not calibrated: focal length {focal_px:.1f} +- {focal_px * focal[1]:.1f} px, "
                f"principal point {cx:.1f} +- {cx_sigma:.1f}, {cy:.1f} +- {cy_sigma:.1f} px"
            )
    scale, sigma = found.of("tilt_scale")
    lines.append(
        f"  tilt scale {scale:.4f} +- {sigma:.4f}, tilt axis at x {_mm(found, 'tilt_axis_x_m')}, z "
        f"{_mm(found, 'tilt_axis_z_m')}; left lens {_mm(found, 'lens_z_apart_m')} above the right one"
    )
    kept = "tilt zero, yaws, pan axes, mean height of the lenses"
    lines.append(f"  kept as they were, since images cannot show them: {kept}")
    if found.kept:
        lines.append(f"  kept as they were, since these images did not show them: {', '.join(found.kept)}")
    return lines


def geometry_record(found: FoundGeometry) -> dict[str, Any]:
    """Return every value with its standard deviation, null for one that was kept, as plain values."""
    values: dict[str, Any] = {eye: {} for eye in EYES}
    for name in NAMES:
        eye, _, own = name.rpartition(".")
        if eye and found.cameras[eye].calibrated and own in CAMERA_UNKNOWNS:
            continue
        value, sigma = found.of(name)
        entries = values[eye] if eye else values
        if own == "log_focal":
            own, value = "focal_length_px", found.rig.camera(eye == "left").fx_px
            sigma *= value
        entries[own] = round(value, _DIGITS)
        entries[f"{own}_sigma"] = None if name in found.kept else round(sigma, _DIGITS)
    return {
        "geometry": {
            "poses": found.poses,
            "points": found.points,
            "residual_before_px": round(found.residual_before_px, 3),
            "residual_px": round(found.residual_px, 3),
            **values,
        }
    }


def _mm(found: FoundGeometry, name: str, eye: str = "") -> str:
    value, sigma = found.of(name, eye)
    return f"{1e3 * value:.1f} +- {1e3 * sigma:.1f} mm"


def _deg(found: FoundGeometry, name: str, eye: str) -> str:
    value, sigma = found.of(name, eye)
    return f"{math.degrees(value):.2f} +- {math.degrees(sigma):.2f} degrees"
