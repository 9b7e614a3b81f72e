"""Test doubles: a head without hardware for tests and benchmarks."""
