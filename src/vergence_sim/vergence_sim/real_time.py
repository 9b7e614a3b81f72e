"""When each eye exposes and when its image is published: free-running clocks, jitter, latency. It never sleeps."""

import heapq
import itertools
from dataclasses import dataclass, field

import numpy as np

from vergence_sim.parameters import SimParameters


@dataclass(order=True)
class Event:
    """Something due at `due_s`: "expose" or "publish" of an eye, or "joints"."""

    due_s: float
    order: int
    kind: str = field(compare=False)
    eye: str = field(compare=False, default="")
    payload: object = field(compare=False, default=None)


_LATEST_JOINTS_S = 1.0


class Schedule:
    """Events in order of time. An exposure that is a whole period late is dropped and counted.

    Joint states are published for every period, however late: they cost nothing, and the angles at an image's stamp
    are interpolated between them.
    """

    def __init__(self, parameters: SimParameters, start_s: float) -> None:
        self._rng = np.random.default_rng(np.random.SeedSequence(parameters.simulation.seed).spawn(3)[2])
        self._count = itertools.count()
        self._events: list[Event] = []
        period_s, right = 1.0 / parameters.camera.frame_rate_hz, parameters.right_camera
        self._periods_s = {"left": period_s, "right": period_s * (1.0 + right.clock_drift)}
        self._beats_s = {"left": start_s, "right": start_s + right.clock_offset_s % period_s}
        self._joint_period_s = 1.0 / parameters.simulation.joint_rate_hz
        self.dropped = 0
        self._jitter_s = parameters.camera.frame_jitter_s
        for eye in self._beats_s:
            self._expose(eye)
        self._push(start_s, "joints")

    def next_due_s(self) -> float:
        """Return when the next event is due."""
        return self._events[0].due_s

    def pop(self, now_s: float) -> Event:
        """Remove and return the next event, and schedule its successor; `now_s` says how late it is."""
        event = heapq.heappop(self._events)
        if event.kind == "expose":
            while self._beats_s[event.eye] < now_s - self._periods_s[event.eye]:
                self.dropped += 1
                self._beats_s[event.eye] += self._periods_s[event.eye]
            self._expose(event.eye)
        elif event.kind == "joints":
            self._push(max(event.due_s + self._joint_period_s, now_s - _LATEST_JOINTS_S), "joints")
        return event

    def publish(self, eye: str, due_s: float, payload: object) -> None:
        """Schedule the publication of an image at `due_s`."""
        self._push(due_s, "publish", eye, payload)

    def set_jitter(self, jitter_s: float) -> None:
        """Change the deviation of exposures from an even beat."""
        self._jitter_s = jitter_s

    def _expose(self, eye: str) -> None:
        beat_s = self._beats_s[eye]
        # Bounded at a tenth of the period, so that exposures of one eye stay in order.
        bound_s = 0.1 * self._periods_s[eye]
        jitter_s = float(np.clip(self._rng.normal(0.0, self._jitter_s), -bound_s, bound_s)) if self._jitter_s else 0.0
        self._push(beat_s + jitter_s, "expose", eye)
        self._beats_s[eye] = beat_s + self._periods_s[eye]

    def _push(self, due_s: float, kind: str, eye: str = "", payload: object = None) -> None:
        heapq.heappush(self._events, Event(due_s, next(self._count), kind, eye, payload))
