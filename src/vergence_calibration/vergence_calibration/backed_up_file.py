"""Replaces a text file atomically and keeps the old one as a backup."""

import difflib
import shutil
import time
from pathlib import Path

from vergence_rig.atomic_file import write_atomically


def difference(path: Path, text: str) -> str:
    """Return what would change in `path`, as a unified diff; empty for no change."""
    old = path.read_text(encoding="utf-8") if path.exists() else ""
    lines = difflib.unified_diff(old.splitlines(), text.splitlines(), str(path), f"{path} (new)", lineterm="")
    return "\n".join(lines)


def replace(path: Path, text: str) -> Path | None:
    """Write `text` atomically; return the path of the old file's backup, None if there was none. Raises OSError."""
    backup: Path | None = None
    if path.exists():
        stamp = time.strftime("%Y%m%d-%H%M%S")
        backup = path.with_name(f"{path.name}.{stamp}.bak")
        number = 1
        while backup.exists():
            backup = path.with_name(f"{path.name}.{stamp}-{number}.bak")
            number += 1
        shutil.copy2(path, backup)
    write_atomically(path, text)
    return backup
