"""Which head is simulated: a rig of its own, apart from the rig.yaml that the other nodes are given."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from vergence_rig.parameters import Parameters, parameter
from vergence_rig.rig import CameraSpec, EyeMount, Joints, Rig
from vergence_rig.rig_file import load_rig
from vergence_sim.printed_head import printed_head

DEFAULT_MODEL = "printed"
"""The head that is simulated where none is named: equal to the shipped sim_node.yaml and photo_node.yaml."""
MODELS = ("printed", "rolled", "ideal", "rig")
"""The values of `head.model` that are no path."""

_ROLLED_DISTORTION = (-0.04, 0.02, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class HeadParameters(Parameters):
    """The head that is simulated, and what its cameras say of themselves."""

    model: str = parameter(
        DEFAULT_MODEL,
        "head that is simulated: printed (lenses off the axes, mounts turned, zeros and scales off; see head.seed), "
        "rolled (rig.yaml's baseline and cameras, lenses on the axes, cameras rolled and pitched by half a degree and "
        "with distortion), ideal (the same, square and without distortion), rig (all that rig.yaml says), or the path "
        "of another rig.yaml",
        read_only=True,
    )
    seed: int = parameter(0, "which printed head", minimum=0, maximum=2**31 - 1, read_only=True)
    camera_info: str = parameter(
        "calibrated",
        "calibration that the simulated cameras publish: of the cameras as they are (calibrated), rig.yaml's "
        "(nominal), or none, with a focal length of 0 as uncalibrated cameras do (none)",
        choices=("calibrated", "nominal", "none"),
        read_only=True,
    )


def simulated_head(parameters: HeadParameters, rig: Rig) -> Rig:
    """Return the head that is simulated where the other nodes are given `rig`. Raises RigError for a path of none.

    A built-in head has the joint limits, speeds and servos of `rig`.
    """
    if parameters.model == "rig":
        return rig
    if parameters.model == "printed":
        return _with_joints_of(printed_head(parameters.seed), rig)
    if parameters.model == "ideal":
        return ideal_head(rig)
    if parameters.model == "rolled":
        return rolled_head(rig)
    return load_rig(parameters.model)


def ideal_head(rig: Rig) -> Rig:
    """Return a head with a rig's baseline, cameras and servos: lenses on the axes, square, without distortion."""
    head = Rig(
        rig.baseline_m,
        rig.left_camera.replaced(distortion=(0.0,) * 5),
        rig.right_camera.replaced(distortion=(0.0,) * 5),
    )
    return _with_joints_of(head, rig)


def rolled_head(rig: Rig) -> Rig:
    """Return the ideal head with cameras that are rolled, pitched (the images are about 5 px apart) and distort."""
    return replace(
        ideal_head(rig),
        left_camera=rig.left_camera.replaced(distortion=_ROLLED_DISTORTION),
        right_camera=rig.right_camera.replaced(distortion=_ROLLED_DISTORTION),
        left_mount=EyeMount(roll_rad=-0.003),
        right_mount=EyeMount(roll_rad=0.006, pitch_rad=0.0093),
    )


def published_cameras(how: str, rig: Rig, head: Rig) -> Mapping[str, CameraSpec | None]:
    """Return what both cameras publish of themselves, by eye; None where they are not calibrated.

    Args:
        how: `HeadParameters.camera_info`.
        rig: that the other nodes are given.
        head: that is simulated.
    """
    described = {"calibrated": head, "nominal": rig}.get(how)
    return {eye: described.camera(eye == "left") if described is not None else None for eye in ("left", "right")}


def _with_joints_of(head: Rig, rig: Rig) -> Rig:
    """Return a head with the limits, speeds and servos of a rig's joints, but its own zeros and scales."""
    joints = (
        replace(described, zero_rad=own.zero_rad, scale=own.scale)
        for (_, own), (_, described) in zip(head.joints.items(), rig.joints.items(), strict=True)
    )
    return replace(head, joints=Joints(*joints), minimum_vergence_rad=rig.minimum_vergence_rad)
