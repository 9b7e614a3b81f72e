"""One station of the demo: show the target, click on it, record the eyes, compare with the ground truth."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vergence_bringup.demo.result import Floats, MetricTable, Series, StationResult
from vergence_bringup.demo.ros.recorder import Recorder, Stamped, StereoPicture
from vergence_bringup.demo.ros.stage import Stage, class_goal
from vergence_bringup.demo.stations import Station
from vergence_bringup.figures.boxes import BoxFigures
from vergence_bringup.figures.pictures import (
    Image,
    combined_edges,
    with_box,
    with_cross,
    with_ring,
    with_windows,
    write_image,
)
from vergence_bringup.ros.look import result_name
from vergence_common.stamps import to_seconds
from vergence_metric.measurement.edge_metric import EdgeMetric
from vergence_metric.pairs.ideal_images import IdealImages
from vergence_msgs.action import LookAt
from vergence_msgs.msg import EdgeVergence
from vergence_rig.camera import CameraModel
from vergence_rig.rig import Rig

# The target point must end inside the 50 px fovea of both eyes.
_FOVEA_HALF_PX = 25.0
_LIMIT_S = 12.0
_ACQUIRE_S = 1.0


def tolerance_deg(rig: Rig, ideal: bool) -> float:
    """Return the largest accepted true vergence error: the servos' dead band, 0.1 degree for ideal servos."""
    return 0.1 if ideal else math.degrees(rig.pan_left.servo.dead_band_rad)


