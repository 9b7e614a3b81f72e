"""Draw the pictures of docs/control.md from the runs that bench_gaze measures: `python -m bench.gaze_plots [DIR]`."""

import math
import sys
from pathlib import Path

import matplotlib
import numpy as np

from bench import gaze_runs
from bench import gaze_scenarios as scenarios
from bench.gaze_runs import Scenario, Setting, Trace
from bench.heads import identify

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

LAWS = {"predictive": "#1f5fa8", "pd_bangbang": "#c0522d", "pid_pursuit": "#4f8a3c", "metric_descent": "#7a5aa6"}
BEGIN_S = 1.4


def side_step() -> Scenario:
    """A fixated target jumps by 15 degrees at 1.5 s."""
    before, after = scenarios.place(0.8, math.radians(-5.0), 0.0), scenarios.place(0.8, math.radians(10.0), 0.0)
    return Scenario(lambda time_s: before if time_s < 1.5 else after, scenarios.fixating(before), 4.0, "pairs", 1)


def depth_step() -> Scenario:
    """A fixated target jumps from 1.2 m to 0.4 m at 1.5 s."""
    before, after = scenarios.place(1.2, 0.1, 0.0), scenarios.place(0.4, 0.1, 0.0)
    return Scenario(lambda time_s: before if time_s < 1.5 else after, scenarios.fixating(before), 5.0, "pairs", 1)


def true_angle_deg(trace: Trace, axis: int) -> np.ndarray:
    """Return the true version (axis 0) or vergence (axis 1) of a run over time."""
    left, right = trace.joints_deg[:, 0], trace.joints_deg[:, 1]
    return 0.5 * (left + right) if axis == 0 else right - left


def draw(axes: Axes, scenario: Scenario, axis: int, servo: str, laws: tuple[str, ...]) -> None:
    """Draw the target's angle and every law's over time."""
    wanted = None
    for law in laws:
        trace = gaze_runs.run(scenario, Setting(law=law, servo=servo))
        late = trace.time_s >= BEGIN_S
        angle = true_angle_deg(trace, axis)
        if wanted is None:
            wanted = angle + trace.errors_deg[:, axis]
            axes.plot(trace.time_s[late], wanted[late], color="black", linewidth=1.0, linestyle=":", label="target")
        axes.plot(trace.time_s[late], angle[late], color=LAWS[law], linewidth=1.4, label=law)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(("version" if axis == 0 else "vergence") + " [deg]")
    axes.grid(alpha=0.25)


def steps_picture(path: Path) -> None:
    """Both kinds of step, four laws over each other, SG90 servos, 60 ms."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.8), constrained_layout=True)
    draw(left, side_step(), 0, "sg90", tuple(LAWS))
    left.set_title("a jump sideways by 15 degrees")
    draw(right, depth_step(), 1, "sg90", tuple(LAWS))
    right.set_title("a jump in depth from 1.2 m to 0.4 m")
    left.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def pursuit_picture(path: Path) -> None:
    """A ramp and a sinusoid, ideal servos, 60 ms."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 3.8), constrained_layout=True)
    smooth = ("predictive", "pd_bangbang", "pid_pursuit")
    ramp = scenarios.ramps((20.0,))[0]
    draw(left, ramp, 0, "ideal", smooth)
    left.set_title("20 degrees a second from 1 s on")
    draw(right, scenarios.sinusoids((0.5,))[0], 0, "ideal", smooth)
    right.set_title("half a hertz")
    left.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main(folder: Path) -> int:
    """Write the pictures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    identify(print)
    steps_picture(folder / "control_steps.png")
    pursuit_picture(folder / "control_pursuit.png")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs") / "pictures"))
