"""Where the target is: observations to an estimate of its direction, depth and motion."""
