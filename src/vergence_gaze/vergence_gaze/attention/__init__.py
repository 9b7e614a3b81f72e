"""Attention without a goal: which object is looked at, when the eyes go on, and where to when there is none."""
