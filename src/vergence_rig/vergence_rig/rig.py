"""The rig: baseline, cameras, joints and limits, as rig.yaml describes them.

Every part is a frozen dataclass that validates itself; errors name the key, what it must be, and the value.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from vergence_rig.camera_limits import COEFFICIENTS, CameraLimitError, check_camera
from vergence_rig.parameters import ParameterError, Parameters, parameter, shown
from vergence_rig.servo import MG995, SG90, ServoSpec

JOINT_NAMES = ("pan_left", "pan_right", "tilt")
"""The three joints, in the order that commands carry them."""

_DEG = math.pi / 180.0


class RigError(ValueError):
    """An invalid rig description: the message names the key, what it must be, and the value."""


@dataclass(frozen=True)
class CameraSpec(Parameters):
    """One camera: image size, intrinsics and distortion in OpenCV's order (k1 k2 p1 p2 k3 ...)."""

    width_px: int = parameter(640, "image width", unit="px", minimum=16, maximum=16384)
    height_px: int = parameter(480, "image height", unit="px", minimum=16, maximum=16384)
    fx_px: float = parameter(539.0, "focal length along x", unit="px", minimum=1, maximum=1e5)
    fy_px: float = parameter(539.0, "focal length along y", unit="px", minimum=1, maximum=1e5)
    cx_px: float = parameter(319.5, "principal point, x", unit="px", minimum=-1e5, maximum=1e5)
    cy_px: float = parameter(239.5, "principal point, y", unit="px", minimum=-1e5, maximum=1e5)
    distortion: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0, 0.0, 0.0),
        "distortion coefficients in OpenCV's order, k1 k2 p1 p2 k3 ...",
        minimum=-100,
        maximum=100,
    )

    def check(self) -> None:
        """See Parameters."""
        if len(self.distortion) not in COEFFICIENTS["plumb_bob"]:
            allowed = "a list of five numbers (k1 k2 p1 p2 k3), or of 0, 4, 8, 12 or 14 in OpenCV's order"
            raise ParameterError("distortion", self.distortion, allowed)
        try:
            check_camera(
                self.width_px,
                self.height_px,
                (self.fx_px, self.fy_px, self.cx_px, self.cy_px),
                self.distortion,
                "plumb_bob",
            )
        except CameraLimitError as error:
            name = error.name if error.name == "distortion" else f"{error.name}_px"
            allowed = error.allowed.removeprefix("be ")
            raise ParameterError(name, getattr(self, name), allowed) from error


@dataclass(frozen=True)
class EyeMount(Parameters):
    """Where one eye's pan axis stands on the tilt bar, and its lens in the frame that the pan axis turns.

    The pan axis crosses `rig_base` at zero tilt at (axis_x_m, +-baseline_m / 2, axis_z_m). The pan frame has x forward,
    y left, z up at pan 0, its origin on the axis; the lens is the camera's optical centre. The camera is turned by
    roll, then pitch, then yaw about the fixed axes of the pan frame: roll > 0 lowers its right side, pitch > 0 looks
    down, yaw > 0 looks left.
    """

    axis_x_m: float = parameter(0.0, "pan axis, forward of rig_base", unit="m", minimum=-1, maximum=1)
    axis_z_m: float = parameter(0.0, "height above rig_base where the pan axis is", unit="m", minimum=-1, maximum=1)
    lens_x_m: float = parameter(0.0, "lens, forward of its pan axis", unit="m", minimum=-1, maximum=1)
    lens_y_m: float = parameter(0.0, "lens, left of its pan axis", unit="m", minimum=-1, maximum=1)
    lens_z_m: float = parameter(0.0, "lens, above the pan frame's origin", unit="m", minimum=-1, maximum=1)
    roll_rad: float = parameter(
        0.0, "roll of the camera, > 0 lowers its right side", unit="rad", minimum=-0.5, maximum=0.5
    )
    pitch_rad: float = parameter(0.0, "pitch of the camera, > 0 looks down", unit="rad", minimum=-0.5, maximum=0.5)
    yaw_rad: float = parameter(0.0, "yaw of the camera, > 0 looks left", unit="rad", minimum=-0.5, maximum=0.5)


