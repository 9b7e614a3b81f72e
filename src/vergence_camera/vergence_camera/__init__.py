"""USB webcams, recordings and network streams as one camera interface; only `ros/` imports ROS."""
