"""Pictures of both eyes to measurements: pairs them, and measures the newest pair that is usable."""

import math

from vergence.body import Picture, Pixels
from vergence.pair_metric import PairMetric
from vergence_gaze.estimation.observations import Observation, TrackSighting
from vergence_metric.measurement.parameters import PairMeasurementParameters
from vergence_metric.pairs.pairing import Pair, StereoPairer
from vergence_metric.pairs.parameters import PairingParameters
from vergence_metric.pairs.picture_faults import PictureMonitor
from vergence_rig.camera import CameraModel
from vergence_rig.rig import Rig


class Vision:
    """Pairs pictures; `metric` measures the pairs.

    Args:
        rig: describes the cameras that are not calibrated.
        cameras: the calibrated ones, left and right.
        parameters: of the metric.
        pairing: of the pairs.
    """

    def __init__(
        self,
        rig: Rig,
        cameras: tuple[CameraModel | None, CameraModel | None],
        parameters: PairMeasurementParameters,
        pairing: PairingParameters | None = None,
    ) -> None:
        self.metric = PairMetric(rig, cameras, parameters)
        self._pairer: StereoPairer[Pixels] = StereoPairer(pairing or PairingParameters())
        self._pictures = PictureMonitor()
        self._waiting: Pair[Pixels] | None = None
        self.fault = ""
        """Why nothing in the newest pair may be used; "" if it may."""

    def add_picture(self, picture: Picture, now_ns: int) -> None:
        """Add a picture that arrives at `now_ns`; `observe` measures the newest of the pairs that are complete then."""
        for pair in self._pairer.add(picture.side, picture.stamp_ns, picture.pixels, now_ns):
            self._waiting = pair

    def observe(self, now_ns: int) -> list[Observation]:
        """Measure the newest complete pair, if there is one, and return what the controller reads of it."""
        for late in self._pairer.expire(now_ns):
            self._waiting = late
        pair, self._waiting = self._waiting, None
        if pair is None:
            return []
        stamp_s, skew_s = pair.left_stamp_ns * 1e-9, pair.skew_ns * 1e-9
        found = self._pictures.update(stamp_s, pair.left, pair.right)
        self.fault = found.reason if found is not None and found.unusable else ""
        return [_unusable(stamp_s, skew_s, self.fault)] if self.fault else self.metric.observe(pair)


def _unusable(stamp_s: float, skew_s: float, fault: str) -> TrackSighting:
    nan = math.nan
    return TrackSighting(stamp_s, skew_s, 0, 0.0, nan, nan, nan, nan, nan, False, fault, images_fault=fault)
