"""The target as the head sees it: the simulator's own pictures of an upright cube at arm's length, both eyes.

`Stage` shows cubes turned any way; here few faces are seen, the side ones narrow and dark, which is where the sides of
boxes are hardest to locate.
"""

import math
from collections.abc import Iterator

import numpy as np

from training.scenes import View
from vergence_rig.geometry import EyeAngles, from_version_vergence
from vergence_rig.rig import default_rig
from vergence_rig.testing.ideal_eyes import gaze_for_point
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator
from vergence_sim.truth import TrueBox

_NEAREST_M, _FARTHEST_M = 0.22, 1.6
_LEAST_SHARE, _GONE_SHARE = 0.35, 0.06
_UPRIGHT_SHARE = 0.5  # stands as the simulator puts it; the others are turned about the vertical


def head_views(seed: int, count: int) -> Iterator[View]:
    """Yield `count` renders of one world, the same for the same seed: pairs of eyes, one after the other."""
    rng = np.random.default_rng([seed, 11])
    simulator = Simulator(_parameters(rng, seed), default_rig())
    try:
        given = 0
        while given < count:
            for view in _pair(simulator, rng):
                if given < count:
                    given += 1
                    yield view
    finally:
        simulator.close()


def _parameters(rng: np.random.Generator, seed: int) -> SimParameters:
    return SimParameters.of(
        {
            "world.seed": seed,
            "seed": seed,
            "servo": "ideal",
            "head.model": "ideal" if rng.random() < 0.5 else "rolled",
            "world.light": float(np.exp(rng.uniform(math.log(0.4), math.log(1.4)))),
            "world.samples_per_pixel": int(rng.choice([0, 0, 0, 4])),
            "world.look_alikes": int(rng.integers(0, 5)),
        }
    )


def _pair(simulator: Simulator, rng: np.random.Generator) -> list[View]:
    """Return what the eyes see of one place of the target; none of an eye that sees too small a part of it."""
    turned = rng.random() >= _UPRIGHT_SHARE
    simulator.set_parameters(
        simulator.parameters.replaced(
            {
                "target.yaw_rad": float(rng.uniform(-math.pi, math.pi)) if turned else 0.0,
                "camera.noise_sigma": float(rng.uniform(0.5, 4.5)),
                "camera.jpeg_quality": int(rng.integers(75, 96)),
                "right_camera.gain": float(rng.uniform(0.8, 1.15)),
            }
        )
    )
    baseline_m = simulator.rig.baseline_m
    distance = float(np.exp(rng.uniform(math.log(_NEAREST_M), math.log(_FARTHEST_M))))
    point = distance * np.array([1.0, rng.uniform(-0.5, 0.5), rng.uniform(-0.35, 0.35)])
    simulator.place_target("cube", point)
    simulator.set_head(_about(gaze_for_point(point, baseline_m), rng).as_dict())
    frame = simulator.capture()
    views = []
    eyes = ("left", frame.left, frame.truth.left_visible_share), ("right", frame.right, frame.truth.right_visible_share)
    for eye, image, share in eyes:
        found = next((box for box in simulator.true_boxes(eye) if box.name == "cube"), None)
        if found is not None and share >= _LEAST_SHARE:
            views.append(_view(image, found, share))
        elif found is None or share < _GONE_SHARE:
            views.append(View(image, np.empty((0, 4)), np.empty(0), np.empty(0, bool), np.empty((0, 4))))
    return views


def _view(image: np.ndarray, box: TrueBox, share: float) -> View:
    sides = np.array([[box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px]])
    cuts = np.array([box.cut_left or box.cut_top or box.cut_right or box.cut_bottom])
    return View(image, sides, np.array([share]), cuts, np.empty((0, 4)))


def _about(eyes: EyeAngles, rng: np.random.Generator) -> EyeAngles:
    version, tilt = eyes.version_rad + rng.uniform(-0.35, 0.35), eyes.tilt_rad + rng.uniform(-0.25, 0.25)
    return from_version_vergence(version, max(eyes.vergence_rad + rng.uniform(-0.12, 0.12), 0.0), tilt)
