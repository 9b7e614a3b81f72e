"""The rig in pure Python: its description, geometry, cameras and servo plants. No ROS in it."""
