"""The head's geometry found by looking: lens mounts, joint zeros and scales, the tilt axis, and the cameras."""
