"""What `Head.look_at` is asked for, and how it went."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from vergence_gaze.goals.goal import Goal, GoalKind, Outcome, Result
from vergence_rig.eye_image import EyeImage
from vergence_rig.parameters import shown


class RequestError(ValueError):
    """A request that says not where to look, or says it in two ways."""


@dataclass
class Look:
    """A goal of `Head.look_at`; `outcome` is None until it has ended."""

    goal_id: int
    _step: Callable[[], object] = field(repr=False)
    outcome: Outcome | None = None

    @property
    def verged(self) -> bool:
        """True once the goal has ended with both eyes on the target."""
        return self.outcome is not None and self.outcome.result is Result.VERGED

    def wait(self) -> Outcome:
        """Step the head until the goal has ended, and return how."""
        while self.outcome is None:
            self._step()
        return self.outcome


@dataclass(frozen=True)
class Request:
    """Where to look: exactly one of `pixel`, `stereo_pixel`, `point_m`, `angles_rad` and `turn_rad`.

    Attributes:
        pixel: (x, y) in the picture of `eye`, as it was taken.
        stereo_pixel: x and y in the left picture, then x and y in the right one, of one point.
        point_m: (x, y, z) in rig_base.
        angles_rad: version, vergence and tilt.
        turn_rad: the same, added to the present ones.
        eye: "left" or "right", of `pixel`.
        depth_m: of `pixel`, along the eye's ray; None if unknown.
        time_limit_s: of the goal; 0 for the controller's own.
    """

    pixel: Sequence[float] | None = None
    stereo_pixel: Sequence[float] | None = None
    point_m: Sequence[float] | None = None
    angles_rad: Sequence[float] | None = None
    turn_rad: Sequence[float] | None = None
    eye: str = "left"
    depth_m: float | None = None
    time_limit_s: float = 0.0

    def goal(self, images: tuple[EyeImage, EyeImage], stamp_s: float) -> Goal:
        """Return the controller's goal; pixels are of the pictures taken at `stamp_s`. Raises RequestError."""
        lengths = {"pixel": 2, "stereo_pixel": 4, "point_m": 3, "angles_rad": 3, "turn_rad": 3}
        given = {name: getattr(self, name) for name in lengths if getattr(self, name) is not None}
        if len(given) != 1:
            got = " and ".join(given) or "none"
            raise RequestError(f"look_at must be given one of {', '.join(lengths)}: got {got}")
        ((name, values),) = given.items()
        numbers = self._numbers(name, values, lengths[name])
        if self.eye not in ("left", "right"):
            raise RequestError(f"eye must be 'left' or 'right': got {shown(self.eye)}")
        if self.depth_m is not None and (name != "pixel" or not 0 < self.depth_m < math.inf):
            raise RequestError(f"depth_m must be the distance of a pixel, more than 0 [m]: got {shown(self.depth_m)}")
        left = self.eye == "left"
        match name:
            case "pixel":
                xy = images[0 if left else 1].undistorted(*numbers)
                depth_m = math.nan if self.depth_m is None else self.depth_m
                nowhere = (math.nan, math.nan)
                return Goal(
                    GoalKind.PIXEL,
                    left_eye=left,
                    left_xy=xy if left else nowhere,
                    right_xy=nowhere if left else xy,
                    depth_m=depth_m,
                    stamp_s=stamp_s,
                    time_limit_s=self.time_limit_s,
                )
            case "stereo_pixel":
                return Goal(
                    GoalKind.STEREO_PIXEL,
                    left_xy=images[0].undistorted(*numbers[:2]),
                    right_xy=images[1].undistorted(*numbers[2:]),
                    stamp_s=stamp_s,
                    time_limit_s=self.time_limit_s,
                )
            case "point_m":
                x, y, z = numbers
                return Goal(GoalKind.POINT, point_m=(x, y, z), time_limit_s=self.time_limit_s)
        version, vergence, tilt = numbers
        kind = GoalKind.ANGLES if name == "angles_rad" else GoalKind.RELATIVE_ANGLES
        return Goal(kind, version_rad=version, vergence_rad=vergence, tilt_rad=tilt, time_limit_s=self.time_limit_s)

    @staticmethod
    def _numbers(name: str, values: Sequence[float], length: int) -> list[float]:
        try:
            numbers = [float(value) for value in values]
        except (TypeError, ValueError):
            numbers = []
        if len(numbers) != length or not all(map(math.isfinite, numbers)):
            raise RequestError(f"{name} must be {length} finite numbers: got {shown(values)}")
        return numbers
