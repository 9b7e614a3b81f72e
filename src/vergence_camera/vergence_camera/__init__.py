"""One USB webcam, file or network stream as a camera that a robot can live with. Only camera_node knows ROS."""
