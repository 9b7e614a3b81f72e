"""A text that must not be overlooked in a terminal full of log lines."""


def banner(*lines: str) -> str:
    """Return the lines between two rows of '!', beginning with a line feed."""
    row = "!" * max(len(line) for line in lines)
    return "\n".join(("", row, *lines, row))
