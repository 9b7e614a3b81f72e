"""Test doubles of nodes beside the gaze controller."""
