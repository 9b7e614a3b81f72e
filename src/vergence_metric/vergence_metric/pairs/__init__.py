"""Two streams of images to synchronised pairs; what nodes that measure pairs share, without ROS."""
