"""Joint angles: their history, limits, resolution, and what a servo with play needs to be told."""
