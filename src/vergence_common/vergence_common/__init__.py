"""The ROS rim written once: images, parameters, diagnostics, QoS, node main."""
