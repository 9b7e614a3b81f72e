"""A distance as text, never without its interval of 95 %: angles of joints alone may leave it quite unknown."""

import math


def distance_text(distance_m: float, low_m: float, high_m: float) -> str:
    """Return a distance and its interval, such as "0.83 m (0.70 to 1.02 m)"; "" where it is unknown."""
    if math.isnan(distance_m + low_m + high_m):
        return ""
    return f"{distance_m:.2f} m ({low_m:.2f} to {high_m:.2f} m)"
