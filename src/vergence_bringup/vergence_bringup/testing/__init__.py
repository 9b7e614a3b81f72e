"""Test doubles: a head before a wall, and the faults that are injected into its graph."""
