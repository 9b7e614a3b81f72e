"""What is looked at without a goal: the most interesting object in view, with glances at others, or nothing.

Policies, named as in PAL's attention manager:

| policy | looks at |
|---|---|
| social | an object of the most interesting class in view, with glances at others; scans the room where there is none |
| focused | one object until it is gone, without glances and whatever comes |
| random | places anywhere in reach |
| disabled | nothing: the eyes hold still |

Which one of several objects of a class is the detector's choice (`follow.policy` of box_metric_node).
"""

import math
from dataclasses import dataclass

from vergence_gaze.attention_parameters import FOCUSED, RANDOM, SOCIAL, AttentionParameters
from vergence_gaze.estimation.observations import BoxSighting

_ARRIVAL_S = 1.5  # a glance that has not arrived by then ends all the same
_BLIND_S = 2.0  # without results of a detector, after which there is nothing to scan for
_STEADY_S = 0.25  # an object that has been seen for less may be a detector's mistake


@dataclass(frozen=True)
class Focus:
    """An object to look at: one of a class that the detector chooses, or this one; and why."""

    class_name: str
    object_id: int = 0
    reason: str = ""


@dataclass(frozen=True)
class _Glance:
    """A look at another object and back to `home_id` of `home_class`; `until_s` is known once the eyes are there."""

    home_class: str
    home_id: int
    since_s: float
    until_s: float = math.inf


@dataclass(frozen=True)
class _Seen:
    """An object in view: its class, and when it was seen first and last."""

    class_name: str
    first_s: float
    last_s: float


class AttentionManager:
    """Keeps the objects in view and the present focus. Times are the caller's, in seconds."""

    def __init__(self, parameters: AttentionParameters) -> None:
        self._p, self._policy = parameters, parameters.policy
        self.restart()

    def configure(self, parameters: AttentionParameters) -> None:
        """Use other parameters; a policy that was set stays unless the parameter has changed."""
        if parameters.policy != self._p.policy:
            self._policy = parameters.policy
        self._p = parameters
        self.restart()

    @property
    def policy(self) -> str:
        """The present policy."""
        return self._policy

    def set_policy(self, policy: str) -> None:
        """Use another policy from now on."""
        if policy != self._policy:
            self._policy = policy
            self.restart()

    def restart(self) -> None:
        """Forget what was seen and looked at."""
        self.focus: Focus | None = None
        """What is looked at; None while nothing is."""
        self.blind, self._observed_s = True, -math.inf
        """Whether no results of a detector arrive: nothing can be found then."""
        self._since_s, self._target_id = -math.inf, 0
        self._seen: dict[int, _Seen] = {}
        self._looked_s: dict[int, float] = {}
        self._glance: _Glance | None = None

    def drop_focus(self) -> None:
        """Look at nothing, and choose anew at the next update."""
        self.focus, self._glance = None, None

    def observe(self, box: BoxSighting, now_s: float) -> None:
        """Keep which objects are in view, and which one the detector has chosen."""
        self._observed_s = now_s
        for one in box.objects:
            before = self._seen.get(one.object_id)
            self._seen[one.object_id] = _Seen(one.class_name, now_s if before is None else before.first_s, now_s)
        self._target_id = box.object_id

    def update(self, now_s: float, verged: bool) -> bool:
        """Update the focus; returns whether it has changed. `verged` says whether the eyes are verged on it."""
        before, self.blind = self.focus, now_s - self._observed_s > _BLIND_S
        self._seen = {i: seen for i, seen in self._seen.items() if now_s - seen.last_s <= self._p.gone_after_s}
        self._looked_s = {i: looked_s for i, looked_s in self._looked_s.items() if i in self._seen}
        if self._policy not in (SOCIAL, FOCUSED):
            self._glance, self.focus = None, None
        elif self._glance is not None:
            self._glancing(self._glance, now_s, verged)
        else:
            self._attend(now_s, verged)
        if self.focus != before:
            self._since_s = now_s
        return self.focus != before

    def _attend(self, now_s: float, verged: bool) -> None:
        best = min(self._of_interest().values(), key=self._rank, default=None)
        focus = self.focus
        if focus is None or not self._is_in_view(focus):
            self.focus = None if best is None else Focus(best, reason=f"the most interesting class in view is {best}")
            return
        dwelled_s = now_s - self._since_s
        if self._target_id in self._seen:
            self._looked_s[self._target_id] = now_s
        if self._policy == FOCUSED:
            return
        if best is not None and self._rank(best) < self._rank(focus.class_name):
            if dwelled_s >= self._p.min_dwell_s:
                self.focus = Focus(best, reason=f"{best} is more interesting than {focus.class_name}")
        elif focus.object_id:
            if dwelled_s >= self._p.min_dwell_s:  # back from a glance: the detector's choice counts again
                self.focus = Focus(focus.class_name, reason=focus.reason)
        elif verged and 0.0 < self._p.glance_every_s <= dwelled_s:
            self._begin_glance(focus, now_s)

    def _begin_glance(self, focus: Focus, now_s: float) -> None:
        others = {i: name for i, name in self._of_interest().items() if i != self._target_id}
        if not others or self._target_id not in self._seen:
            return
        # The one that was looked at the longest time ago, and of those never looked at the more interesting.
        other = min(others, key=lambda i: (self._looked_s.get(i, -math.inf), self._rank(others[i])))
        self._glance = _Glance(focus.class_name, self._target_id, now_s)
        self._looked_s[other] = now_s
        name = others[other]
        self.focus = Focus(name, other, f"a glance at object {other} ({name})")

    def _glancing(self, glance: _Glance, now_s: float, verged: bool) -> None:
        there = verged and self.focus is not None and self._target_id == self.focus.object_id
        if there and math.isinf(glance.until_s):
            glance = self._glance = _Glance(glance.home_class, glance.home_id, glance.since_s, now_s + self._p.glance_s)
        late = now_s - glance.since_s > _ARRIVAL_S + self._p.glance_s
        gone = self.focus is None or self.focus.object_id not in self._seen
        if now_s >= glance.until_s or late or gone:
            self._glance = None
            back = f"back from a glance to object {glance.home_id} ({glance.home_class})"
            self.focus = Focus(glance.home_class, glance.home_id, back)

    def _is_in_view(self, focus: Focus) -> bool:
        if focus.object_id:
            return focus.object_id in self._seen
        return any(seen.class_name == focus.class_name for seen in self._seen.values())

    def _of_interest(self) -> dict[int, str]:
        """Return the classes of the objects that may be looked at, by id."""
        steady = ((i, seen) for i, seen in self._seen.items() if seen.last_s - seen.first_s >= _STEADY_S)
        return {i: seen.class_name for i, seen in steady if seen.class_name in self._p.classes}

    def _rank(self, class_name: str) -> int:
        return self._p.classes.index(class_name)

    def describe(self) -> str:
        """Return the policy and what is looked at, as gaze/state reports it."""
        if self._policy == RANDOM:
            return f"{self._policy}: looking anywhere"
        if self._policy not in (SOCIAL, FOCUSED):
            return self._policy
        if self.blind:
            return f"{self._policy}: no results of a detector arrive (vergence/box)"
        if self.focus is None:
            return f"{self._policy}: nothing of interest in view, scanning the room"
        return f"{self._policy}: {self.focus.reason}"
