"""A rectified pair of photographs as a world: both eyes' exact views for every pan and tilt."""