class StationRunner:
    """Visits stations of a stage one after the other; `check_alive` raises when a node has ended."""

    def __init__(
        self,
        recorder: Recorder,
        check_alive: Callable[[], None],
        stage: Stage,
        rig: Rig,
        tolerance_deg: float,
        out_dir: Path,
    ) -> None:
        self._recorder, self._stage = recorder, stage
        self._check_alive = check_alive
        self._rig = rig
        self._tolerance_deg = tolerance_deg
        self._out_dir = out_dir
        self._edge_metric = EdgeMetric()
        self._ideal = IdealImages(rig)
        self._eye_images = self._ideal.set_cameras((CameraModel(rig.left_camera), CameraModel(rig.right_camera)))

    def wait_until_ready(self) -> None:
        """Wait until every node publishes."""
        self._stage.wait_until_ready()

    def time_figures(self) -> dict[str, Any]:
        """Return how time passed, for the summary."""
        return self._recorder.time.figures()

    def visit(self, station: Station) -> StationResult:
        """Show the target, send a goal to look at it, and return the result.

        The goal is a click on the left image or the target's class.
        """
        recorder = self._recorder
        recorder.time.align(self._check_alive)
        self._stage.clear()  # until the eyes are at the start
        recorder.set_parameters("gaze_controller_node", {"mode": "both_eyes"}, self._check_alive)
        self._stage.send_eyes(
            math.radians(station.start_version_deg),
            math.radians(station.start_vergence_deg),
            math.radians(station.start_tilt_deg),
        )
        recorder.set_parameters("gaze_controller_node", {"mode": station.mode}, self._check_alive)
        self._stage.show(station)
        shown_at = recorder.now_s()
        truth = recorder.wait_for(
            f"{station.target} in both views", lambda: self._seen(station, shown_at), 10.0, self._check_alive
        )
        before = recorder.picture(station.has_boxes, self._check_alive)
        self._store(station, "start", before, truth)
        recorder.time.align(self._check_alive)

        began = recorder.now_s()
        marks = len(recorder.states), len(recorder.edges), len(recorder.truths), len(recorder.boxes)
        goal = class_goal(station.target, _LIMIT_S) if station.by_class else _click(truth)
        result = recorder.look_at(goal, self._check_alive, _LIMIT_S + 10.0)
        answer = result_name(result.result)
        reason = "" if result.result == LookAt.Result.VERGED else result.reason or answer
        if station.moving:
            self._stage.set_moving(station, True)
            # The target starts at full speed: the eyes get a second to reach it before the hold begins.
            recorder.settle(_ACQUIRE_S, self._check_alive)
        recorder.settle(station.hold_s, self._check_alive)
        after = recorder.picture(station.has_boxes, self._check_alive)
        self._store(station, "end", after, recorder.truths[-1].message)
        if station.moving:
            self._stage.set_moving(station, False)
        outcome = self._result(station, began, marks, reason, before, after)
        return replace(outcome, answer=answer, answer_s=float(result.time_s))

    def _seen(self, station: Station, since_s: float) -> Any:
        entry = self._recorder.truths[-1]
        truth = entry.message
        exposed_s = to_seconds(truth.header.stamp)
        inside = truth.target == station.target and exposed_s > since_s
        # NaN compares false: what the right eye sees of a point of unknown depth is not known.
        hidden = truth.left_visible_share <= 0.2 or truth.right_visible_share <= 0.2
        return truth if inside and not hidden else None

    def _store(self, station: Station, moment: str, picture: StereoPicture, truth: Any) -> None:
        folder = self._out_dir / "pictures"
        views = self._ideal.draw(picture.left_bgr, picture.right_bgr)  # as the metric nodes measure them
        measured = self._edge_metric.measure(*views, self._ideal.seen_px)
        windows = [int(size) for size in picture.edge.windows_px]
        left, right = measured.left_edges.mask, measured.right_edges.mask
        name = f"{station.name}_{moment}"
        boxes = (None, None) if picture.box is None else (picture.box.left, picture.box.right)
        places = ((truth.left_x_px, truth.left_y_px), (truth.right_x_px, truth.right_y_px))
        clicked = [image.to_ideal([place])[0].tolist() for image, place in zip(self._eye_images, places, strict=True)]
        for eye, view, box, place in zip(("left", "right"), views, boxes, clicked, strict=True):
            drawn = with_cross(_boxed(view, box))
            if self._stage.photo_figures(station, truth) is not None:
                drawn = with_ring(with_windows(drawn, [round(2 * _FOVEA_HALF_PX)]), place)
            write_image(folder / f"{name}_{eye}.jpg", drawn)
        write_image(folder / f"{name}_left_edges.png", left)
        write_image(folder / f"{name}_right_edges.png", right)
        write_image(folder / f"{name}_combined.png", with_windows(combined_edges(left, right), windows))

    def _result(
        self,
        station: Station,
        began_s: float,
        marks: tuple[int, int, int, int],
        reason: str,
        before: StereoPicture,
        after: StereoPicture,
    ) -> StationResult:
        recorder = self._recorder
        states, edges, truths, boxes = (
            series[mark:]
            for series, mark in zip(
                (recorder.states, recorder.edges, recorder.truths, recorder.boxes), marks, strict=True
            )
        )
        held_from_s = recorder.now_s() - station.hold_s
        held = [entry.message.verged for entry in states if entry.arrival_s >= held_from_s]
        # Single cycles without vergence are tolerated, in pursuit or on a busy machine, but not at the end.
        lately = [entry.message.verged for entry in states if entry.arrival_s >= recorder.now_s() - 0.5]
        reported = bool(held) and np.mean(held) >= 0.8 and np.mean(lately) >= 0.5 and not reason
        if not reported and not reason:
            reason = (
                f"vergence was reported in {100 * np.mean(held):.0f} % of the hold: {states[-1].message.reason}"
                if held
                else "gaze/state was not received"
            )
        reported_at_s = next((to_seconds(e.message.cycle_stamp) for e in states if e.message.verged), math.nan)
        end_truths = [entry.message for entry in truths if entry.arrival_s >= held_from_s]
        final = truths[-1].message
        fixation = states[-1].message.target
        return StationResult(
            name=station.name,
            title=station.title,
            moving=station.moving,
            reported_verged=bool(reported),
            reason=reason,
            time_s=reported_at_s - began_s,
            true_error_deg=_median_deg([truth.vergence_error_rad for truth in end_truths]),
            off_axis_deg=_largest_known(
                _median_deg([getattr(truth, f"{eye}_error_rad") for truth in end_truths]) for eye in ("left", "right")
            ),
            tolerance_deg=self._tolerance_deg,
            off_axis_tolerance_deg=math.degrees(math.atan(_FOVEA_HALF_PX / self._rig.left_camera.fx_px)),
            start=_table(before.edge),
            end=_table(after.edge),
            fixation_m=(fixation.x, fixation.y, fixation.z),
            target_m=(final.target_point.x, final.target_point.y, final.target_point.z),
            series=_series(began_s, states, edges, truths, boxes if station.has_boxes else ()),
            start_box=before.box and BoxFigures.from_message(before.box),
            end_box=after.box and BoxFigures.from_message(after.box),
            photo=self._stage.photo_figures(station, final),
        )


