"""Calibration of one servo by hand: the keys' actions, the recorded marks, and the resulting calibration."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from vergence_rig.parameters import ParameterError
from vergence_servo.calibration import ServoCalibration, ServoCalibrationError

ABSOLUTE_US = (500.0, 2500.0)
"""Limits of jogging, independent of the file: servos may reach their stops earlier still."""
STEPS_US = {"left": -10.0, "right": 10.0, "down": -1.0, "up": 1.0, "page_down": -50.0, "page_up": 50.0}
_LEAST_RANGE_US = 200.0
_LEAST_ANGLE_RAD = math.radians(10.0)


@dataclass
class JogSession:
    """Pulses sent and marks made for one servo. `send` sends a pulse and returns it on the driver's grid [us]."""

    old: ServoCalibration
    send: Callable[[float], float]
    pulse_us: float = math.nan
    minimum_us: float | None = None
    centre_us: float | None = None
    maximum_us: float | None = None
    angles: list[tuple[float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.pulse_us = self.send(self._inside(self.old.pulse_us(0.0)))

    def jog(self, key: str) -> None:
        """Move by the step of an arrow or page key; other keys do nothing."""
        if key in STEPS_US:
            self.pulse_us = self.send(self._inside(self.pulse_us + STEPS_US[key]))

    def mark_minimum(self) -> None:
        """Record the shortest pulse that the mechanics allow."""
        self.minimum_us = self.pulse_us

    def mark_centre(self) -> None:
        """Record joint angle 0: the eye looks straight ahead."""
        self.centre_us = self.pulse_us

    def mark_maximum(self) -> None:
        """Record the longest pulse that the mechanics allow."""
        self.maximum_us = self.pulse_us

    def mark_angle(self, degrees: str) -> None:
        """Record the joint angle here, as typed in degrees. Raises ServoCalibrationError."""
        try:
            angle_rad = math.radians(float(degrees.replace(",", ".")))
        except ValueError:
            raise ServoCalibrationError(f"angle must be a number of degrees: got {degrees!r}") from None
        if not abs(angle_rad) <= math.pi / 2:
            raise ServoCalibrationError(f"angle must be -90 to 90 degrees: got {degrees}")
        self.angles = [mark for mark in self.angles if abs(mark[0] - angle_rad) > 1e-6] + [(angle_rad, self.pulse_us)]

    @property
    def missing(self) -> list[str]:
        """What has yet to be recorded."""
        marks = {"minimum": self.minimum_us, "centre": self.centre_us, "maximum": self.maximum_us}
        absent = [name for name, mark in marks.items() if mark is None]
        return absent + (["two angles"] if len(self.angles) < 2 else [])

    def result(self) -> ServoCalibration:
        """Return the calibration of the marks. Raises ServoCalibrationError if they are incomplete."""
        if self.missing:
            raise ServoCalibrationError(f"not recorded yet: {', '.join(self.missing)}")
        assert self.minimum_us is not None
        assert self.centre_us is not None
        assert self.maximum_us is not None
        low_us, high_us = sorted((self.minimum_us, self.maximum_us))
        if high_us - low_us < _LEAST_RANGE_US:
            raise ServoCalibrationError(
                f"minimum and maximum must be at least {_LEAST_RANGE_US:g} us apart: got {high_us - low_us:g}"
            )
        if not low_us < self.centre_us < high_us:
            raise ServoCalibrationError(f"centre must be between {low_us:g} and {high_us:g} us: got {self.centre_us:g}")
        marks = self._marks_with_centre()
        joint_rad, pulses_us = zip(*sorted(marks, key=lambda mark: mark[1]), strict=True)
        if max(joint_rad) - min(joint_rad) < _LEAST_ANGLE_RAD:
            raise ServoCalibrationError("the angles must span at least 10 degrees: record them further apart")
        sign = 1 if joint_rad[-1] > joint_rad[0] else -1
        shaft_rad = tuple(sign * angle for angle in joint_rad)
        if list(shaft_rad) != sorted(shaft_rad):
            raise ServoCalibrationError("the angles must increase or decrease with the pulses: one of them is wrong")
        try:
            fresh = self.old.replaced(
                angles_rad=shaft_rad,
                pulses_us=pulses_us,
                sign=sign,
                trim_rad=0.0,
                minimum_us=low_us,
                maximum_us=high_us,
                lower_rad=-math.pi,
                upper_rad=math.pi,
            )
            ends = sorted((fresh.joint_rad(low_us), fresh.joint_rad(high_us)))
            return fresh.replaced(lower_rad=max(ends[0], -math.pi / 2), upper_rad=min(ends[1], math.pi / 2))
        except ParameterError as error:
            raise ServoCalibrationError(str(error)) from error

    def _marks_with_centre(self) -> list[tuple[float, float]]:
        assert self.centre_us is not None
        at_zero = [pulse for angle, pulse in self.angles if abs(angle) < 1e-6]
        if at_zero and abs(at_zero[0] - self.centre_us) > 5.0:
            raise ServoCalibrationError(f"angle 0 must be at the centre, {self.centre_us:g} us: got {at_zero[0]:g} us")
        return [mark for mark in self.angles if abs(mark[0]) >= 1e-6] + [(0.0, self.centre_us)]

    def table(self) -> list[str]:
        """Return the live table."""
        angles = ", ".join(f"{math.degrees(angle):+.1f} at {pulse:g}" for angle, pulse in sorted(self.angles))
        rows = [
            ("pulse", f"{self.pulse_us:.1f} us"),
            ("by the old file", f"{math.degrees(self.old.joint_rad(self.pulse_us)):+.2f} degrees"),
            ("minimum  [", _mark(self.minimum_us)),
            ("centre   0", _mark(self.centre_us)),
            ("maximum  ]", _mark(self.maximum_us)),
            ("angles   a", angles or "-"),
        ]
        return [f"  {name:<16} {value}" for name, value in rows]

    def _inside(self, pulse_us: float) -> float:
        return min(max(pulse_us, ABSOLUTE_US[0]), ABSOLUTE_US[1])


def _mark(pulse_us: float | None) -> str:
    return "-" if pulse_us is None else f"{pulse_us:.1f} us"
