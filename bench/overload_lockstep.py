"""The lockstep of photographs on a machine with too little CPU: pairs take long, and those that arrive meanwhile wait.

As in the nodes, only the newest pair is measured next; one that a newer pair replaces is dropped. Control cycles are
late by a period now and then.
"""

from typing import Any

from bench.photos_lockstep import CONTROL_PERIOD_S, PROCESSING_S, Image, Lockstep, pair_of
from vergence_rig.rig import Rig
from vergence_sim.world import EYES, World

_LATE_EVERY = 3  # control cycles of which one comes a period late


class OverloadedLockstep(Lockstep):
    """A lockstep whose metric takes `slowness` times as long for a pair as one that keeps up at its frame rate."""

    def __init__(self, world: World, rig: Rig, slowness: float = 2.0) -> None:
        super().__init__(world, rig)
        frame_s = 1.0 / world.parameters.camera.frame_rate_hz
        self._measuring_s = slowness * frame_s
        self._free_s = world.time_s
        self._newest: tuple[tuple[float, Image], tuple[float, Image]] | None = None
        self._cycles = 0
        self.dropped = 0

    def _publish(self, eye: str, exposed_s: float, develop: Any) -> None:
        self._frames[eye].append((exposed_s, develop()))
        if eye == "left":
            self.newest_published_s = exposed_s
        if not all(self._frames.values()):
            return
        left, right = (self._frames[one].pop(0) for one in EYES)
        self.dropped += self._newest is not None
        self._newest = left, right
        now_s = max(left[0], right[0]) + self.world.parameters.camera.latency_s
        if now_s >= self._free_s:
            self._measure(now_s)

    def _measure(self, now_s: float) -> None:
        assert self._newest is not None
        (left_s, left), (right_s, right) = self._newest
        self._newest = None
        seen = self.metric.observe(pair_of(left, right, left_s, right_s))
        self._free_s = now_s + self._measuring_s
        self._arrive(now_s + max(self._measuring_s, PROCESSING_S), seen, left_s)

    def _control(self) -> None:
        super()._control()
        self._cycles += 1
        if self._cycles % _LATE_EVERY == 0:
            self._next_step_s += CONTROL_PERIOD_S
