"""What moves in a pair, other than the eyes: flow, its region, and that region's points in space."""
