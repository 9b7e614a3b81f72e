"""When joint_command is published: every change at once, what stays from time to time."""

from typing import Any

import numpy as np

from vergence_gaze.ros.joint_command import REPEATED_S, JointCommandOutput

PERIOD_S = 0.02


class Sent:
    """A publisher that keeps the time and the left pan of what it is given."""

    def __init__(self) -> None:
        self.commands: list[tuple[float, float]] = []

    def publish(self, message: Any) -> None:
        stamp = message.header.stamp
        self.commands.append((stamp.sec + stamp.nanosec * 1e-9, message.position[0]))


def sent_over(pans_rad: list[float | None], begin_s: float = 10.0) -> list[tuple[float, float]]:
    """Return what is published of one command a cycle, None where nothing is commanded."""
    sent = Sent()
    output = JointCommandOutput(sent)
    for cycle, pan_rad in enumerate(pans_rad):
        joints = None if pan_rad is None else np.array([pan_rad, 0.0, 0.0])
        output.update(joints, begin_s + cycle * PERIOD_S)
    return [(round(stamp_s - begin_s, 6), pan_rad) for stamp_s, pan_rad in sent.commands]


def test_every_change_is_published_at_once() -> None:
    assert [pan for _, pan in sent_over([0.1, 0.2, 0.3, 0.2])] == [0.1, 0.2, 0.3, 0.2]


def test_a_command_that_stays_is_repeated() -> None:
    stamps = [stamp_s for stamp_s, _ in sent_over([0.1] * 51)]
    gaps = np.diff(stamps)
    assert len(stamps) >= 9
    assert gaps.min() >= REPEATED_S - 1e-6
    assert gaps.max() <= REPEATED_S + PERIOD_S + 1e-6


def test_after_a_pause_the_first_command_is_published_though_it_is_the_same() -> None:
    assert sent_over([0.1, None, 0.1]) == [(0.0, 0.1), (0.04, 0.1)]


def test_a_clock_that_is_set_back_delays_no_command() -> None:
    sent = Sent()
    output = JointCommandOutput(sent)
    for now_s in (100.0, 5.0):
        output.update(np.zeros(3), now_s)
    assert [stamp_s for stamp_s, _ in sent.commands] == [100.0, 5.0]
