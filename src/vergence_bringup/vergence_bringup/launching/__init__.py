"""The launch files' arguments and messages; no ROS, so that they can be checked on every machine."""
