"""The accuracy of `vergence identify` against the simulator: the table of docs/identify.md.

    python tools/identify_study.py            every row, some minutes
    python tools/identify_study.py 1          only the first

Runs in lockstep: the simulator's own events in order of their times, no clock, no ROS. Delays of a busy machine
and of messages are therefore not included.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vergence_calibration.identification.axis_log import EYES, AxisLog, EyeCamera, Frames, IdentifyParameters, Move
from vergence_calibration.identification.identification import Identification, identify
from vergence_calibration.identification.pose import pose_with_room
from vergence_calibration.identification.seen_motion import shrunk
from vergence_rig.camera import CameraModel
from vergence_rig.rig import JOINT_NAMES
from vergence_sim.parameters import SimParameters
from vergence_sim.real_time import Schedule
from vergence_sim.simulator import Simulator


@dataclass(frozen=True)
class Case:
    """One setting of the simulator."""

    name: str
    parameters: SimParameters
    stamps_late_s: tuple[float, float] = (0.0, 0.0)


CASES = [
    Case("SG90, MG995, 15 ms", SimParameters()),
    Case("the same, 40 ms", SimParameters.of({"servo_latency_s": 0.04})),
    Case("the same, 80 ms, left stamps 20 ms late", SimParameters.of({"servo_latency_s": 0.08}), (0.02, 0.0)),
    Case("the same, 120 ms, camera 90 ms", SimParameters.of({"servo_latency_s": 0.12, "camera.latency_s": 0.09})),
    Case("the same at 15 Hz, 60 ms", SimParameters.of({"servo_latency_s": 0.06, "camera.frame_rate_hz": 15.0})),
    Case("ideal, 30 ms", SimParameters.of({"preset": "ideal", "servo_latency_s": 0.03})),
]


class LockstepHead:
    """The simulated head, in the time of its own events."""

    def __init__(self, case: Case) -> None:
        # The timing does not depend on the head, only on its servos and cameras.
        self.simulator = Simulator(case.parameters.replaced({"head.model": "rolled"}))
        self._schedule = Schedule(self.simulator.parameters, 0.0)
        self._late_s = dict(zip(EYES, case.stamps_late_s, strict=True))
        self._now_s = 0.0

    def cameras(self) -> dict[str, EyeCamera]:
        """See Head."""
        cameras = {}
        for eye, lens in self.simulator.lenses.items():
            cameras[eye] = EyeCamera(CameraModel(lens.camera), True)
        return cameras

    def record(self, joint: str, moves: Sequence[Move]) -> AxisLog:
        """See Head."""
        log = AxisLog(joint, np.zeros((0, 2)), np.zeros((0, 2)), {eye: Frames() for eye in EYES})
        amplitude_rad = max(abs(move.angle_rad) for move in moves)
        pose = pose_with_room(self.simulator.rig, dict.fromkeys(JOINT_NAMES, 0.0), amplitude_rad)
        self.simulator.command(pose, self._now_s)
        self._run(0.5, joint, {eye: Frames() for eye in EYES})
        reports = self._run(0.1, joint, log.frames)
        commands = []
        for move in moves:
            commands.append((self._now_s, move.angle_rad))
            self.simulator.command({joint: pose[joint] + move.angle_rad}, self._now_s)
            wait_s = move.rest_s + move.share / self.simulator.parameters.camera.frame_rate_hz
            reports += self._run(wait_s, joint, log.frames)
        return AxisLog(joint, np.array(commands), np.array(reports), log.frames)

    def _run(self, duration_s: float, joint: str, frames: dict[str, Frames]) -> list[tuple[float, float]]:
        reports = []
        self._now_s += duration_s
        while self._schedule.next_due_s() < self._now_s:
            event = self._schedule.pop(self._schedule.next_due_s())
            self.simulator.advance_to(event.due_s)
            if event.kind == "joints":
                reports.append((event.due_s, self.simulator.joint_states()[joint]))
            elif event.kind == "expose":
                arrival_s = event.due_s + self.simulator.parameters.camera.latency_s
                picture = shrunk(self.simulator.view(event.eye))
                frames[event.eye].add(event.due_s + self._late_s[event.eye], arrival_s, picture)
        return reports


def row(case: Case) -> str:
    """Identify and return the table's row: worst errors over axes and eyes, and the worst in its own deviations."""
    head = LockstepHead(case)
    found = identify(head, JOINT_NAMES, IdentifyParameters(), "stamps", lambda text: None)
    servos = {name: joint.servo for name, joint in head.simulator.head.rig.joints.items()}
    errors = _latency_errors(found, {name: servo.command_latency_s for name, servo in servos.items()})
    late = [found.latencies.stamp_late_s[eye].value_s - case.stamps_late_s[i] for i, eye in enumerate(EYES)]
    waits = [
        found.latencies.exposure_to_arrival_s[eye].value_s - head.simulator.parameters.camera.latency_s for eye in EYES
    ]
    gains = [gain.deviation for gain in found.gains]
    lost = [
        math.degrees(gain.loop.lost - servos[gain.joint].dead_band_rad - servos[gain.joint].backlash_rad)
        for gain in found.gains
    ]
    speeds = [
        timing.speed_rad_s / servos[joint].speed_rad_s - 1
        for joint, axis in found.timings.items()
        for timing in axis.seen.values()
        if timing.speed_known
    ]
    head.simulator.close()
    speed = f"{100 * _worst(speeds):+.0f} % ({len(speeds)} of 4 measured)" if speeds else "not measured"
    return (
        f"| {case.name} | {1e3 * _worst([error for error, _ in errors]):+.1f} ms "
        f"({_worst([e / s for e, s in errors]):+.1f} sigma) | {1e3 * _worst(late):+.1f} ms | "
        f"{1e3 * _worst(waits):+.1f} ms | {100 * _worst(gains):+.2f} % | {_worst(lost):+.2f}° | {speed} |"
    )


def _latency_errors(found: Identification, truth_s: dict[str, float]) -> list[tuple[float, float]]:
    return [(e.value_s - truth_s[joint], e.sigma_s) for joint, e in found.latencies.servo_s.items()]


def _worst(values: Sequence[float]) -> float:
    return max(values, key=abs)


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else len(CASES)
    print("| simulator | servo latency | stamps late | exposure to arrival | px per rad | lost motion | speed |")
    print("|---|---|---|---|---|---|---|")
    for case in CASES[:count]:
        print(row(case), flush=True)


if __name__ == "__main__":
    main()
