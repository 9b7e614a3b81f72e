"""Vertical offset and roll between the eyes, estimated and removed from the right image."""
