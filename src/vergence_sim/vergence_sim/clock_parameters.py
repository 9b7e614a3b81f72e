"""Parameters of simulated time: how fast it runs, what it waits for, and the latencies that it stands for."""

from dataclasses import dataclass

from vergence_rig.parameters import Parameters, parameter


@dataclass(frozen=True)
class ClockParameters(Parameters):
    """Simulated time; it counts only with use_sim_time, else the simulation runs in real time."""

    real_time_factor: float = parameter(
        1.0,
        "simulated time over real time, at most; 0 for as fast as the nodes follow",
        minimum=0,
        maximum=1000,
    )
    step_s: float = parameter(
        0.02,
        "step of /clock; no timer of a node that follows can have a shorter period",
        unit="s",
        minimum=0.001,
        maximum=0.1,
        read_only=True,
    )
    timeout_s: float = parameter(
        5.0,
        "real time for which /clock waits for an output that is due; then its node is reported and not waited for "
        "until it publishes again",
        unit="s",
        minimum=0.1,
        maximum=3600,
        read_only=True,
    )
    image_latency_s: float = parameter(
        0.03,
        "simulated time that an image's transport and measurement take: images are published that much later, and "
        "/clock stands while they are measured",
        unit="s",
        minimum=0,
        maximum=1,
        read_only=True,
    )
    command_latency_s: float = parameter(
        0.002,
        "simulated time from a joint command's publication to its arrival at the servos",
        unit="s",
        minimum=0,
        maximum=1,
        read_only=True,
    )
    stepped: bool = parameter(
        False, "whether simulated time stands until sim/run_until says how far it may run", read_only=True
    )
