"""The guarded start of every node and command: what cannot start is one line that names what must be changed."""

import errno
import os
import pwd
import re
import tempfile
from collections.abc import Sequence
from typing import Any

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.validate_namespace import validate_namespace
from rclpy.validate_node_name import validate_node_name

from vergence_common.arguments import remaps
from vergence_common.parameter_files import node_name, with_checked_files
from vergence_rig.printed import printed_line
from vergence_rig.regular_file import expanded

LARGEST_DOMAIN_ID = 232
"""RTPS computes port numbers from the domain: those of a higher one do not exist."""

REFUSALS: tuple[type[Exception], ...] = (
    ValueError,
    OSError,
    NameValidationException,
    ParameterException,
    rclpy_implementation.RCLError,
    rclpy_implementation.UnknownROSArgsError,
)
"""What a start can fail with because of what the user gave."""

_VALIDATED = {"__ns": validate_namespace, "__node": validate_node_name, "__name": validate_node_name}


class StartError(ValueError):
    """A start that cannot succeed: the message names the thing, what must hold, and the value."""


def init(arguments: Sequence[str] | None = None, nodes: Sequence[str] = (), **options: Any) -> None:
    """Initialise rclpy with these arguments (None: of the command line). Raises StartError or ParameterFileError.

    Environment, names and parameter files are checked first: rcl would write several lines, or start and be unable to
    communicate. `nodes` are the names that the nodes have unless the arguments give others.
    """
    if options.get("domain_id") is None:
        _check_domain()
    _ensure_home()
    _check_log_folder()
    _check_names(arguments or ())
    if arguments is not None:
        arguments = with_checked_files(arguments, [node_name(name, arguments) for name in nodes])
    try:
        rclpy.init(args=arguments, **options)
    except REFUSALS as error:
        raise StartError(one_line(error)) from error


def checked_namespace(text: str) -> str | None:
    """Return a command's namespace, None for an empty one. Raises StartError for one that cannot be."""
    if not text:
        return None
    try:
        validate_namespace(text if text.startswith("/") else f"/{text}")
    except NameValidationException as error:
        raise StartError(_name_text(error)) from error
    return text


def one_line(error: BaseException) -> str:
    """Return an exception's text as one line, without the places in rcl's source files."""
    if isinstance(error, NameValidationException):
        return printed_line(_name_text(error))
    text = printed_line(error) or type(error).__name__
    if isinstance(error, rclpy_implementation.UnknownROSArgsError):
        return f"arguments after --ros-args must be those of ROS: got {text}"
    return re.sub(r", at /[^ ]*\.(c|cpp|h|hpp):\d+", "", text)


def _name_text(error: NameValidationException) -> str:
    # "Invalid namespace: namespace must not end with ...:\n  'head/'\n       ^"
    what, _, value = str(error).partition(":\n")
    return f"{what.partition(': ')[2]}: got {value.splitlines()[0].strip()}"


def _check_domain() -> None:
    text = os.environ.get("ROS_DOMAIN_ID", "")
    if text and not (re.fullmatch(r"[0-9]{1,9}", text) and int(text) <= LARGEST_DOMAIN_ID):
        raise StartError(f"ROS_DOMAIN_ID must be a whole number from 0 to {LARGEST_DOMAIN_ID}: got {text!r}")


def _ensure_home() -> None:
    """Give the logs of ROS a folder where HOME is not set, as in a service of the system."""
    if any(os.environ.get(name) for name in ("HOME", "ROS_HOME", "ROS_LOG_DIR")):
        return
    try:
        os.environ["HOME"] = pwd.getpwuid(os.getuid()).pw_dir
    except KeyError:  # a user without an entry
        os.environ["ROS_HOME"] = tempfile.gettempdir()


def _check_log_folder() -> None:
    places = (("ROS_LOG_DIR", ""), ("ROS_HOME", "log"), ("HOME", ".ros/log"))
    name, below = next(((name, below) for name, below in places if os.environ.get(name)), ("HOME", ""))
    folder = expanded(os.environ[name]) / below
    try:
        folder.mkdir(parents=True, exist_ok=True)
        reason = "" if os.access(folder, os.W_OK | os.X_OK) else os.strerror(errno.EACCES)
    except OSError as error:
        reason = error.strerror or str(error)
    if reason:
        text = f"{name} must be a folder in which logs can be written: got {os.environ[name]!r} ({folder}: {reason})"
        raise StartError(text + ("" if name == "ROS_LOG_DIR" else "; ROS_LOG_DIR may name another"))


def _check_names(arguments: Sequence[str]) -> None:
    for source, target in remaps(arguments):
        validate = _VALIDATED.get(source.rpartition(":")[2])
        if validate is None:
            continue
        try:
            validate(target)
        except NameValidationException as error:
            raise StartError(f"{_name_text(error)} (in -r {source}:={target})") from error
