"""Visual errors to directions in rig_base, with the joint angles at the image's own stamp, as filter measurements.

A ray seen by an eye at (pan, tilt) has a pan and tilt of its own: those that would bring it to that eye's fovea. Where
lenses lie off the axes, these depend on the distance, which a pair of rays gives and one ray alone leaves open.
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.kalman import Measurement
from vergence_gaze.estimation.observations import BoxSighting, TrackSighting
from vergence_gaze.estimation.rays import gaze_of_ray, gaze_of_rays
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_rig.geometry import UnreachableError
from vergence_rig.kinematics import Kinematics

Array = npt.NDArray[np.float64]

# Rows over (version, vergence, tilt)
_LEFT_PAN = (1.0, -0.5, 0.0)
_RIGHT_PAN = (1.0, 0.5, 0.0)
_VERGENCE = (0.0, 1.0, 0.0)
_TILT = (0.0, 0.0, 1.0)
_VERSION = (1.0, 0.0, 0.0)

_WITHOUT_DEPTH = 0.25  # coefficient of the vergence in rows that do not tell it: the left pan's is about -0.5

_LARGEST_TANGENT = 10.0  # of normalised coordinates: no lens sees farther aside
_WIDEST_RAD = 1.5


class SightingError(ValueError):
    """A sighting that gives no direction: not finite, outside any lens, or older than the joint history."""


def spread_of_eye(
    left: bool, direction_sigma_rad: float, vergence_sigma_rad: float, slopes: tuple[float, float] = (0.0, 0.0)
) -> Array:
    """Return the covariance (3, 3) of version, vergence, tilt for a direction known in one eye and a vague vergence.

    If the vergence turns out larger by some angle, the version does by half of it: the eye that sees stays where it is,
    but for `slopes`, d (own pan, tilt) / d vergence (see `rays.gaze_of_ray`).
    """
    lean = (0.5 if left else -0.5) + slopes[0]
    covariance = np.diag([direction_sigma_rad**2, 0.0, direction_sigma_rad**2])
    along = np.array([lean, 1.0, slopes[1]]) * vergence_sigma_rad
    return covariance + np.outer(along, along)


class Directions:
    """Turns sightings into measurements by a head's kinematics and the history of its eye angles."""

    def __init__(self, kinematics: Kinematics, history: ShaftHistory) -> None:
        self._kinematics, self._history = kinematics, history

    def one_eye(
        self, left: bool, stamp_s: float, xy: tuple[float, float], sigma_rad: float, vergence_rad: float
    ) -> tuple[Measurement, tuple[float, float]]:
        """Return the measurement of a direction in one eye, and that direction's (pan, tilt) [rad].

        They hold for the assumed vergence; the measurement's rows say how they vary with it.
        """
        _check(xy)
        try:
            eyes, (pan_slope, tilt_slope) = gaze_of_ray(self._kinematics, left, self._at(stamp_s), xy, vergence_rad)
        except UnreachableError as error:
            raise SightingError(str(error)) from error
        pan, tilt = (eyes.pan_left_rad if left else eyes.pan_right_rad), eyes.tilt_rad
        rows = np.array([_LEFT_PAN if left else _RIGHT_PAN, _TILT])
        rows[:, 1] -= (pan_slope, tilt_slope)
        values = np.array([pan - pan_slope * vergence_rad, tilt - tilt_slope * vergence_rad])
        return Measurement(rows, values, np.array([sigma_rad] * 2), np.array([stamp_s] * 2)), (pan, tilt)

    def both_eyes(
        self,
        stamp_s: float,
        skew_s: float,
        left_xy: tuple[float, float],
        right_x: float,
        sigma_rad: float,
        disparity_sigma_rad: float,
    ) -> tuple[Measurement, tuple[float, float, float]]:
        """Return the measurement of one pair, and (left pan, right pan, tilt) [rad] of the target.

        The right eye's height in the image is not used: a mount that is off by pixels would tilt the target.
        """
        _check((*left_xy, right_x))
        at_left, at_right = self._at(stamp_s), self._at(stamp_s + skew_s)
        try:
            eyes = gaze_of_rays(self._kinematics, at_left, at_right, left_xy, right_x)
        except UnreachableError as error:
            raise SightingError(str(error)) from error
        place = (eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad)
        rows = np.array([_LEFT_PAN, _RIGHT_PAN, _TILT])
        stamps = np.array([stamp_s, stamp_s + skew_s, stamp_s])
        right_sigma = math.hypot(sigma_rad, disparity_sigma_rad)
        return Measurement(rows, np.array(place), np.array([sigma_rad, right_sigma, sigma_rad]), stamps), place

    def point(self, stamp_s: float, point_m: tuple[float, float, float], sigma_rad: float) -> Measurement:
        """Return the measurement of a point in rig_base."""
        try:
            eyes = self._kinematics.gaze_for_point(point_m)
        except UnreachableError as error:
            raise SightingError(str(error)) from error
        values = np.array([eyes.version_rad, eyes.vergence_rad, eyes.tilt_rad])
        rows = np.array([_VERSION, _VERGENCE, _TILT])
        return Measurement(rows, values, np.array([sigma_rad] * 3), np.array([stamp_s] * 3))

    def track(
        self, sighting: TrackSighting, sigma_rad: float, disparity_sigma_rad: float, vergence_rad: float
    ) -> tuple[Measurement, Array]:
        """Return the measurement of a track, and (left pan, right pan, tilt) (3,) [rad] of what it follows.

        The right pan is NaN where only the left eye sees it; the vergence is then assumed.
        """
        left_xy, stamp_s = (sighting.left_x, sighting.left_y), sighting.stamp_s
        if math.isfinite(sighting.disparity_rad):
            right_x = _tangent(math.atan(sighting.left_x) - sighting.disparity_rad)
            measurement, seen = self.both_eyes(
                stamp_s, sighting.skew_s, left_xy, right_x, sigma_rad, disparity_sigma_rad
            )
            return measurement, np.array(seen)
        measurement, (pan, tilt) = self.one_eye(True, stamp_s, left_xy, sigma_rad, vergence_rad)
        return measurement, np.array([pan, math.nan, tilt])

    def box(
        self, sighting: BoxSighting, sigma_rad: float, right_rate_rad_s: float, vergence_rad: float
    ) -> tuple[Measurement, Array]:
        """Return the measurement of a detected target, and its (left pan, right pan, tilt) (3,), NaN where unseen.

        The disparity of the surface inside the boxes, where there is one, gives the vergence: it is more precise than
        the middles of two boxes. `right_rate_rad_s` is how fast the right eye's pan to the target changes between the
        two exposures. For a target in one eye the vergence is assumed.
        """
        left_xy = (_tangent(sighting.left_azimuth_rad), _tangent(sighting.left_elevation_rad))
        right_xy = (_tangent(sighting.right_azimuth_rad), _tangent(sighting.right_elevation_rad))
        if math.isfinite(left_xy[0]) and math.isfinite(right_xy[0]):
            disparity_rad = sighting.surface_disparity_rad
            refined = math.isfinite(disparity_rad) and sighting.surface_sigma_rad > 0.0
            right_x = _tangent(sighting.left_azimuth_rad - disparity_rad) if refined else right_xy[0]
            measurement, both = self.both_eyes(sighting.stamp_s, sighting.skew_s, left_xy, right_x, sigma_rad, 0.0)
            seen_rad = np.array(both)
            if refined:
                vergence_rad = both[1] - both[0] - right_rate_rad_s * sighting.skew_s
                measurement = Measurement(
                    np.array([_LEFT_PAN, _VERGENCE, _TILT]),
                    np.array([both[0], vergence_rad, both[2]]),
                    np.array([sigma_rad, sighting.surface_sigma_rad, sigma_rad]),
                    np.full(3, sighting.stamp_s),
                )
            return measurement, seen_rad
        in_left = math.isfinite(left_xy[0])
        stamp_s = sighting.stamp_s + (0.0 if in_left else sighting.skew_s)
        xy = left_xy if in_left else right_xy
        measurement, (pan, tilt) = self.one_eye(in_left, stamp_s, xy, sigma_rad, vergence_rad)
        return measurement, np.array([pan if in_left else math.nan, math.nan if in_left else pan, tilt])

    def _at(self, stamp_s: float) -> Array:
        if not (math.isfinite(stamp_s) and self._history.covers(stamp_s)):
            raise SightingError(f"the stamp must be within the joint history: got {stamp_s!r} s")
        return self._history.shaft_at(stamp_s)


