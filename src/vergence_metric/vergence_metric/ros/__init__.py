"""The ROS rim: nodes and message conversion."""
