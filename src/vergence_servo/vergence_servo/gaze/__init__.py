"""The gaze control core: from visual errors to joint commands. Pure Python on numpy, no ROS, no clock of its own."""
