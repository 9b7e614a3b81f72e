"""The arguments of every launch file: one table, and the check of their values before anything starts."""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from vergence_rig.regular_file import FileError, check_regular_file, expanded
from vergence_servo.drivers.registry import backend_names
from vergence_sim.heads import DEFAULT_MODEL, MODELS

TRUE_FALSE = ("true", "false")
_OF_LAUNCH_ITSELF = frozenset({"launch-prefix", "launch-prefix-filter"})


@dataclass(frozen=True)
class LaunchArgument:
    """One argument.

    Attributes:
        name: on the command line, `name:=value`.
        description: shown by `ros2 launch --show-args`.
        default: the value where none is given; None makes the argument required.
        choices: the only values allowed; empty allows any text.
        is_file: the value must be the path of an existing file, one of the choices where there are any, or empty where
            the default is empty.
        shipped: the default is the path of this file of the package's config folder.
    """

    name: str
    description: str
    default: str | None = ""
    choices: tuple[str, ...] = ()
    is_file: bool = False
    shipped: str = ""

    @property
    def required(self) -> bool:
        """True where a value must be given."""
        return self.default is None

    def help(self) -> str:
        """Return the description with the values allowed."""
        choices = self.choices + ("a path",) * self.is_file if self.choices else ()
        return f"{self.description} ({' or '.join(choices)})" if choices else self.description

    def default_in(self, config: Path) -> str | None:
        """Return the default, with the shipped configuration in `config`."""
        return str(config / self.shipped) if self.shipped else self.default

    def problem(self, value: str) -> str | None:
        """Return what is wrong with a value, or None."""
        if value in self.choices:
            return None
        if self.choices and not self.is_file:
            return f"{self.name} must be {_listed(self.choices)}: got {value!r}"
        if self.is_file and not (value == "" and self.default == ""):
            try:
                check_regular_file(value)
            except FileError as error:
                allowed = _listed((*self.choices, "the path of an existing file"))
                return f"{self.name} must be {allowed}: got {value!r}, which {error}"
        return None

    def read(self, text: str) -> str:
        """Return the value of a text of the command line: `~` expanded in paths, `True` and `TRUE` as `true`."""
        if self.is_file and text and text not in self.choices:
            return str(expanded(text))
        return text.lower() if self.choices == TRUE_FALSE and text.lower() in TRUE_FALSE else text


def _switch(name: str, description: str, default: str) -> LaunchArgument:
    return LaunchArgument(name, description, default, TRUE_FALSE)


def _file(name: str, description: str, default: str | None = "", shipped: str = "") -> LaunchArgument:
    return LaunchArgument(name, description, default, is_file=True, shipped=shipped)


_NAMESPACE = LaunchArgument("namespace", "namespace of all nodes of the head")
_RIG = _file("rig", "path of rig.yaml", shipped="rig.yaml")
_PROFILE = _file("fastdds_profile", "Fast DDS profile", shipped="fastdds.xml")
_ENCODER = _switch("encoder", "run eye_rotation_node, the visual encoder of the eyes' angles", "true")
_ATTEND = _switch("attend", "look at people, and what else is of interest, while no goal is active", "false")
_FRAMES = LaunchArgument(
    "frames",
    "run robot_state_publisher, which publishes the head's frames on tf; auto: where it is installed",
    "auto",
    ("auto", "true", "false"),
)
_WEB = (
    _switch("web", "run web_node, the page of the head for browsers, at http://localhost:8470", "false"),
    LaunchArgument(
        "web_address", "address that the page listens on; 0.0.0.0 for other machines, which need its token", "127.0.0.1"
    ),
)
_RANGE = LaunchArgument(
    "discovery_range",
    "how far nodes are discovered; the other machine must be in it",
    "SUBNET",
    ("SUBNET", "LOCALHOST", "SYSTEM_DEFAULT", "OFF"),
)
_BACKEND = "servo driver of the servos for which servos.yaml names none: " + ", ".join(backend_names())

