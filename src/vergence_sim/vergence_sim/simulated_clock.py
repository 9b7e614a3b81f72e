"""How far simulated time may run: never ahead of the nodes that follow it. Real time is the caller's, in seconds."""

from collections import deque
from collections.abc import Mapping

from vergence_sim.clock_parameters import ClockParameters

TICKS, PAIRS = "ticks", "pairs"
"""What an output answers: every tick of the clock, or every pair of images; or every second one, and so on."""

GRACE_S = 0.2
"""Real time [s] for which at least an answer is waited for that may come, but need not."""

_KEPT_INTERVALS = 4
_KEPT_STAMPS = 1000
_SAME_STAMP_NS = 1_000
_TRY_EVERY = 50
_LEARNT_WITHIN = 20
_LONGEST_GRACE_S = 1.0
_CATCH_UP_S = 0.1
_RATE_WINDOW_S = 5.0


class Sequence:
    """Ticks or pairs of images, numbered from 1, by their stamps [ns]."""

    def __init__(self) -> None:
        self.newest = 0
        self._stamps: deque[tuple[int, int]] = deque(maxlen=_KEPT_STAMPS)

    def add(self, stamp_ns: int) -> None:
        """Add the next element; one that is not newer than the last is left out."""
        if self._stamps and stamp_ns <= self._stamps[-1][0]:
            return
        self.newest += 1
        self._stamps.append((stamp_ns, self.newest))

    def number_of(self, stamp_ns: int) -> int:
        """Return the number of the newest element with at most this stamp, 0 if there is none."""
        for known_ns, number in reversed(self._stamps):
            if known_ns <= stamp_ns + _SAME_STAMP_NS:
                return number
        return 0


class Follower:
    """One output: the newest element of its sequence that it has answered, and whether the next answer is due.

    Outputs answer at an even rate, every element or every so many. The interval is learnt from answers that follow one
    that was in time: a node that was busy leaves elements out. After the longest of the last intervals an answer is
    due. After the shortest it may come, and is given a little real time, so that answers are in time again after a
    disturbance. While the interval is unknown, an answer may come after every element; at the start and then now and
    then one element less than the shortest is tried.
    """

    def __init__(self, sequence: Sequence) -> None:
        self.sequence = sequence
        self.given_up = False
        self._intervals: deque[int] = deque(maxlen=_KEPT_INTERVALS)
        self._answered = self._newest_then = self._waits_at = 0
        self._waits_since_s: float | None = None
        self._since_tried, self._grace_s = _TRY_EVERY, GRACE_S

    @property
    def interval(self) -> int | None:
        """Number of elements within which it has answered; None where that is unknown."""
        return max(self._intervals) if self._intervals else None

    @property
    def is_due(self) -> bool:
        """True if its next answer is to be waited for."""
        return self.interval is not None and self.sequence.newest - self._newest_then >= self.interval

    def waits(self, wall_s: float, timeout_s: float) -> bool:
        """Return whether an answer is waited for at `wall_s`; one that is due for `timeout_s` is given up."""
        if not (self.is_due or self._may_come):
            return False
        if self._waits_since_s is None or self._waits_at != self.sequence.newest:
            self._waits_since_s, self._waits_at = wall_s, self.sequence.newest
        waited_s = wall_s - self._waits_since_s
        if self.is_due:
            if waited_s < timeout_s:
                return True
            self.forget()
            self.given_up = True
        elif waited_s < min(self._grace_s, timeout_s):
            return True
        self._since_tried = 0
        return False

    def answer(self, number: int, wall_s: float) -> None:
        """Note the answer to an element at `wall_s`; an older one than the last changes nothing."""
        if number <= self._answered:
            return
        if self._answered and self._answered == self._newest_then:
            self._intervals.append(number - self._answered)
        if self._waits_since_s is not None:
            self._grace_s = min(max(GRACE_S, 1.5 * (wall_s - self._waits_since_s)), _LONGEST_GRACE_S)
        self._answered, self._newest_then = number, self.sequence.newest
        self.given_up, self._waits_since_s = False, None
        self._since_tried += 1

    def forget(self) -> None:
        """Wait for it only when it has answered again."""
        self._answered = self._newest_then = self._waits_at = 0
        self._waits_since_s = None
        self._since_tried, self._grace_s = _TRY_EVERY, GRACE_S
        self._intervals.clear()

    @property
    def _may_come(self) -> bool:
        newest = self.sequence.newest
        if not self._answered or newest == self._answered:
            return False
        if not self._intervals:
            return newest - self._newest_then <= _LEARNT_WITHIN
        # Also where it has just answered an older element: what it has got since is on its way.
        return newest - self._answered >= min(self._intervals) - (self._since_tried >= _TRY_EVERY)


