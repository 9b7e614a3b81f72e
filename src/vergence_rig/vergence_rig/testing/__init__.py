"""References for tests."""
