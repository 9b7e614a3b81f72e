"""The demo: stations, result and report."""
