"""Pairing of two free-running, jittered, lossy streams: share of correct pairs, and cost of a frame.

Ten minutes of two 30 Hz cameras whose clocks differ by 0.1 %, so that their phase passes through the whole period again
and again: exposure jitter of 0.5 ms, a transport delay of 4 to 9 ms, every 50th frame lost on average. The truth is
found afterwards from all frames that arrived: of the frames left, the first two that are each other's nearest, at most
the slop apart. The peer is a greedy queue that behaves as ROS's approximate-time synchroniser: a message is matched
on arrival with the nearest one in the other queue, less than the slop apart.
"""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from bench.results import Row
from vergence_metric.pairs.pairing import LEFT, RIGHT, StereoPairer
from vergence_metric.pairs.parameters import PairingParameters

MS = 1_000_000
PERIOD_NS = round(1e9 / 30)
SECONDS = 600
SLOP_NS = 20 * MS
PEER = "greedy queue of 10"

Match = tuple[int, int]


@dataclass(frozen=True)
class Arrival:
    """A frame: which eye, its stamp, when it arrived [ns]."""

    at_ns: int
    side: int
    stamp_ns: int


def streams(seed: int) -> list[Arrival]:
    """Return the frames of both eyes that arrive, in order of their arrival."""
    random = np.random.default_rng(seed)
    arrivals = []
    for side, period_ns in ((LEFT, PERIOD_NS), (RIGHT, PERIOD_NS * 1.001)):
        count = round(SECONDS * 1e9 / period_ns)
        stamps = np.arange(count) * period_ns + random.normal(0.0, 0.5 * MS, count)
        arrive = np.maximum.accumulate(stamps + random.uniform(4 * MS, 9 * MS, count))
        kept = random.random(count) >= 0.02
        arrivals += [Arrival(int(a), side, int(s)) for a, s in zip(arrive[kept], stamps[kept], strict=True)]
    return sorted(arrivals, key=lambda arrival: arrival.at_ns)


def true_pairs(arrivals: Iterable[Arrival]) -> list[Match]:
    """Return the pairs by their definition, from complete knowledge."""
    stamps: tuple[list[int], list[int]] = ([], [])
    for arrival in arrivals:
        stamps[arrival.side].append(arrival.stamp_ns)
    left, right = (np.array(sorted(side)) for side in stamps)
    pairs, i, j, reach = [], 0, 0, 12
    while i < len(left) and j < len(right):
        apart = np.abs(left[i : i + reach, None] - right[None, j : j + reach])
        nearest_right, nearest_left = apart.argmin(axis=1), apart.argmin(axis=0)
        first = next(a for a, b in enumerate(nearest_right) if nearest_left[b] == a)
        second = int(nearest_right[first])
        if apart[first, second] <= SLOP_NS:
            pairs.append((int(left[i + first]), int(right[j + second])))
        i, j = i + first + 1, j + second + 1
    return pairs


class GreedyQueue:
    """The peer: matches on arrival with the nearest message in the other queue, less than the slop apart."""

    def __init__(self, slop_ns: int, size: int) -> None:
        self._slop_ns, self._size = slop_ns, size
        self._queues: tuple[dict[int, int], dict[int, int]] = ({}, {})

    def add(self, side: int, stamp_ns: int) -> Match | None:
        """Add a message; return the pair that it completes, if any."""
        own, others = self._queues[side], self._queues[1 - side]
        own[stamp_ns] = stamp_ns
        while len(own) > self._size:
            del own[min(own)]
        near = sorted((abs(stamp_ns - other), other) for other in others if abs(stamp_ns - other) < self._slop_ns)
        if not near:
            return None
        other_ns = near[0][1]
        del own[stamp_ns], others[other_ns]
        return (stamp_ns, other_ns) if side == LEFT else (other_ns, stamp_ns)


@dataclass(frozen=True)
class Outcome:
    """The pairs, the time from the arrival of each pair's later frame to the pair [ns], and the cost per frame [s]."""

    pairs: list[Match]
    delays_ns: list[int]
    cost_s: float


def run_pairer(arrivals: list[Arrival]) -> Outcome:
    """Pair with the pairer, called at its deadlines as by the node's timer."""
    pairer: StereoPairer[int] = StereoPairer(PairingParameters(slop_s=SLOP_NS * 1e-9))
    pairs, delays = [], []
    started = time.perf_counter()
    for arrival in arrivals:
        deadline_ns = pairer.deadline_ns
        if deadline_ns is not None and deadline_ns < arrival.at_ns:
            for pair in pairer.expire(deadline_ns):
                pairs.append((pair.left_stamp_ns, pair.right_stamp_ns))
                delays.append(deadline_ns - max(pair.left, pair.right))
        for pair in pairer.add(arrival.side, arrival.stamp_ns, arrival.at_ns, arrival.at_ns):
            pairs.append((pair.left_stamp_ns, pair.right_stamp_ns))
            delays.append(arrival.at_ns - max(pair.left, pair.right))
    return Outcome(pairs, delays, (time.perf_counter() - started) / len(arrivals))


def run_peer(arrivals: list[Arrival]) -> Outcome:
    """Pair by the greedy queue."""
    queue, pairs = GreedyQueue(SLOP_NS, 10), []
    started = time.perf_counter()
    for arrival in arrivals:
        pair = queue.add(arrival.side, arrival.stamp_ns)
        if pair is not None:
            pairs.append(pair)
    return Outcome(pairs, [0] * len(pairs), (time.perf_counter() - started) / len(arrivals))


def share_of_truth(pairs: list[Match], truth: list[Match]) -> float:
    """Return the true pairs as a share of all that were returned or missed."""
    return len(set(pairs) & set(truth)) / len(set(pairs) | set(truth))


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure three runs of ten minutes with different seeds."""
    runs = []
    for seed in range(3):
        arrivals = streams(seed)
        truth = true_pairs(arrivals)
        ours, peer = run_pairer(arrivals), run_peer(arrivals)
        runs.append((ours, peer, share_of_truth(ours.pairs, truth), share_of_truth(peer.pairs, truth)))
        say(f"run {seed + 1} of 3: {len(arrivals)} frames, {len(truth)} true pairs, {len(ours.pairs)} given out")
    delays_ms = np.concatenate([ours.delays_ns for ours, *_ in runs]) * 1e-6
    cost = float(np.median([ours.cost_s for ours, *_ in runs])) * 1e6
    peer_cost = float(np.median([peer.cost_s for _, peer, *_ in runs])) * 1e6
    return [
        Row("pair.cost_us", cost, "us", PEER, peer_cost),
        Row("pair.nearest_share", min(r[2] for r in runs), "share", PEER, min(r[3] for r in runs)),
        Row("pair.at_once_share", float(np.mean(delays_ms == 0.0)), "share"),
        Row("pair.delay_p99_ms", float(np.percentile(delays_ms, 99)), "ms"),
    ]
