"""Vertical offset and roll between the eyes, measured and taken out."""
