"""Video4Linux2 by its own ioctls: the camera's bytes, the kernel's stamps, its controls, and a fake kernel."""
