"""Metrics to servos: the gaze control law and the servo drivers."""
