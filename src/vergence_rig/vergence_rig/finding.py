"""The result of one check of `vergence doctor`."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One check: whether it passed, what was found, and the remedy.

    `needed` is True if every use of the workspace needs it, False if only some rigs do.
    """

    name: str
    ok: bool
    message: str
    remedy: str = ""
    needed: bool = True
