"""The moving target's own rows: its mask, its points in space, what is not there at rest, its rate."""

import time
from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.results import Row
from bench.trackers_pasted import moving_pieces
from bench.trackers_photographs import NoPhotographsError, photograph_rig, sequences, standing
from bench.trackers_runs import stored
from bench.trackers_scenes import SCENES, THINGS, Frame, Pose, Scene, rig, sequence
from vergence_metric.tracking.eye_view import EyeView
from vergence_metric.tracking.motion.horn_schunck import Flow, horn_schunck
from vergence_metric.tracking.motion.moving_region import FlowOf, MotionDetector, MovingRegion
from vergence_metric.tracking.motion.region_points import region_points
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

Image = NDArray[np.uint8]

_SETTLED = 12  # pairs until the target moves at its speed, in the renderings and across photographs
_BY_NAME = {scene.name: scene for scene in SCENES}
_MOVING, _REST = _BY_NAME["20_deg_s"], (_BY_NAME["rest"], _BY_NAME["rig_yaw"])


def motion_rows(say: Callable[[str], None]) -> list[Row]:
    """Return the rows; OpenCV's DIS and Farneback flows stand beside Horn and Schunck's."""
    flows: dict[str, FlowOf] = {"horn_schunck": horn_schunck, "dis": _dis, "farneback": _farneback}
    rows: list[Row] = []
    still = Scene("still_eyes", 40, _later(_MOVING, 0.45), eyes="still")
    for name, scene in (("still_eyes", still), ("turning_eyes", _MOVING)):
        overlaps: dict[str, list[float]] = {flow: [] for flow in flows}
        off: list[float] = []
        for thing in THINGS:
            frames = list(sequence(scene, thing))
            for flow, flow_of in flows.items():
                regions = _regions(frames, flow_of)
                found = [_overlap(frame, region) for frame, region in zip(frames, regions, strict=True)][_SETTLED:]
                overlaps[flow].append(float(np.median(found)))
                if flow == "horn_schunck":
                    off += _distance_errors(frames[_SETTLED:], regions[_SETTLED:])
            say(f"moving target, {name}, {thing}")
        peer = "DIS flow", float(np.mean(overlaps["dis"]))
        rows.append(Row(f"tracker.moving_target.{name}.iou", float(np.mean(overlaps["horn_schunck"])), "IoU", *peer))
        for thing, value in zip(THINGS, overlaps["horn_schunck"], strict=True):
            rows.append(Row(f"tracker.moving_target.{name}.iou_{thing}", value, "IoU, median"))
        worst = float(np.mean(overlaps["farneback"]))
        rows.append(Row(f"tracker.moving_target.{name}.iou_farneback", worst, "IoU, OpenCV's Farneback"))
        median = float(np.median(off))
        rows.append(Row(f"tracker.moving_target.{name}.distance_error", median, "of the target point's distance"))
    return rows + _rest_rows(say)


def _rest_rows(say: Callable[[str], None]) -> list[Row]:
    """Return the share of pairs without a mask where nothing moves, and the rate at which that is found."""
    rows, pairs, spent_s = [], 0, 0.0
    for scene in _REST:
        for thing in THINGS:
            frames = list(sequence(scene, thing))
            started = time.thread_time()
            regions = _regions(frames, horn_schunck)
            spent_s += time.thread_time() - started
            pairs += len(regions)
            rows.append(Row(f"tracker.moving_target.{scene.name}.no_mask_{thing}", _nothing(regions), "of pairs"))
        say(f"moving target, {scene.name}")
    rows.append(Row("tracker.moving_target.rate", pairs / spent_s, "Hz at 320x240, of CPU time"))
    try:
        return rows + _photograph_rows(say)
    except NoPhotographsError as error:
        say(str(error))
        return rows


def _photograph_rows(say: Callable[[str], None]) -> list[Row]:
    """Return the share of pairs without a mask where nothing moves in a photograph, and the masks of moving pieces."""
    rows, head = [], photograph_rig()
    for name, sequences_of in (("no_mask", standing), ("no_mask_eyes_turning", sequences)):
        nothing = [_nothing(_regions(frames, horn_schunck, head)) for _, frames in sequences_of()]
        rows.append(Row(f"tracker.moving_target.photographs.{name}", float(np.mean(nothing)), "of pairs"))
        say(f"moving target, photographs, {name}")
    for name, follow in (("still_eyes", False), ("turning_eyes", True)):
        masked = []
        for _, frames in moving_pieces(follow):
            regions = _regions(frames, horn_schunck, head)
            found = [_overlap(frame, region) for frame, region in zip(frames, regions, strict=True)][_SETTLED:]
            masked.append(float(np.median(found)))
        rows.append(Row(f"tracker.moving_target.photographs_20_deg_s.{name}_iou", float(np.mean(masked)), "IoU"))
        say(f"moving target, photographs, {name}")
    return rows


def _nothing(regions: list[MovingRegion | None]) -> float:
    """Return the share of pairs without a region; the first image has none before it."""
    return float(np.mean([region is None for region in regions[1:]]))


def _later(scene: Scene, by_s: float) -> Callable[[float], Pose]:
    return lambda t: scene.pose(t + by_s)


def _regions(frames: list[Frame], flow_of: FlowOf, head: Rig | None = None) -> list[MovingRegion | None]:
    detector, camera = MotionDetector(flow_of), CameraModel((head or rig()).left_camera)
    found = []
    for frame in frames:
        view = EyeView(camera, frame.eyes.pan_left_rad, frame.eyes.tilt_rad)
        region = detector.update(frame.left, view, frame.stamp_s)
        found.append(None if isinstance(region, str) else region)
    return found


def _overlap(frame: Frame, region: MovingRegion | None) -> float:
    if region is None:
        return 0.0
    height, width = frame.left.shape
    true = np.zeros((height, width), np.uint8)
    cv2.fillConvexPoly(true, np.rint(frame.outline_px).astype(np.int32), 1)
    mask = cv2.resize(region.mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
    return float((mask & true).sum() / max((mask | true).sum(), 1))


def _distance_errors(frames: list[Frame], regions: list[MovingRegion | None]) -> list[float]:
    """Return by how much of its distance each region's median point is off the target point's distance."""
    head = rig()
    camera, kinematics, off = CameraModel(head.left_camera), Kinematics(head), []
    for frame, region in zip(frames, regions, strict=True):
        if region is None:
            continue
        # What the joints do not know of themselves is another row's matter: here their angles are the true ones.
        points = region_points(region, stored(replace(frame, eyes=frame.true_eyes), camera, kinematics), kinematics)
        if not isinstance(points, str):
            true_m = float(np.linalg.norm(frame.point_m))
            off.append(abs(float(np.linalg.norm(points.center_m)) - true_m) / true_m)
    return off


def _dis(before: Image, now: Image) -> Flow:
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    return np.asarray(search.calc(before, now, np.zeros((*before.shape, 2), np.float32)), np.float32)


def _farneback(before: Image, now: Image) -> Flow:
    start = np.zeros((*before.shape, 2), np.float32)
    return np.asarray(cv2.calcOpticalFlowFarneback(before, now, start, 0.5, 4, 15, 3, 5, 1.1, 0), np.float32)