@dataclass(frozen=True)
class JointSpec:
    """One joint: its limits, the largest commanded speed, its servo, and how far its axis turns.

    Limits and speed are the joint's own, as joint_states and commands carry them. The axis stands at
    `zero_rad + scale * joint`: a horn sits a few degrees off, a servo turns a few per cent more than it is commanded.
    """

    lower_rad: float
    upper_rad: float
    max_speed_rad_s: float
    servo: ServoSpec
    zero_rad: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        _check_number("zero_rad", self.zero_rad, -0.5, 0.5, "rad")
        _check_number("scale", self.scale, 0.5, 2.0, "1")
        half_turn = math.pi
        _check_number("lower_rad", self.lower_rad, -half_turn, half_turn, "rad")
        _check_number("upper_rad", self.upper_rad, -half_turn, half_turn, "rad")
        _check_number("max_speed_rad_s", self.max_speed_rad_s, 1e-3, 1e3, "rad/s")
        if self.lower_rad >= self.upper_rad:
            raise RigError(f"upper_rad must be more than lower_rad, {self.lower_rad!r} [rad]: got {self.upper_rad!r}")

    def axis_rad(self, joint_rad: float) -> float:
        """Return the angle of the axis [rad] at an angle of the joint [rad]."""
        return self.zero_rad + self.scale * joint_rad

    def joint_rad(self, axis_rad: float) -> float:
        """Return the joint's angle [rad] at which the axis stands at an angle [rad]; the inverse of `axis_rad`."""
        return (axis_rad - self.zero_rad) / self.scale

    def clamp(self, angle_rad: float) -> float:
        """Return the angle [rad] held within the joint's limits."""
        return min(max(angle_rad, self.lower_rad), self.upper_rad)

    @property
    def speed_rad_s(self) -> float:
        """The speed that both the limit and the servo allow [rad/s]."""
        return min(self.max_speed_rad_s, self.servo.speed_rad_s)


def _pan(servo: ServoSpec = SG90) -> JointSpec:
    return JointSpec(-60.0 * _DEG, 60.0 * _DEG, 600.0 * _DEG, servo)


def _tilt(servo: ServoSpec = MG995) -> JointSpec:
    return JointSpec(-45.0 * _DEG, 45.0 * _DEG, 300.0 * _DEG, servo)


@dataclass(frozen=True)
class Joints:
    """The three joints: two pan servos on top of a tilt bar."""

    pan_left: JointSpec = field(default_factory=_pan)
    pan_right: JointSpec = field(default_factory=_pan)
    tilt: JointSpec = field(default_factory=_tilt)

    def __getitem__(self, name: str) -> JointSpec:
        if name not in JOINT_NAMES:
            raise KeyError(name)
        spec: JointSpec = getattr(self, name)
        return spec

    def items(self) -> tuple[tuple[str, JointSpec], ...]:
        """Return (name, joint) in the order of JOINT_NAMES."""
        return tuple((name, self[name]) for name in JOINT_NAMES)


