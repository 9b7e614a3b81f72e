"""Joint trajectories: points in time, interpolated."""

import bisect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vergence_servo.command_guard import MalformedCommandError, StaleCommandError, UnknownJointError


@dataclass(frozen=True)
class TrajectoryPoint:
    """Positions [rad] and, if given, velocities [rad/s] of all joints of a trajectory, `time_s` after its start."""

    time_s: float
    positions_rad: tuple[float, ...]
    velocities_rad_s: tuple[float, ...] | None = None


class Trajectory:
    """A checked trajectory that starts at the present pose.

    Between points with velocities it is a cubic Hermite spline, otherwise a straight line.
    """

    def __init__(
        self, joints: Sequence[str], points: Sequence[TrajectoryPoint], present_rad: Mapping[str, float]
    ) -> None:
        """Check it.

        Args:
            joints: the names, each once.
            points: with increasing times.
            present_rad: the present angle of every driven joint: the point at time 0 unless `points` has one.

        Raises:
            MalformedCommandError: lists of different lengths, times that do not increase, values that are not finite.
            UnknownJointError: a joint that is not in `present_rad`.
        """
        _check(joints, points, tuple(present_rad))
        self.joints = tuple(joints)
        start = TrajectoryPoint(0.0, tuple(present_rad[name] for name in joints), (0.0,) * len(joints))
        self._points = list(points) if points[0].time_s == 0 else [start, *points]
        self._times_s = [point.time_s for point in self._points]

    @property
    def duration_s(self) -> float:
        """When the last point is reached, after the start [s]."""
        return self._times_s[-1]

    def positions_rad(self, time_s: float) -> dict[str, float]:
        """Return where the joints should be, `time_s` after the start; before it the first point, after it the last."""
        if time_s >= self.duration_s:
            return dict(zip(self.joints, self._points[-1].positions_rad, strict=True))
        i = max(bisect.bisect_right(self._times_s, time_s) - 1, 0)
        if time_s <= 0 or i + 1 >= len(self._points):
            return dict(zip(self.joints, self._points[0].positions_rad, strict=True))
        before, after = self._points[i], self._points[i + 1]
        return {name: _between(before, after, j, time_s) for j, name in enumerate(self.joints)}


def start_delay_s(stamp_ns: int, now_ns: int, max_age_s: float) -> float:
    """Return when a trajectory with this stamp begins, from now [s]; a stamp of 0 means now.

    Raises StaleCommandError where it began more than `max_age_s` ago (0: any stamp is accepted).
    """
    delay_s = (stamp_ns - now_ns) * 1e-9 if stamp_ns else 0.0
    if max_age_s > 0 and -delay_s > max_age_s:
        raise StaleCommandError(f"the trajectory must begin at most {max_age_s:g} s ago: it began {-delay_s:.3f} s ago")
    return delay_s


def check_end(end_s: float, longest_s: float) -> None:
    """Raise MalformedCommandError where a trajectory would end more than `longest_s` from now."""
    if end_s > longest_s:
        raise MalformedCommandError(f"the trajectory must end within {longest_s:g} s: it would end in {end_s:.1f} s")


def _between(before: TrajectoryPoint, after: TrajectoryPoint, joint: int, time_s: float) -> float:
    span_s = after.time_s - before.time_s
    u = (time_s - before.time_s) / span_s
    start, end = before.positions_rad[joint], after.positions_rad[joint]
    if before.velocities_rad_s is None or after.velocities_rad_s is None:
        return start + u * (end - start)
    start_slope, end_slope = before.velocities_rad_s[joint] * span_s, after.velocities_rad_s[joint] * span_s
    return (
        (1 + 2 * u) * (1 - u) ** 2 * start
        + u * (1 - u) ** 2 * start_slope
        + u**2 * (3 - 2 * u) * end
        + u**2 * (u - 1) * end_slope
    )


def _check(joints: Sequence[str], points: Sequence[TrajectoryPoint], known: tuple[str, ...]) -> None:
    if not joints or len(set(joints)) != len(joints):
        raise MalformedCommandError(f"joint_names must name driven joints, each once: got {list(joints)!r}")
    for name in joints:
        if name not in known:
            raise UnknownJointError(f"joint must be one of {', '.join(known)}: got {name[:60]!r}")
    if not points:
        raise MalformedCommandError("the trajectory must have one or more points: got none")
    last_s = -math.inf
    for i, point in enumerate(points):
        if not (math.isfinite(point.time_s) and point.time_s >= 0 and point.time_s > last_s):
            raise MalformedCommandError(f"time_from_start must increase from 0: got {point.time_s} s at point {i}")
        last_s = point.time_s
        for what, values in (("positions", point.positions_rad), ("velocities", point.velocities_rad_s)):
            if values is None:
                continue
            if len(values) != len(joints):
                raise MalformedCommandError(f"point {i} must have {len(joints)} {what}: got {len(values)}")
            if not all(math.isfinite(value) for value in values):
                raise MalformedCommandError(f"{what} of point {i} must be finite numbers: got {list(values)}")
