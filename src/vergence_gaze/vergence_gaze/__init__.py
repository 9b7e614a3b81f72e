"""The gaze controller: visual errors to joint commands. Pure Python on numpy, no clock of its own; ROS in ros/."""
