"""The head of the closed-loop benchmarks: the default simulated one, and what metric and controller know of it."""

from collections.abc import Callable, Mapping
from functools import cache, lru_cache

from bench.geometry_heads import found_rig, identify_head
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import JOINT_NAMES, Rig, default_rig
from vergence_sim.heads import HeadParameters, simulated_head


def simulated(rig: Rig) -> Rig:
    """Return the default simulated head, with the servos and joint limits of `rig`."""
    return simulated_head(HeadParameters(), rig)


def identify(say: Callable[[str], None]) -> None:
    """Run `vergence identify` for the default simulated head, once; for `identified` in this and other processes."""
    say("identifying the head")
    _identify_once()


@cache
def _identify_once() -> None:
    identify_head(HeadParameters().seed)


def identified() -> Rig:
    """Return what `identify` found of the default simulated head, its cameras without a calibration."""
    return found_rig(HeadParameters().seed)


@lru_cache(maxsize=1)
def kinematics() -> Kinematics:
    """Return the kinematics of the default simulated head."""
    return Kinematics(simulated(default_rig()))


def joints_of(head: Rig, eyes_rad: EyeAngles | Mapping[str, float]) -> dict[str, float]:
    """Return the joints [rad] by name at which a head's eyes stand at angles, given as EyeAngles or by name."""
    named = eyes_rad.as_dict() if isinstance(eyes_rad, EyeAngles) else eyes_rad
    joints = head.joint_angles([named[name] for name in JOINT_NAMES])
    return dict(zip(JOINT_NAMES, joints, strict=True))
