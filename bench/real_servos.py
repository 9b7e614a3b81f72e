"""Servos as they come out of the box: what rig.yaml says of them is a data sheet's."""

from dataclasses import replace

import numpy as np

from vergence_rig.rig import Joints, Rig
from vergence_rig.servo import ServoSpec

SERVO_SPREAD = 0.2
"""Dead band and backlash are evenly up to this share more or less than described, the speed half of it."""


def real_servo(spec: ServoSpec, spread: float, random: np.random.Generator) -> ServoSpec:
    """Return a servo as it comes out of the box: its figures a seeded share off the data sheet's."""
    if spec.name == "ideal":
        return spec
    off = [1.0 + float(share) for share in random.uniform(-spread, spread, 3)]
    return spec.replaced(
        speed_rad_s=spec.speed_rad_s * (1.0 + 0.5 * (off[0] - 1.0)),
        dead_band_rad=spec.dead_band_rad * off[1],
        backlash_rad=spec.backlash_rad * off[2],
        command_latency_s=max(spec.command_latency_s + float(random.uniform(-0.005, 0.005)), 0.0),
    )


def with_real_servos(rig: Rig, random: np.random.Generator) -> Rig:
    """Return a head whose servos are each of its own figures; its driver is given those of `rig`."""
    return replace(
        rig,
        joints=Joints(
            *(replace(joint, servo=real_servo(joint.servo, SERVO_SPREAD, random)) for _, joint in rig.joints.items())
        ),
    )
