"""The parameters of servo_node."""

from dataclasses import dataclass

from vergence_rig.parameters import Groups, ParameterError, parameter
from vergence_servo.drivers.registry import BACKENDS, check_name
from vergence_servo.servo_head import HeadParameters


@dataclass(frozen=True)
class ServoNodeParameters(HeadParameters):
    """Backend, files, rates and guards; time-outs and parking come from HeadParameters."""

    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    servos: str = parameter("", "path of servos.yaml; empty for the built-in one, with 'fake' only", read_only=True)
    backend: str = parameter(
        "fake", "what makes the pulses: " + ", ".join(BACKENDS) + "; 'fake' moves nothing", read_only=True
    )
    joints: tuple[str, ...] = parameter(
        ("pan_left", "pan_right", "tilt"), "the joints driven here, in the order of ~/commands", read_only=True
    )
    enabled: bool = parameter(True, "take commands from the start; else wait for ~/enable", read_only=True)
    start: str = parameter(
        "released",
        "limp until the first command, or held at the last known pose",
        choices=("released", "last_pose"),
        read_only=True,
    )
    pose_file: str = parameter(
        "", "where the last pose is kept; empty for vergence_servo_pose.json in ROS_HOME", read_only=True
    )
    guardian: bool = parameter(
        True, "a second process releases the servos if this one is killed (backends that outlive it)", read_only=True
    )
    update_rate_hz: float = parameter(
        100.0, "how often pulses follow a move", unit="Hz", minimum=10, maximum=1000, read_only=True
    )
    state_rate_hz: float = parameter(
        50.0, "how often joint_states is published", unit="Hz", minimum=1, maximum=500, read_only=True
    )
    command_max_age_s: float = parameter(
        0.5, "older stamps are refused; 0 leaves stamps unchecked", unit="s", minimum=0, maximum=3600
    )
    command_max_ahead_s: float = parameter(
        0.1, "stamps further ahead of this clock are refused", unit="s", minimum=0, maximum=3600
    )
    trajectory_max_s: float = parameter(
        60.0, "trajectories that would end later than this from now are refused", unit="s", minimum=0.1, maximum=3600
    )

    def check(self) -> None:
        """Refuse backends by name, and the built-in servos with real ones."""
        super().check()
        check_name(self.backend)
        if not self.servos and self.backend != "fake":
            allowed = f"the path of your servos.yaml with backend '{self.backend}': the channels are your wiring's"
            raise ParameterError("servos", self.servos, allowed)
        if not self.joints or len(set(self.joints)) != len(self.joints):
            raise ParameterError("joints", self.joints, "one or more names, each once")
        if len(self.park_rad) != len(self.joints):
            raise ParameterError("park_rad", self.park_rad, f"{len(self.joints)} angles, in the order of joints")


GROUPS: Groups = (("", ServoNodeParameters), *((f"{name}.", parameters) for name, (parameters, _) in BACKENDS.items()))
