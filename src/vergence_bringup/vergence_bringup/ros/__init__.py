"""Nodes, processes and everything else that needs ROS."""
