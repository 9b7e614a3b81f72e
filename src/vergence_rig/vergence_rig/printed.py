"""Texts of errors as they are printed: one line, whatever they quote."""


def printed_line(text: object) -> str:
    """Return a text as one line: white space collapsed, what cannot be printed escaped as Python writes it."""
    line = " ".join(str(text).split())
    return line if line.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in line)