_CAMERAS_AND_VISION = (
    LaunchArgument("left_device", "left camera: by-id path, serial, /dev/videoN or URL", None),
    LaunchArgument("right_device", "right camera: by-id path, serial, /dev/videoN or URL", None),
    LaunchArgument("left_camera_info_url", "calibration of the left camera: file:// or package:// YAML"),
    LaunchArgument("right_camera_info_url", "calibration of the right camera: file:// or package:// YAML"),
    _NAMESPACE,
    _RIG,
    _file("identified", "path of rig.nodes.yaml, written by vergence identify"),
    _switch("detector", "run box_metric_node; it needs onnxruntime", "false"),
    _file("model", "ONNX file of the detector; empty for the one of the simulator's cube"),
    _ATTEND,
    _switch("lock", "hold one exposure and white balance for both cameras", "true"),
    _switch(
        "composed", "run all nodes in one process, head_node: images pass in memory, which saves CPU time", "false"
    ),
    _ENCODER,
    _FRAMES,
    *_WEB,
    _PROFILE,
)

ARGUMENTS: dict[str, tuple[LaunchArgument, ...]] = {
    "sim.launch.py": (
        _NAMESPACE,
        _RIG,
        LaunchArgument("preset", "imperfections of head, cameras and servos", "realistic", ("realistic", "ideal")),
        LaunchArgument(
            "head",
            "head that is simulated, apart from the nodes' rig.yaml; rig is that rig.yaml, a path another one",
            DEFAULT_MODEL,
            MODELS,
            is_file=True,
        ),
        _switch(
            "detector", "run box_metric_node, whose detector finds the simulator's cube; needs onnxruntime", "true"
        ),
        _ATTEND,
        _ENCODER,
        _FRAMES,
        *_WEB,
        _switch(
            "use_sim_time",
            "simulated time: sim_node publishes /clock, which waits for the nodes that follow it",
            "false",
        ),
        _PROFILE,
    ),
    "rig.launch.py": (
        *_CAMERAS_AND_VISION,
        _file("servos", "path of your servos.yaml; without one NO SERVO MOVES (backend fake)"),
        LaunchArgument("backend", f"{_BACKEND}; empty for kernel_pwm with servos, fake without"),
        _switch("servo_node", "run servo_node on this machine; false where the servos are on another one", "true"),
    ),
    "laptop.launch.py": (*_CAMERAS_AND_VISION, _RANGE),
    "pi.launch.py": (
        _NAMESPACE,
        _RIG,
        _file("servos", "path of servos.yaml: channels and calibration", None),
        LaunchArgument("backend", _BACKEND, "kernel_pwm"),
        _file("params_file", "parameter file of servo_node", shipped="servo_node.yaml"),
        LaunchArgument("start", "servos at the start", "released", ("released", "last_pose")),
        _RANGE,
        _PROFILE,
    ),
}
"""The arguments of each launch file, by the file's name."""


def defaults(file: str, config: Path) -> dict[str, str]:
    """Return the default of every argument of a launch file that is not required."""
    found = {argument.name: argument.default_in(config) for argument in ARGUMENTS[file]}
    return {name: value for name, value in found.items() if value is not None}


def problems(file: str, values: Mapping[str, str]) -> list[str]:
    """Return one sentence for each value that a launch file cannot use; missing ones are not looked at."""
    found = [argument.problem(values[argument.name]) for argument in ARGUMENTS[file] if argument.name in values]
    return [problem for problem in found if problem is not None]


def unknown(file: str, argv: Sequence[str]) -> list[str]:
    """Return one sentence for each argument of a process's command line that the launch file does not have.

    Only the launch file that the command line names is checked: one that includes it may have arguments of its own.
    """
    if not any(Path(word).name == file for word in argv):
        return []
    known = [argument.name for argument in ARGUMENTS[file]]
    given = [word.split(":=", 1)[0] for word in argv if ":=" in word]
    return [
        f"{file} has no argument {name!r}{_suggestion(name, known)}: it has {', '.join(known)}"
        for name in given
        if name not in known and name not in _OF_LAUNCH_ITSELF
    ]


def _suggestion(name: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def _listed(choices: Sequence[str]) -> str:
    return ", ".join(choices[:-1]) + " or " * (len(choices) > 1) + choices[-1]
