"""Joint angles: their history, limits and resolution, and commands that compensate a servo's play."""
