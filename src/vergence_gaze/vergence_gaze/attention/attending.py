"""Attention on the controller's means: when it is active, where the eyes go meanwhile, and how fast."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from vergence_gaze.attention.manager import AttentionManager, Focus
from vergence_gaze.attention_parameters import DISABLED, RANDOM
from vergence_gaze.control.search_pattern import Pattern, RandomPattern, Searcher, SearchPattern
from vergence_gaze.estimation.observations import BoxSighting
from vergence_gaze.joints.smooth_limits import SmoothLimits
from vergence_gaze.parameters import GazeParameters
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]


class Attending:
    """Takes over while nothing else is asked for, and goes back to rest when something is.

    An explicit goal always wins: attention resumes `attention.after_goal_s` after it has ended, or once its target is
    lost.
    """

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._manager = AttentionManager(parameters.attention)
        if parameters.control.start != "attend":
            self._manager.set_policy(DISABLED)
        self._random = np.random.default_rng(0)
        self.engaged = False
        """Whether attention turns the eyes now."""
        self._paused, self._asked_s = False, -math.inf
        self.configure(rig, parameters)

    def configure(self, rig: Rig, parameters: GazeParameters) -> None:
        """Start again with other parameters."""
        self._p, self.engaged = parameters.attention, False
        self._vergence_rad, self._tilt_enabled = parameters.target.prior_vergence_rad, parameters.control.tilt_enabled
        self._manager.configure(parameters.attention)
        self.set_rig(rig)

    def set_rig(self, rig: Rig) -> None:
        """Use another description of the head; what is looked at stays."""
        self.limits = SmoothLimits(rig, self._p.speed_rad_s, self._p.acceleration_rad_s2)
        """Of commands while attention is engaged."""
        vergence_rad, tilt_enabled = self._vergence_rad, self._tilt_enabled
        self._patterns: dict[bool, Callable[[], Pattern]] = {
            True: lambda: RandomPattern(rig, tilt_enabled, vergence_rad, self._random),
            False: lambda: SearchPattern(rig, tilt_enabled, vergence_rad),
        }
        self._use_policy()

    def _use_policy(self) -> None:
        """Look about as the policy wants: anywhere, or from place to place."""
        anywhere = self._manager.policy == RANDOM
        dwell_s = self._p.random_dwell_s if anywhere else self._p.scan_dwell_s
        self._searcher = Searcher(self._patterns[anywhere], self._vergence_rad, dwell_s)
        self._scan_speed_rad_s = self._p.speed_rad_s if anywhere else self._p.scan_speed_rad_s

    @property
    def policy(self) -> str:
        """The present policy."""
        return self._manager.policy

    @property
    def focus(self) -> Focus | None:
        """What is looked at, None while nothing is."""
        return self._manager.focus if self.engaged else None

    @property
    def may_search(self) -> bool:
        """Whether the eyes may go anywhere: not while they turn to an object, or wait for it to be seen again.

        Without results of a detector there is nothing to be found.
        """
        return self._manager.policy == RANDOM or (self._manager.focus is None and not self._manager.blind)

    def set_policy(self, policy: str) -> None:
        """Use another policy from now on; it also ends a pause."""
        self._manager.set_policy(policy)
        self._use_policy()
        self._paused = False
        self.engaged = self.engaged and policy != DISABLED

    def pause(self) -> None:
        """Hold still until a policy is set, a goal has been active, or `resume` is called."""
        self._paused, self.engaged = True, False

    def resume(self) -> None:
        """End a pause."""
        self._paused = False

    def restart(self) -> None:
        """Forget what was seen: the clock was set back, or everything starts again."""
        self._manager.restart()
        self.engaged, self._asked_s = False, -math.inf

    def observe(self, box: BoxSighting, now_s: float) -> None:
        """Keep what is in view."""
        self._manager.observe(box, now_s)

    def update(self, now_s: float, asked: bool, searching: bool, enabled: bool, verged: bool) -> bool:
        """Return whether the eyes have something else to do than before: an object to look at, or none.

        Args:
            now_s: the present.
            asked: whether a goal or a stream of points is active now.
            searching: whether its target is lost: there is nothing to follow after its end.
            enabled: whether the eyes may be turned at all.
            verged: whether the eyes are verged.
        """
        if asked:
            self._asked_s, self._paused = now_s, False
        waits = now_s - self._asked_s < self._p.after_goal_s and not searching
        if asked or waits or self._paused or not enabled or self._manager.policy == DISABLED:
            self.engaged = False
            return False
        begins = not self.engaged
        if begins:
            self._manager.drop_focus()
            self.limits.restart()
            self.engaged, self._asked_s = True, -math.inf
        return self._manager.update(now_s, verged) or begins

    def next_pose(self, now_s: float, shaft_rad: Array) -> Array:
        """Return the joint angles (3,) to look at while there is no object to look at; see Searcher."""
        self.limits.use_speed(self._scan_speed_rad_s)
        return self._searcher.next_pose(now_s, shaft_rad, self.limits.speed_rad_s)

    def stop_searching(self) -> None:
        """Turn as fast as to an object; the next search starts anew."""
        self.limits.use_speed(self._p.speed_rad_s)
        self._searcher.stop()

    def describe(self) -> str:
        """Return the policy, what is looked at and why, as gaze/state reports it."""
        if self._manager.policy == DISABLED or self.engaged:
            return self._manager.describe()
        if self._paused:
            return f"{self._manager.policy}: stopped until a policy is set or a goal is sent"
        return f"{self._manager.policy}: waiting, what was asked for comes first"
