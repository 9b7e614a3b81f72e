"""Parameters of the class-free tracker, as the group `tracker.`."""

import math
from dataclasses import dataclass

from vergence_metric.tracking.registry import tracker_names
from vergence_rig.parameters import Parameters, parameter


@dataclass(frozen=True)
class TrackerParameters(Parameters):
    """When the tracker locks, how it follows its target, and when it gives up."""

    kind: str = parameter("remembered_patch", "which tracker follows the target", choices=tracker_names)
    saccade_rad: float = parameter(
        math.radians(2.5),
        "a rotation of an eye by more than this within tracker.saccade_s is a saccade",
        unit="rad",
        minimum=0.008,
        maximum=0.53,
        formerly="track_saccade_deg",
    )
    saccade_s: float = parameter(
        0.07,
        "time within which a rotation by tracker.saccade_rad is a saccade",
        unit="s",
        minimum=0.02,
        maximum=1.0,
        formerly="track_saccade_s",
    )
    settle_s: float = parameter(
        0.12,
        "time for which the joints must be at rest before the tracker locks",
        unit="s",
        minimum=0.0,
        maximum=2.0,
        formerly="track_settle_s",
    )
    rest_rad_s: float = parameter(
        math.radians(8.0),
        "the eyes are at rest while every joint is slower than this",
        unit="rad/s",
        minimum=0.001,
        maximum=1.75,
        formerly="track_rest_deg_s",
    )
    still_px: float = parameter(
        1.5,
        "the left image is still if it moves by no more than this between frames",
        unit="px",
        minimum=0.1,
        maximum=20.0,
        formerly="track_still_px",
    )
    still_wait_s: float = parameter(
        0.5,
        "time at rest after which the tracker locks although the left image moves",
        unit="s",
        minimum=0.0,
        maximum=5.0,
        formerly="track_still_wait_s",
    )
    region_px: int = parameter(
        110,
        "half side of the square around the fovea in which the target's region is segmented",
        unit="px",
        minimum=20,
        maximum=300,
        formerly="track_region_px",
    )
    snap_px: float = parameter(
        10.0,
        "largest distance of the target's region from the fovea",
        unit="px",
        minimum=0.0,
        maximum=60.0,
        formerly="track_snap_px",
    )
    disparity_jump_px: float = parameter(
        6.0,
        "a disparity that differs from the predicted one by more than this belongs to another object",
        unit="px",
        minimum=1.0,
        maximum=60.0,
        formerly="track_disparity_jump_px",
    )
    min_similarity: float = parameter(
        0.55,
        "least correlation with the target's appearance while it is followed; below it the target is hidden",
        minimum=0.1,
        maximum=0.95,
        formerly="track_minimum_likeness",
    )
    reacquire_similarity: float = parameter(
        0.7,
        "least correlation with the target's appearance at which a hidden target is found again",
        minimum=0.1,
        maximum=0.99,
        formerly="track_reacquire_likeness",
    )
    search_px: int = parameter(
        24,
        "half side of the search for a target that has just been hidden, around its predicted position",
        unit="px",
        minimum=4,
        maximum=200,
        formerly="track_search_px",
    )
    search_growth_px_s: float = parameter(
        60.0,
        "growth of tracker.search_px with the time for which the target is hidden",
        unit="px/s",
        minimum=0.0,
        maximum=1000.0,
        formerly="track_search_growth_px_s",
    )
    give_up_s: float = parameter(
        3.0,
        "time after which a hidden target is lost and no longer searched for",
        unit="s",
        minimum=0.1,
        maximum=60.0,
        formerly="track_give_up_s",
    )
    memory_s: float = parameter(
        1.0,
        "time for which pairs are stored, so that a requested point is learnt in the image in which it was seen",
        unit="s",
        minimum=0.1,
        maximum=10.0,
    )
    request_search_px: int = parameter(
        40,
        "half side of the search for a requested point after the eyes have turned, at first",
        unit="px",
        minimum=8,
        maximum=300,
    )
    request_search_max_px: int = parameter(
        110,
        "largest half side of the search for a requested point; it grows by tracker.search_growth_px_s",
        unit="px",
        minimum=8,
        maximum=600,
    )
    request_similarity: float = parameter(
        0.6,
        "least correlation with the surroundings of a requested point at which it is found",
        minimum=0.1,
        maximum=0.99,
    )
    anchor_similarity: float = parameter(
        0.8,
        "least correlation with the surroundings of a requested point at which its position is corrected for drift",
        minimum=0.1,
        maximum=0.99,
    )
    anchor_gain: float = parameter(
        0.02,
        "gain in correlation with the surroundings of a requested point from which its position is corrected for drift",
        minimum=0.0,
        maximum=1.0,
    )
    anchor_px: int = parameter(
        6, "half side of the search that corrects the drift of a requested point", unit="px", minimum=2, maximum=40
    )
    place_spread_px: float = parameter(
        6.0,
        "distance beside a requested point up to which its surroundings may look the same; beyond it the place is "
        "not certain",
        unit="px",
        minimum=1.0,
        maximum=100.0,
    )
    depth_memory: float = parameter(
        0.85,
        "share of the weights of a requested target's possible distances that the next pair leaves",
        minimum=0.0,
        maximum=0.99,
    )
    depth_apart_rad: float = parameter(
        0.013,
        "largest shift of a requested target's possible parallaxes, all alike, that the joints' reports do not "
        "explain; a third of it tells two distances apart",
        unit="rad",
        minimum=0.001,
        maximum=0.1,
    )
    depth_share: float = parameter(
        0.47,
        "share of the recent pairs that must speak for a distance of a requested target; below it several may fit",
        minimum=0.3,
        maximum=0.99,
    )
    relock_s: float = parameter(
        0.5,
        "time at rest, after a target is lost, until the tracker locks on what is at the fovea",
        unit="s",
        minimum=0,
        maximum=60,
        formerly="track_relock_s",
    )
