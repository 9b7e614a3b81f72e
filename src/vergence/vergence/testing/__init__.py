"""A head for tests, without simulator and hardware."""
