"""The control loop: perception, phases and law in one step, and its report."""
