"""A binocular head in a furnished room, on MuJoCo: stands in for cameras, servos and world."""
