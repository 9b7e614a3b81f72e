"""A simulated head in lockstep: time stands unless it is stepped, so that a busy machine changes no result."""

from collections.abc import Callable

import numpy as np

from vergence.body import Array, JointAngles, Picture, Pixels
from vergence_metric.pairs.pairing import LEFT, RIGHT
from vergence_rig.camera import CameraModel
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_sim.clock_parameters import ClockParameters
from vergence_sim.real_time import Schedule
from vergence_sim.world import World

_SIDES = {"left": LEFT, "right": RIGHT}


class SimulatedBody:
    """A world of `vergence_sim` as a body.

    Args:
        world: a `Simulator`, or a `PhotoWorld` before photographs.
        rig: the description that controller and metric are given.
        latencies: simulated times that transport, measurement and commands take, as in simulated time with ROS.
    """

    can_move = True

    def __init__(self, world: World, rig: Rig, latencies: ClockParameters | None = None) -> None:
        self.world, self.rig = world, rig
        self._latencies = latencies or ClockParameters()
        self._schedule = Schedule(world.parameters, world.time_s)
        left, right = (world.calibrations[eye] for eye in _SIDES)
        self.cameras = (None if left is None else CameraModel(left), None if right is None else CameraModel(right))

    @property
    def time_s(self) -> float:
        """Simulated time [s], from 0."""
        return self.world.time_s

    def advance(self, duration_s: float) -> list[Picture | JointAngles]:
        """See Body."""
        arrived: list[Picture | JointAngles] = []
        end_s, world = self.world.time_s + duration_s, self.world
        while self._schedule.next_due_s() <= end_s:
            event = self._schedule.pop(self._schedule.next_due_s())
            if event.kind == "publish":
                stamp_ns, develop = _exposure(event.payload)
                arrived.append(Picture(_SIDES[event.eye], stamp_ns, develop()))
                continue
            world.advance_to(event.due_s)
            stamp_ns = round(world.time_s * 1e9)
            if event.kind == "joints":
                reported = world.joint_states()
                arrived.append(JointAngles(stamp_ns, np.array([reported[name] for name in JOINT_NAMES])))
            else:
                due_s = event.due_s + world.parameters.camera.latency_s + self._latencies.image_latency_s
                self._schedule.publish(event.eye, due_s, (stamp_ns, world.expose(event.eye)))
        world.advance_to(end_s)
        return arrived

    def command(self, joints_rad: Array) -> None:
        """See Body."""
        angles = dict(zip(JOINT_NAMES, joints_rad.tolist(), strict=True))
        self.world.command(angles, self.world.time_s + self._latencies.command_latency_s)

    def close(self) -> None:
        """See Body."""
        self.world.close()


def _exposure(payload: object) -> tuple[int, Callable[[], Pixels]]:
    assert isinstance(payload, tuple)
    return payload
