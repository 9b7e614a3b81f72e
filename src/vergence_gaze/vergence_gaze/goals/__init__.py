"""What is asked for: goals, how they begin, and when they have succeeded or failed."""