class SimulatedClock:
    """Simulated time in equal steps [ns]. It stands while an output is due, and never runs faster than it may.

    `followers` are the outputs by name, each with TICKS or PAIRS. An output that has been due for `timeout_s` of real
    time is given up: time goes on without it until it answers again. `skew_ns` is the largest difference of the stamps
    of a pair's images.
    """

    def __init__(self, parameters: ClockParameters, followers: Mapping[str, str], start_ns: int, skew_ns: int) -> None:
        self.parameters = parameters
        self.now_ns = start_ns
        self.limit_ns: int | None = start_ns if parameters.stepped else None
        self._step_ns = round(parameters.step_s * 1e9)
        self._skew_ns = skew_ns
        self._sequences = {TICKS: Sequence(), PAIRS: Sequence()}
        self._followers = {name: Follower(self._sequences[kind]) for name, kind in followers.items()}
        self._images_ns: dict[str, int] = {}
        self._answers_ns: dict[str, int] = {}
        self._next_at_s: float | None = None
        self._rates: deque[tuple[float, int]] = deque()

    @property
    def next_ns(self) -> int:
        """The time of the next tick."""
        return self.now_ns + self._step_ns

    @property
    def due(self) -> list[str]:
        """The outputs that are due."""
        return [name for name, follower in self._followers.items() if follower.is_due]

    @property
    def given_up(self) -> list[str]:
        """The outputs that are no longer waited for."""
        return [name for name, follower in self._followers.items() if follower.given_up]

    @property
    def at_limit(self) -> bool:
        """True if time may run no further until `run_until` is called."""
        return self.limit_ns is not None and self.now_ns >= self.limit_ns

    def run_until(self, time_ns: int) -> None:
        """Let time run to the first tick at or after `time_ns`, which may be in the past."""
        self.limit_ns = time_ns

    def add_image(self, eye: str, stamp_ns: int, wall_s: float) -> None:
        """Note an image of an eye, "left" or "right", that has been published."""
        self._images_ns[eye] = stamp_ns
        left_ns, right_ns = self._images_ns.get("left"), self._images_ns.get("right")
        if left_ns is None or right_ns is None or abs(left_ns - right_ns) > self._skew_ns:
            return
        self._images_ns.clear()  # an image is in one pair
        pairs = self._sequences[PAIRS]
        pairs.add(left_ns)
        for name, stamp_ns in self._answers_ns.items():
            self._followers[name].answer(pairs.number_of(stamp_ns), wall_s)

    def answer(self, name: str, stamp_ns: int, wall_s: float) -> None:
        """Note an output with the stamp of what it answers."""
        follower = self._followers[name]
        sequence = follower.sequence
        if sequence is self._sequences[PAIRS]:
            self._answers_ns[name] = stamp_ns  # an answer may be here before its pair is noted
        follower.answer(sequence.number_of(stamp_ns), wall_s)

    def forget(self, name: str) -> None:
        """Note that nothing publishes this output any more."""
        self._answers_ns.pop(name, None)
        self._followers[name].forget()

    def is_followed(self, wall_s: float) -> bool:
        """Return whether no output is waited for; those due for longer than the time-out are given up."""
        waits = [follower.waits(wall_s, self.parameters.timeout_s) for follower in self._followers.values()]
        return not any(waits)

    def may_advance(self, wall_s: float) -> bool:
        """Return whether the next tick may come now, as far as the ticks and pairs so far go."""
        return self.is_followed(wall_s) and not self.at_limit and self.wait_s(wall_s) <= 0

    def wait_s(self, wall_s: float) -> float:
        """Return the real time [s] until the next tick, as far as the real-time factor goes."""
        return 0.0 if self._next_at_s is None else self._next_at_s - wall_s

    def advance(self, wall_s: float) -> int:
        """Go on by one step and return the time [ns]."""
        self.now_ns += self._step_ns
        self._sequences[TICKS].add(self.now_ns)
        factor = self.parameters.real_time_factor
        if factor > 0:
            # A short delay is caught up with; a long one is not.
            due_s = wall_s if self._next_at_s is None else max(self._next_at_s, wall_s - _CATCH_UP_S)
            self._next_at_s = due_s + self._step_ns * 1e-9 / factor
        else:
            self._next_at_s = None
        self._rates.append((wall_s, self.now_ns))
        while self._rates[-1][0] - self._rates[0][0] > _RATE_WINDOW_S:
            self._rates.popleft()
        return self.now_ns

    def rate(self, wall_s: float) -> float:
        """Return simulated over real time in the last seconds; 0 while time stands."""
        # A copy: diagnostics ask for it from another thread.
        recent = [entry for entry in list(self._rates) if wall_s - entry[0] <= _RATE_WINDOW_S]
        if len(recent) < 2 or wall_s <= recent[0][0]:
            return 0.0
        return (recent[-1][1] - recent[0][1]) * 1e-9 / (wall_s - recent[0][0])
