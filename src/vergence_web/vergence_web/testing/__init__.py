"""A browser for tests, benchmarks and screenshots."""
