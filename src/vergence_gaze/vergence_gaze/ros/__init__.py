"""The node gaze_controller_node, its action server and its message conversion."""
