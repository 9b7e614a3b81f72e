"""Class-free trackers behind one protocol; importing this package registers those that come with it."""

from vergence_metric.tracking.corner_cluster_tracker import CornerClusterTracker
from vergence_metric.tracking.moving_target import moving_target_tracker
from vergence_metric.tracking.registry import register_tracker
from vergence_metric.tracking.tracker import TargetTracker
from vergence_metric.tracking.zero_disparity_pursuit import zero_disparity_tracker

register_tracker("remembered_patch", TargetTracker)
register_tracker("corner_cluster", CornerClusterTracker)
register_tracker("moving_target", moving_target_tracker)
register_tracker("zero_disparity", zero_disparity_tracker)
