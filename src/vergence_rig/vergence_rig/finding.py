"""What the parts of `vergence doctor` say, each of the machine it knows."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One thing looked at: whether it is well, what was seen, and what mends it.

    `needed` says whether every use of the workspace needs it, or only some rigs.
    """

    name: str
    ok: bool
    message: str
    mend: str = ""
    needed: bool = True
