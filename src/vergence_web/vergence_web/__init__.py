"""A page of the running head for a browser: server, page state and checks of what it asks for; ROS in ros/."""
