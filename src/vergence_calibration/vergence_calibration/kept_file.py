"""Replacing a text file: what would change, atomically, with the old file kept beside the new one."""

import difflib
import shutil
import time
from pathlib import Path

from vergence_rig.atomic_file import write_atomically


def difference(path: Path, text: str) -> str:
    """Return what would change in `path`, as a unified diff; empty where nothing would."""
    old = path.read_text(encoding="utf-8") if path.exists() else ""
    lines = difflib.unified_diff(old.splitlines(), text.splitlines(), str(path), f"{path} (new)", lineterm="")
    return "\n".join(lines)


def replace(path: Path, text: str) -> Path | None:
    """Write `text` atomically; return where the old file is kept, None if there was none. Raises OSError."""
    kept: Path | None = None
    if path.exists():
        stamp = time.strftime("%Y%m%d-%H%M%S")
        kept = path.with_name(f"{path.name}.{stamp}.bak")
        number = 1
        while kept.exists():
            kept = path.with_name(f"{path.name}.{stamp}-{number}.bak")
            number += 1
        shutil.copy2(path, kept)
    write_atomically(path, text)
    return kept
