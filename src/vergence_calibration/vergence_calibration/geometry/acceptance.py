"""Whether what a head saw, and what was found from it, can be used: an IdentifyError for each way in which not."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from vergence_calibration.geometry.bundle import Solution
from vergence_calibration.geometry.features import Features
from vergence_calibration.geometry.unknowns import NAMES, Prior, index
from vergence_calibration.geometry.views import Observations
from vergence_calibration.identification.axis_log import EYES, IdentifyError
from vergence_rig.rig import JOINT_NAMES

Array = npt.NDArray[np.float64]

_LEAST_FEATURES, _LEAST_POINTS, _LEAST_SHARED = 80, 150, 60
_LEAST_IN_VIEW, _LEAST_VIEWS_SHARE = 12, 0.7
_AGREES, _LEAST_AGREEING = 0.2, 0.5
_MOST_DEVIATION = 3.0  # of a joint at rest from joint_states, in its standard deviations
_SCALES = (0.5, 2.0)
_DEG = math.pi / 180.0
_MOST_SIGMA = {
    "lens_x_m": (0.004, 1e3, "mm"),
    "lens_y_m": (0.004, 1e3, "mm"),
    "roll_rad": (0.3 * _DEG, 1 / _DEG, "degrees"),
    "pitch_rad": (0.3 * _DEG, 1 / _DEG, "degrees"),
    "zero_rad": (0.4 * _DEG, 1 / _DEG, "degrees"),
    "scale": (0.02, 1.0, ""),
    "log_focal": (0.015, 100.0, "%"),
    "cx_px": (8.0, 1.0, "px"),
    "cy_px": (8.0, 1.0, "px"),
}
"""Largest standard deviation of what an eye needs, its factor and unit for a person."""


def check_agreement(solution: Solution) -> None:
    """Raise IdentifyError where most sightings do not fit the head that was found."""
    agreeing = float(np.mean(solution.weights > _AGREES))
    if agreeing < _LEAST_AGREEING:
        raise IdentifyError(
            f"the head must explain {_LEAST_AGREEING:.0%} or more of what its eyes see: got {agreeing:.0%}; does "
            "something move in view, or do the pans not carry the eyes that their names say?"
        )


def check_texture(found: Sequence[Features]) -> None:
    """Raise IdentifyError where too many views have too few features."""
    counts = np.array([len(features.pixels) for features in found])
    if np.mean(counts >= _LEAST_FEATURES) < _LEAST_VIEWS_SHARE:
        raise IdentifyError(
            f"{_LEAST_VIEWS_SHARE:.0%} of the views must have {_LEAST_FEATURES} or more features for the geometry: "
            f"got {int(np.median(counts))} in the median view; turn the head to things with texture, in good light"
        )


def check_sightings(seen: Observations, views: int) -> None:
    """Raise IdentifyError where too little was found again from several poses, or by both eyes."""
    points = int(seen.point.max(initial=-1)) + 1
    if points < _LEAST_POINTS:
        raise IdentifyError(
            f"{_LEAST_POINTS} or more things must be found again from several poses for the geometry: got {points}; "
            "turn the head to things with texture that do not move"
        )
    enough = float(np.mean(np.bincount(seen.view, minlength=views) >= _LEAST_IN_VIEW))
    if enough < _LEAST_VIEWS_SHARE:
        raise IdentifyError(
            f"{_LEAST_VIEWS_SHARE:.0%} of the views must show {_LEAST_IN_VIEW} or more things that other views show: "
            f"got {enough:.0%}; turn the head so that things with texture are all around"
        )
    left, right = (np.bincount(seen.point[seen.view % 2 == number], minlength=points) > 0 for number in (0, 1))
    shared = int(np.sum(left & right))
    if shared < _LEAST_SHARED:
        raise IdentifyError(
            f"both eyes must see {_LEAST_SHARED} or more of the same things for the geometry: got {shared}; do both "
            "look the same way, and is neither covered?"
        )


def check_joints(prior: Prior, solution: Solution) -> None:
    """Raise IdentifyError where a joint did not turn as joint_states say, play and scale apart."""
    scales = [solution.vector[index("scale", eye)] for eye in EYES] + [solution.vector[index("tilt_scale")]]
    deviations = solution.vector[len(NAMES) :].reshape(-1, len(JOINT_NAMES))
    spreads = np.sqrt(np.mean(deviations**2, axis=0))
    for name, scale, spread, sigma in zip(JOINT_NAMES, scales, spreads, prior.joint_sigma_rad, strict=True):
        if spread > _MOST_DEVIATION * sigma:
            raise IdentifyError(
                f"{name} must turn as joint_states say, to {_MOST_DEVIATION * sigma / _DEG:.2f} degrees by its servo's "
                f"play: got {spread / _DEG:.2f} degrees; are the servos or the cameras swapped, or is a servo loose? "
                "`vergence identify --only timing` checks the wiring"
            )
        if not _SCALES[0] <= scale <= _SCALES[1]:
            raise IdentifyError(
                f"{name} must turn by {_SCALES[0]:g} to {_SCALES[1]:g} times what joint_states say: got {scale:.2f}; "
                "does it turn the wrong way? `vergence identify --only timing` checks the wiring"
            )


def check_certain(sigmas: Array) -> None:
    """Raise IdentifyError where what an eye needs is too uncertain; `sigmas` (G,) are of the NAMES."""
    for eye in EYES:
        for name, (most, factor, unit) in _MOST_SIGMA.items():
            sigma = float(sigmas[index(name, eye)])
            if not sigma <= most:
                near = name in ("lens_x_m", "lens_y_m")
                raise IdentifyError(
                    f"{name} of the {eye} eye must be found to {factor * most:.2g} {unit}: got {factor * sigma:.2g}; "
                    + ("turn the head to things at 0.3 to 2 m" if near else "turn the head to more texture all around")
                )
