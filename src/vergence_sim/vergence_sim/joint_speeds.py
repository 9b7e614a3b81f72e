"""Speeds of the joints from their angles at two times, as a driver without a tachometer reports them."""

from collections.abc import Mapping


class JointSpeeds:
    """Differentiates the angles of one set of joints."""

    def __init__(self) -> None:
        self._time_s = 0.0
        self._angles_rad: dict[str, float] = {}
        self._speeds_rad_s: dict[str, float] = {}

    def at(self, time_s: float, angles_rad: Mapping[str, float]) -> dict[str, float]:
        """Return the mean speeds [rad/s] since the call before; 0 at the first, before which the joints rest."""
        passed_s = time_s - self._time_s
        if not self._angles_rad:
            self._speeds_rad_s = dict.fromkeys(angles_rad, 0.0)
        elif passed_s > 0:
            self._speeds_rad_s = {
                name: (angle - self._angles_rad.get(name, angle)) / passed_s for name, angle in angles_rad.items()
            }
        self._time_s, self._angles_rad = time_s, dict(angles_rad)
        return dict(self._speeds_rad_s)
