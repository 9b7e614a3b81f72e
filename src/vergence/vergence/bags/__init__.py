"""Recordings: bags in rosbag2's layout on MCAP, written and read without ROS."""
