"""Test doubles of the metric's tests."""