def _click(truth: Any) -> LookAt.Goal:
    """Return the goal of a click on the target in the left image: one pixel, no depth."""
    goal = LookAt.Goal(kind=LookAt.Goal.PIXEL, eye=LookAt.Goal.EYE_LEFT, time_limit_s=_LIMIT_S, depth_m=math.nan)
    goal.header.stamp = truth.header.stamp
    goal.left_x_px, goal.left_y_px = float(round(truth.left_x_px)), float(round(truth.left_y_px))
    return goal


def _largest_known(values: Iterable[float]) -> float:
    """Return the largest value that is not NaN; NaN if there is none."""
    return max((value for value in values if math.isfinite(value)), default=math.nan)


def _boxed(view: Image, box: Any) -> Image:
    """Return the view with a BoundingBox drawn on it, if there is one."""
    if box is None or not math.isfinite(box.x_min_px):
        return view
    return with_box(view, (box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px), f"{box.class_name} {box.score:.2f}")


def _median_deg(values_rad: Sequence[float]) -> float:
    return math.degrees(float(np.median(np.abs(values_rad)))) if len(values_rad) else math.nan


def _table(edge: EdgeVergence) -> MetricTable:
    windows = [int(size) for size in edge.windows_px]
    return MetricTable(windows, list(edge.left_to_right_px), list(edge.right_to_left_px), list(edge.contrast))


def _series(
    began_s: float,
    states: Sequence[Stamped],
    edges: Sequence[Stamped],
    truths: Sequence[Stamped],
    boxes: Sequence[Stamped],
) -> Series:
    def stamps(entries: Sequence[Stamped]) -> Floats:
        return np.array([to_seconds(entry.message.header.stamp) - began_s for entry in entries])

    column = 0
    if edges:
        windows = list(edges[0].message.windows_px)
        column = windows.index(100) if 100 in windows else 0
    metric = [0.5 * (e.message.left_to_right_px[column] + e.message.right_to_left_px[column]) for e in edges]
    true_vergence = np.array([entry.message.pan_right_rad - entry.message.pan_left_rad for entry in truths])
    error = np.array([entry.message.vergence_error_rad for entry in truths])
    return Series(
        time_s=stamps(edges),
        metric_px=np.array(metric, np.float64),
        contrast=np.array([entry.message.contrast[column] for entry in edges], np.float64),
        state_time_s=np.array([to_seconds(entry.message.cycle_stamp) - began_s for entry in states]),
        vergence_deg=np.degrees([entry.message.vergence_rad for entry in states]),
        truth_time_s=stamps(truths),
        true_vergence_deg=np.degrees(true_vergence),
        wanted_vergence_deg=np.degrees(true_vergence + error),
        true_disparity_px=np.array([entry.message.mean_disparity_px for entry in truths], np.float64),
        box_time_s=stamps(boxes),
        box_center_px=np.array([entry.message.center_horizontal_px for entry in boxes], np.float64),
        box_refined_px=np.array([entry.message.refined_horizontal_px for entry in boxes], np.float64),
    )
