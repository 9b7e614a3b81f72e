"""The ROS side of the test doubles."""