@dataclass(frozen=True)
class Rig:
    """A binocular head: pan axes at y = +-baseline_m / 2 of `rig_base`, on top of one bar that tilts about y.

    The tilt axis passes (tilt_axis_x_m, 0, tilt_axis_z_m). `zero_sigma_rad` is the standard deviation of each pan's
    zero and yaw together: distances by the joints are as uncertain, and commands may diverge by as much.
    `baseline_sigma_m` is that of the distance between the lenses: distances are as uncertain, relatively.
    """

    baseline_m: float = 0.065
    left_camera: CameraSpec = field(default_factory=CameraSpec)
    right_camera: CameraSpec = field(default_factory=CameraSpec)
    joints: Joints = field(default_factory=Joints)
    minimum_vergence_rad: float = 0.0
    left_mount: EyeMount = field(default_factory=EyeMount)
    right_mount: EyeMount = field(default_factory=EyeMount)
    tilt_axis_x_m: float = 0.0
    tilt_axis_z_m: float = 0.0
    zero_sigma_rad: float = 0.0
    baseline_sigma_m: float = 0.0

    def __post_init__(self) -> None:
        _check_number("baseline_m", self.baseline_m, 1e-3, 10.0, "m")
        _check_number("zero_sigma_rad", self.zero_sigma_rad, 0.0, 0.2, "rad")
        _check_number("baseline_sigma_m", self.baseline_sigma_m, 0.0, 0.1, "m")
        _check_number("tilt_axis_x_m", self.tilt_axis_x_m, -1.0, 1.0, "m")
        _check_number("tilt_axis_z_m", self.tilt_axis_z_m, -1.0, 1.0, "m")
        _check_number("minimum_vergence_rad", self.minimum_vergence_rad, 0.0, 0.5 * math.pi, "rad")
        widest_rad = self.pan_right.upper_rad - self.pan_left.lower_rad
        if self.minimum_vergence_rad >= widest_rad:
            raise RigError(
                f"minimum_vergence_rad must be less than the pan joints can reach, {widest_rad:g} [rad]: "
                f"got {self.minimum_vergence_rad!r}"
            )

    @property
    def pan_left(self) -> JointSpec:
        """The left eye's pan joint."""
        return self.joints.pan_left

    @property
    def pan_right(self) -> JointSpec:
        """The right eye's pan joint."""
        return self.joints.pan_right

    @property
    def tilt(self) -> JointSpec:
        """The joint of the bar that carries both eyes."""
        return self.joints.tilt

    @property
    def zero_error_rad(self) -> float:
        """Largest error of the vergence that the pans' zeros leave [rad]."""
        return 3.0 * math.sqrt(2.0) * self.zero_sigma_rad

    @property
    def least_vergence_rad(self) -> float:
        """Smallest vergence that may be asked for [rad]: the minimum, as far as the zeros are known."""
        return self.minimum_vergence_rad - self.zero_error_rad

    @property
    def mean_pitch_rad(self) -> float:
        """Mean pitch of both cameras on their pan axes [rad]."""
        return 0.5 * (self.left_mount.pitch_rad + self.right_mount.pitch_rad)

    def mount(self, left: bool) -> EyeMount:
        """Return one eye's mount."""
        return self.left_mount if left else self.right_mount

    def camera(self, left: bool) -> CameraSpec:
        """Return one eye's camera."""
        return self.left_camera if left else self.right_camera

    def eye_angles(self, joints_rad: Sequence[float]) -> tuple[float, float, float]:
        """Return pan_left, pan_right and tilt of the optical axes [rad] at angles of the joints (as JOINT_NAMES).

        A pan is its axis's angle and the camera's yaw together. Without zeros, scales and yaws they are the joints'.
        """
        left, right, tilt = (self.eye_angle(name, rad) for name, rad in zip(JOINT_NAMES, joints_rad, strict=True))
        return left, right, tilt

    def eye_angle(self, name: str, joint_rad: float) -> float:
        """Return the angle of one joint's optical axis [rad], as `eye_angles`."""
        axis_rad = self.joints[name].axis_rad(joint_rad)
        if name == "tilt":
            return axis_rad
        return axis_rad + (self.left_mount if name == "pan_left" else self.right_mount).yaw_rad

    def joint_angles(self, eyes_rad: Sequence[float]) -> tuple[float, float, float]:
        """Return the angles of the joints [rad] at angles of the optical axes; the inverse of `eye_angles`."""
        left, right, tilt = eyes_rad
        return (
            self.pan_left.joint_rad(left - self.left_mount.yaw_rad),
            self.pan_right.joint_rad(right - self.right_mount.yaw_rad),
            self.tilt.joint_rad(tilt),
        )

    def in_eye_angles(self) -> "Rig":
        """Return the same head with its eye angles as joints: limits, speeds, servos in them; no zero, scale, yaw."""
        lower = self.eye_angles([joint.lower_rad for _, joint in self.joints.items()])
        upper = self.eye_angles([joint.upper_rad for _, joint in self.joints.items()])
        joints = (
            replace(
                joint,
                lower_rad=low,
                upper_rad=high,
                max_speed_rad_s=joint.scale * joint.max_speed_rad_s,
                servo=joint.servo.scaled(joint.scale),
                zero_rad=0.0,
                scale=1.0,
            )
            for (_, joint), low, high in zip(self.joints.items(), lower, upper, strict=True)
        )
        mounts = (_without_yaw(self.left_mount), _without_yaw(self.right_mount))
        return replace(self, joints=Joints(*joints), left_mount=mounts[0], right_mount=mounts[1])

    def with_servos(self, pan: ServoSpec, tilt: ServoSpec | None = None) -> "Rig":
        """Return the same rig with other servos (`tilt`: the pans' if not given) and speed limits to match."""
        tilt = pan if tilt is None else tilt
        return replace(
            self,
            joints=Joints(
                *(
                    replace(joint, max_speed_rad_s=servo.speed_rad_s, servo=servo)
                    for joint, servo in ((self.pan_left, pan), (self.pan_right, pan), (self.tilt, tilt))
                )
            ),
        )


def _without_yaw(mount: EyeMount) -> EyeMount:
    """Return the mount in a pan frame that is turned with the camera."""
    cos, sin = math.cos(mount.yaw_rad), math.sin(mount.yaw_rad)
    x_m, y_m = mount.lens_x_m, mount.lens_y_m
    return replace(mount, lens_x_m=cos * x_m + sin * y_m, lens_y_m=cos * y_m - sin * x_m, yaw_rad=0.0)


def default_rig() -> Rig:
    """Return the built-in rig, equal to config/rig.yaml."""
    return Rig()


def _check_number(key: str, value: float, minimum: float, maximum: float, unit: str) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not minimum <= value <= maximum:
        raise RigError(f"{key} must be a number from {minimum:g} to {maximum:g} [{unit}]: got {shown(value)}")
