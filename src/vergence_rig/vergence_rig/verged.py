"""When one pair of images shows verged eyes: the one set of limits, for the metric's flag and the controller's judge.

Contrast alone fails on repeated texture, an error alone on a confident mismatch: a pair has to be within both. The
limits of the contrast are fitted on photographs, `python -m bench.photos_contrast` shows how they are chosen.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from vergence_rig.parameters import ParameterError, Parameters, parameter

SMALL_WINDOWS_PX = (50, 150)
"""Sides of the windows that count [px]: larger ones mix depths and have a high contrast at vergence too."""


@dataclass(frozen=True)
class VergedLimits(Parameters):
    """Limits of contrast and error, with hysteresis: to become verged, and to stay it."""

    contrast_enter: float = parameter(
        0.8, "edge contrast up to which `verged` may be set", minimum=0, maximum=2, formerly="contrast_enter"
    )
    contrast_leave: float = parameter(
        0.92,
        "edge contrast above which a pair counts against `verged` while it is set",
        minimum=0,
        maximum=2,
        formerly="contrast_leave",
    )
    enter_rad: float = parameter(
        0.0045,
        "vergence error up to which `verged` may be set on a target at rest",
        unit="rad",
        minimum=1e-4,
        maximum=0.2,
        formerly="verged_enter_rad",
    )
    leave_rad: float = parameter(
        0.0155,
        "vergence or direction error above which a pair counts against `verged` while it is set",
        unit="rad",
        minimum=1e-4,
        maximum=0.2,
        formerly="verged_leave_rad",
    )

    def check(self) -> None:
        """Hold the hystereses in order."""
        for name, enter_name, unit in (
            ("contrast_leave", "contrast_enter", ""),
            ("leave_rad", "enter_rad", " [rad]"),
        ):
            enter, leave = getattr(self, enter_name), getattr(self, name)
            if leave < enter:
                raise ParameterError(name, leave, f"at least verged.{enter_name}, {enter:g}{unit}")

    def contrast_limit(self, verged: bool) -> float:
        """Return the contrast up to which a pair shows eyes that become, or stay, verged."""
        return self.contrast_leave if verged else self.contrast_enter


def objection(contrast: float, contrast_limit: float, errors: Iterable[tuple[str, float, float]]) -> str:
    """Return why a pair does not show verged eyes, "" if nothing speaks against it.

    Args:
        contrast: edge contrast of the pair; NaN if it is not used.
        contrast_limit: the largest that is allowed.
        errors: name, value and limit of each error [rad]; NaN is not within any limit.
    """
    for kind, error_rad, limit_rad in errors:
        if not abs(error_rad) <= limit_rad:
            return f"{kind} error {math.degrees(abs(error_rad)):.2f} deg"
    return f"edge contrast {contrast:.2f} above {contrast_limit:.2f}" if contrast > contrast_limit else ""


def best_small_window(windows_px: Iterable[int], contrast: Iterable[float]) -> int | None:
    """Return the index of the small window with the least contrast, None if no small window has any."""
    small = [
        (value, i)
        for i, (size_px, value) in enumerate(zip(windows_px, contrast, strict=False))
        if SMALL_WINDOWS_PX[0] <= size_px <= SMALL_WINDOWS_PX[1] and math.isfinite(value)
    ]
    return min(small)[1] if small else None
