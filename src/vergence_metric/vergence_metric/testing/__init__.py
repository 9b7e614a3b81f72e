"""Test doubles: detectors and scenes with known answers, for tests and benchmarks."""
