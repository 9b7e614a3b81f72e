"""Where the target is: sightings to an estimate of its direction, depth and motion."""
