"""Class-free trackers behind one protocol; importing this package registers those that come with it."""

from vergence_metric.tracking.appearance_follower import remembered_patch_tracker
from vergence_metric.tracking.cluster_follower import corner_cluster_tracker
from vergence_metric.tracking.moving_target import moving_target_tracker
from vergence_metric.tracking.registry import register_tracker
from vergence_metric.tracking.zero_disparity_pursuit import zero_disparity_tracker

register_tracker("remembered_patch", remembered_patch_tracker)
register_tracker("corner_cluster", corner_cluster_tracker)
register_tracker("moving_target", moving_target_tracker)
register_tracker("zero_disparity", zero_disparity_tracker)
