"""Class-free trackers behind one protocol; importing this package registers those that come with it."""

from vergence_metric.tracking.registry import register_tracker
from vergence_metric.tracking.tracker import TargetTracker

register_tracker("remembered_patch", TargetTracker)
