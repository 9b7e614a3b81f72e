"""Doubles of the hardware's lowest layer, for tests of several packages."""
