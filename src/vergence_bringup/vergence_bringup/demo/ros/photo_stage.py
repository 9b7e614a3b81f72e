"""Photographs before the eyes: a station is one of their points."""

from collections.abc import Callable
from typing import Any

from vergence_bringup.demo.photographs import PhotoFigures, Photographs
from vergence_bringup.demo.ros.recorder import Recorder
from vergence_bringup.demo.ros.stage import Stage
from vergence_bringup.demo.stations import Station
from vergence_rig.geometry import EyeAngles


class PhotoStage(Stage):
    """Points of the photographs that photo_node shows. Nothing in them moves."""

    source = "photo_node"

    def __init__(self, recorder: Recorder, check_alive: Callable[[], None], photographs: Photographs) -> None:
        super().__init__(recorder, check_alive)
        self._photographs = photographs

    def show(self, station: Station) -> None:
        """Make the ground truth that of a station's point."""
        number = self._photographs.number_of(self._photographs.point_of(station))
        self._recorder.set_parameters(self.source, {"point": number}, self._check_alive)

    def photo_figures(self, station: Station, truth: Any) -> PhotoFigures:
        """Return what a TrueVergence message at rest says of a station's point."""
        resting = EyeAngles(truth.pan_left_rad, truth.pan_right_rad, truth.tilt_rad)
        return self._photographs.figures(station, resting)
