"""What an executable does before its module is there: importing takes seconds, in which it may be interrupted."""

import importlib
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from vergence_rig.install_hint import install_hint
from vergence_rig.middleware import middleware_problem

STATUS_BAD_INPUT = 2


def run(module: str, optional: Sequence[str] = (), tool: bool = False) -> int:
    """Import a module, call its `main`, and return the exit status.

    While it is imported, Ctrl-C ends the process without a traceback: there is nothing to release yet. A package that
    is not installed is one line on standard error with the command that installs it.

    Args:
        module: the module's full name.
        optional: packages that apt lacks, without which the module cannot be imported.
        tool: let Ctrl-C raise KeyboardInterrupt in `main`, which handles it; a node handles the signal itself.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    problem = middleware_problem()
    if problem:
        print(f"{Path(sys.argv[0]).stem}: {problem}", file=sys.stderr)
        return STATUS_BAD_INPUT
    try:
        main = importlib.import_module(module).main
    except ModuleNotFoundError as error:
        if error.name is None or error.name not in optional:
            raise
        print(f"{Path(sys.argv[0]).stem}: {error.name} is not installed: {install_hint(error.name)}", file=sys.stderr)
        return STATUS_BAD_INPUT
    if tool:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    return int(main())
