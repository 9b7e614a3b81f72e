"""Calibration of servos: by hand in a terminal, or from the cameras' images."""
