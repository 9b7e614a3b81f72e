"""Run every benchmark, or the one named by --only, and print their tables."""

import argparse
import importlib
import os
import pkgutil
import platform
import sys
import time
from pathlib import Path

import bench
from bench import results


def names() -> list[str]:
    """Return the names of all benchmarks: bench_NAME.py beside this file."""
    return sorted(m.name.removeprefix("bench_") for m in pkgutil.iter_modules(bench.__path__) if m.name[:6] == "bench_")


def processor() -> str:
    """Return the processor's name and the number of cores that this process may use."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith(("model name", "Model"))]
    return f"{named[0] if named else platform.machine()}, {len(os.sched_getaffinity(0))} cores"


def main() -> int:
    """Run what the command line asks for; 0 if every benchmark ran."""
    parser = argparse.ArgumentParser(prog="make bench ONLY=NAME", description=__doc__)
    parser.add_argument("--only", choices=names(), metavar="NAME", help=f"one of: {', '.join(names())}")
    chosen = parser.parse_args().only
    failed: list[str] = []
    print(f"on {processor()}", flush=True)
    for name in [chosen] if chosen else names():
        started = time.monotonic()
        print(f"\n== {name}", flush=True)
        try:
            module = importlib.import_module(f"bench.bench_{name}")
            rows = module.run(lambda text: print(f"   {text}", flush=True))
        except Exception as error:  # one benchmark's failure must not hide the others' figures
            print(f"   {name} failed: {type(error).__name__}: {error}", flush=True)
            failed.append(name)
            continue
        path = results.write(name, rows)
        print(getattr(module, "table", results.table)(rows))
        print(f"   {time.monotonic() - started:.0f} s, written to {path.relative_to(results.OUT_DIR.parent.parent)}")
    if failed:
        print(f"\nfailed: {', '.join(failed)}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
