"""photo_node's parameters: the photographs, the head before them, and how its servos differ from its description."""

from dataclasses import dataclass, replace

from vergence_rig.parameters import REQUIRED, Groups, ParameterError, Parameters, parameter
from vergence_rig.rig import Joints, Rig
from vergence_rig.servo import PRESETS, ServoSpec
from vergence_sim.camera_parameters import CameraParameters, RightCameraParameters
from vergence_sim.clock_parameters import ClockParameters
from vergence_sim.heads import HeadParameters
from vergence_sim.parameters import SimParameters, SimulationParameters
from vergence_sim.photo.pair import PhotoPoint


@dataclass(frozen=True)
class PhotoParameters(Parameters):
    """The photographs and the head before them."""

    left: str = parameter(
        REQUIRED, "path of the left photograph of a rectified stereo pair (JPEG, PNG, ...)", read_only=True
    )
    right: str = parameter(REQUIRED, "path of the right photograph, of the same size as the left one", read_only=True)
    fx_px: float = parameter(
        0.0,
        "focal length of both photographs; 0 for 0.85 times their width. Any value shows a consistent scene",
        unit="px",
        minimum=0,
        maximum=1e5,
        read_only=True,
    )
    cx_px: float = parameter(
        0.0,
        "x of the photographs' principal point; 0 for their centre",
        unit="px",
        minimum=-1e5,
        maximum=1e5,
        read_only=True,
    )
    cy_px: float = parameter(
        0.0,
        "y of the photographs' principal point; 0 for their centre",
        unit="px",
        minimum=-1e5,
        maximum=1e5,
        read_only=True,
    )
    view_width_px: int = parameter(
        480,
        "width of the published images: those of rig.yaml's cameras, cut about their centres, so that a photograph "
        "fills them at more poses; 0 for rig.yaml's",
        unit="px",
        minimum=0,
        maximum=16384,
        read_only=True,
    )
    view_height_px: int = parameter(
        320,
        "height of the published images; 0 for that of rig.yaml's cameras",
        unit="px",
        minimum=0,
        maximum=16384,
        read_only=True,
    )
    points_px: tuple[float, ...] = parameter(
        (),
        "points of known depth: x and y in the left photograph and disparity x_left - x_right, three numbers a point",
        unit="px",
        minimum=-1e5,
        maximum=1e5,
        read_only=True,
    )
    rays_px: tuple[float, ...] = parameter(
        (),
        "points of unknown depth: x and y in the left photograph, two numbers a point. The truth about them is the "
        "left eye's; what needs their disparity is NaN",
        unit="px",
        minimum=-1e5,
        maximum=1e5,
        read_only=True,
    )
    point: int = parameter(
        0,
        "number of the point that ground_truth/* is about, from 0: those of points_px, then those of rays_px",
        minimum=0,
        maximum=100000,
    )
    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    preset: str = parameter(
        "realistic",
        "realistic: imperfections as the other parameters say; ideal: ideal head, servos and cameras whatever they say",
        choices=("realistic", "ideal"),
        read_only=True,
    )
    seed: int = parameter(
        0, "seed of sensor noise and of exposure jitter", minimum=0, maximum=2**31 - 1, read_only=True
    )
    joint_rate_hz: float = parameter(
        50.0, "rate at which joint_states is published", unit="Hz", minimum=1, maximum=1000, read_only=True
    )

    def check(self) -> None:
        """Hold the points to whole triples and pairs."""
        if len(self.points_px) % 3:
            raise ParameterError("points_px", self.points_px, "three numbers, x y disparity, for every point")
        if len(self.rays_px) % 2:
            raise ParameterError("rays_px", self.rays_px, "two numbers, x y, for every point")

    @property
    def points(self) -> tuple[PhotoPoint, ...]:
        """The points whose depth is known, then those of which only the left eye's ray is."""
        known, rays = self.points_px, self.rays_px
        return (
            *(PhotoPoint(*known[i : i + 3]) for i in range(0, len(known), 3)),
            *(PhotoPoint(*rays[i : i + 2]) for i in range(0, len(rays), 2)),
        )


@dataclass(frozen=True)
class PlantParameters(Parameters):
    """The servos as they really are; joint_states is what a driver publishes that has only rig.yaml."""

    servo: str = parameter(
        "rig",
        "servos that really turn the head: its own, those of rig.yaml for a built-in head (rig), or all of one kind",
        choices=("rig", *PRESETS),
        read_only=True,
    )
    dead_band_scale: float = parameter(
        1.0, "real dead band of every servo, as a multiple of the described one", minimum=0, maximum=20, read_only=True
    )
    speed_scale: float = parameter(
        1.0, "real speed of every servo, as a multiple of the described one", minimum=0.01, maximum=20, read_only=True
    )

    def fitted(self, head: Rig) -> Rig:
        """Return a head with the servos that these describe; its joint limits stay."""
        return replace(head, joints=Joints(*(replace(j, servo=self._servo(j.servo)) for _, j in head.joints.items())))

    def _servo(self, described: ServoSpec) -> ServoSpec:
        servo = described if self.servo == "rig" else PRESETS[self.servo]
        return servo.replaced(
            dead_band_rad=servo.dead_band_rad * self.dead_band_scale, speed_rad_s=servo.speed_rad_s * self.speed_scale
        )


GROUPS: Groups = (
    ("", PhotoParameters),
    ("head.", HeadParameters),
    ("plant.", PlantParameters),
    ("camera.", CameraParameters),
    ("right_camera.", RightCameraParameters),
    ("clock.", ClockParameters),
)


def sim_parameters(
    photo: PhotoParameters, head: HeadParameters, camera: CameraParameters, right: RightCameraParameters
) -> SimParameters:
    """Return the head and the cameras' imperfections as the simulator's parts take them, the preset applied."""
    simulation = SimulationParameters(
        rig=photo.rig, preset=photo.preset, seed=photo.seed, joint_rate_hz=photo.joint_rate_hz
    )
    return SimParameters(simulation=simulation, head=head, camera=camera, right_camera=right).effective()
