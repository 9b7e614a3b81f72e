"""The control loop: state estimate, phases and law in one step, and its report."""
