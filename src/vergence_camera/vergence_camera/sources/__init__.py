"""Frame sources other than V4L2: recordings, image folders and network streams."""
