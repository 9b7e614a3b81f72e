"""Rewrite the build machine's Python paths in the ROS wheels' CMake exports to this environment's own.

The wheels were built under /opt/python/cpXY-cpXY; about twenty files under share/*/cmake still name that include
directory and that site-packages, and CMake refuses a target whose include directory does not exist.
"""

import re
import sys
import sysconfig
from pathlib import Path

INCLUDE = re.compile(r"/opt/python/cp\d+-cp\d+/include/python3\.\d+")
PURELIB = re.compile(r"/opt/python/cp\d+-cp\d+/lib/python3\.\d+/site-packages")


def mend(prefix: Path, include: str, purelib: str) -> int:
    """Rewrite every export under prefix/share/*/cmake; return how many files changed."""
    changed = 0
    for path in sorted(prefix.glob("share/*/cmake/*.cmake")):
        text = path.read_text(encoding="utf-8")
        mended = PURELIB.sub(lambda _: purelib, INCLUDE.sub(lambda _: include, text))
        if mended != text:
            path.write_text(mended, encoding="utf-8")
            changed += 1
    return changed


if __name__ == "__main__":
    paths = sysconfig.get_paths()
    count = mend(Path(sys.argv[1]), paths["include"], paths["purelib"])
    if count:
        print(f"[setup] mended the Python paths in {count} CMake exports of the ROS wheels", file=sys.stderr)