def shifted(measurement: Measurement, seen_rad: Array, beside_rad: Array) -> tuple[Measurement, Array]:
    """Return the measurement and place (3,) of a point this far beside in pan and tilt (2,), at the same depth."""
    pan, tilt = (float(angle) for angle in beside_rad)
    by = np.where(measurement.coefficients[:, 2] != 0, tilt, np.where(measurement.coefficients[:, 0] != 0, pan, 0.0))
    return replace(measurement, values=measurement.values + by), seen_rad + np.array([pan, pan, tilt])


def without_depth(measurement: Measurement, seen_rad: Array) -> tuple[Measurement, Array]:
    """Return what one pair shows of a direction alone: a measurement and place without the right eye's pan."""
    kept = measurement.coefficients[:, 1] < _WITHOUT_DEPTH
    m = measurement
    left = Measurement(m.coefficients[kept], m.values[kept], m.sigmas[kept], m.stamps_s[kept])
    return left, np.where([False, True, False], math.nan, seen_rad)


def _tangent(angle_rad: float) -> float:
    """Return the normalised coordinate of an angle; NaN for one that no lens sees."""
    return math.tan(angle_rad) if abs(angle_rad) < _WIDEST_RAD else math.nan


def unseen_by_any_lens(normalised: tuple[float, ...]) -> str:
    """Return what is wrong with normalised coordinates, "" if a lens can see them."""
    if all(abs(value) <= _LARGEST_TANGENT for value in normalised):
        return ""
    shown = ", ".join(f"{value:g}" for value in normalised)
    return f"normalised coordinates must be within +-{_LARGEST_TANGENT:g}: got ({shown})"


def _check(normalised: tuple[float, ...]) -> None:
    if fault := unseen_by_any_lens(normalised):
        raise SightingError(fault)
