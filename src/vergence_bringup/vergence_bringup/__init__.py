"""Launch files, URDF, the vergence command line, demo and report."""
