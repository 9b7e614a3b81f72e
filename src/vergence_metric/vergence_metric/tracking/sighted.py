"""The track of a target that was found: in the left eye alone, or in both."""

import math
from dataclasses import replace

from vergence_metric.disparity.protocol import Disparity
from vergence_metric.tracking.eye_view import EyeView
from vergence_metric.tracking.target_appearance import Sighting
from vergence_metric.tracking.track import NOWHERE, Track, TrackStatus
from vergence_metric.tracking.tracked_target import Target

_CONFIDENCE_WITHOUT_DISPARITY, _CONFIDENCE_REJECTED = 0.6, 0.8  # times the similarity
_UNLIKE, _ALIKE = 0.3, 0.9  # similarities that give no confidence, and all of it


def in_left_eye(target: Target, sighting: Sighting, reason: str) -> Track:
    """Return the track of a target found in the left eye; `reason` says why it was not in the right one."""
    similarity = min(max((sighting.similarity - _UNLIKE) / (_ALIKE - _UNLIKE), 0.0), 1.0)
    scale = target.appearance.scale
    return Track(
        target.track_id,
        target.lock_stamp_s,
        sighting.pixel,
        NOWHERE,
        math.nan,
        math.nan,
        math.nan,
        (target.appearance.extent_px[0] * scale, target.appearance.extent_px[1] * scale),
        similarity * _CONFIDENCE_WITHOUT_DISPARITY,
        TrackStatus.OCCLUDED,
        f"target not found in the right eye: {reason}",
        target.goal_id,
    )


def in_both_eyes(
    track: Track, target: Target, disparity: Disparity, views: tuple[EyeView, EyeView], stamp_s: float
) -> Track:
    """Return the track with its disparity, and update the target's parallax."""
    across, down = disparity.horizontal_px, disparity.vertical_px
    x, y = target.fixated_px(track.left_px)
    target.update_parallax(stamp_s, (x, y), views, (x - across, y - down))
    return replace(
        track,
        right_px=(track.left_px[0] - across, track.left_px[1] - down),
        disparity_px=across,
        vertical_px=down,
        sigma_px=disparity.sigma_px,
        confidence=track.confidence / _CONFIDENCE_WITHOUT_DISPARITY * (1.0 if disparity.ok else _CONFIDENCE_REJECTED),
        status=TrackStatus.OK,
        reason="" if disparity.ok else disparity.reason,
        surface=disparity.surface,
    )
