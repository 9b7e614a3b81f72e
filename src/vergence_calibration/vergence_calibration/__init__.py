"""Servos calibrated and a running head identified. Pure Python on numpy and OpenCV; ROS in ros/."""
