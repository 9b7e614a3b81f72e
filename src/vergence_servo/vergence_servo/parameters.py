"""The parameters of servo_node."""

from dataclasses import dataclass

from vergence_rig.parameters import Groups, ParameterError, parameter
from vergence_servo.drivers.registry import REFUSED, backend_names, backends, find_backend
from vergence_servo.servo_channel import RetryParameters
from vergence_servo.servo_head import HeadParameters


@dataclass(frozen=True)
class ServoNodeParameters(HeadParameters):
    """Backend, files, rates and limits of commands; time-outs and parking are those of HeadParameters."""

    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    servos: str = parameter(
        "", "path of servos.yaml; empty for the built-in servos, with backend 'fake' only", read_only=True
    )
    backend: str = parameter(
        "fake",
        "servo driver of the servos for which servos.yaml names none; 'fake' moves no servo",
        choices=backend_names,
        read_only=True,
    )
    joints: tuple[str, ...] = parameter(
        ("pan_left", "pan_right", "tilt"),
        "joints that this node drives, in the order of the values on ~/commands",
        read_only=True,
    )
    enabled: bool = parameter(
        True, "accept commands from the start; false refuses them until ~/enable is called", read_only=True
    )
    start: str = parameter(
        "released",
        "state of the servos until the first command: 'released' sends no pulses, 'last_pose' holds the last pose",
        choices=("released", "last_pose"),
        read_only=True,
    )
    pose_file: str = parameter(
        "", "file in which the last pose is kept; empty for vergence_servo_pose.json in ROS_HOME", read_only=True
    )
    guardian: bool = parameter(
        True,
        "start a second process that releases the servos if this one is killed (backends that would go on pulsing)",
        read_only=True,
    )
    guardian_timeout_s: float = parameter(
        1.0,
        "time for which this node may hang before the guardian releases the servos",
        unit="s",
        minimum=0.2,
        maximum=60,
        read_only=True,
    )
    update_rate_hz: float = parameter(
        100.0, "rate at which pulses are sent along a motion", unit="Hz", minimum=10, maximum=1000, read_only=True
    )
    state_rate_hz: float = parameter(
        50.0,
        "rate at which joint_states is published; at most 10 Hz while no servo has moved for 0.2 s",
        unit="Hz",
        minimum=1,
        maximum=500,
        read_only=True,
    )
    command_max_age_s: float = parameter(
        0.5,
        "largest age of a command's stamp, older commands are refused; 0 accepts every stamp",
        unit="s",
        minimum=0,
        maximum=3600,
    )
    command_max_ahead_s: float = parameter(
        0.1,
        "a command whose stamp is further ahead of this machine's clock is refused",
        unit="s",
        minimum=0,
        maximum=3600,
    )
    trajectory_max_s: float = parameter(
        60.0,
        "a trajectory that would end later than this from now is refused, since no time-out applies during it",
        unit="s",
        minimum=0.1,
        maximum=3600,
    )

    def __post_init__(self) -> None:
        if isinstance(self.backend, str) and self.backend in REFUSED:
            find_backend(self.backend)  # its error has the reason, which that of the choices has not
        super().__post_init__()

    def check(self) -> None:
        """Refuse the built-in servos with a driver that moves real ones, and lists that do not match."""
        super().check()
        if not self.servos and find_backend(self.backend).moves_servos:
            allowed = f"the path of your servos.yaml with backend '{self.backend}', whose channels are your wiring's"
            raise ParameterError("servos", self.servos, allowed)
        if not self.joints or len(set(self.joints)) != len(self.joints):
            raise ParameterError("joints", self.joints, "a list of one or more names without repeats")
        if len(self.park_rad) != len(self.joints):
            raise ParameterError(
                "park_rad", self.park_rad, f"a list of {len(self.joints)} angles, in the order of joints"
            )


def parameter_groups() -> Groups:
    """Return the groups with those of every driver registered by now."""
    own: Groups = (("", ServoNodeParameters), ("retry.", RetryParameters))
    return own + tuple((f"{entry.name}.", entry.parameters) for entry in backends())


GROUPS: Groups = parameter_groups()
"""The groups with the shipped drivers; the node reads `parameter_groups()`."""
