"""Calibrating one camera or a pair from views of a board."""
