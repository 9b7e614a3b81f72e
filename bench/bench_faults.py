"""Faults injected into metric and controller: how many are named and recovered from in time, and what is claimed."""

import os
from collections.abc import Callable

from bench.results import Row
from vergence_bringup.testing.ros.fault_trial import NAMED_WITHIN_S, RECOVERED_WITHIN_S, FaultTrial, Outcome
from vergence_bringup.testing.ros.faults import FAULTS
from vergence_common.domains import own_domain

_PEER = "every fault"


def run(say: Callable[[str], None]) -> list[Row]:
    """Inject every fault, one after the other."""
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    outcomes: list[Outcome] = []
    for fault in FAULTS:
        with own_domain() as domain, FaultTrial(domain) as trial:
            if not trial.wait_until_verged():
                say(f"{fault.name}: the eyes did not verge before it")
            outcome = trial.run(fault)
        outcomes.append(outcome)
        say(
            f"{fault.name}: named after {outcome.named_s:.1f} s, recovered after {outcome.recovered_s:.1f} s, "
            f"{outcome.false_verged} false claims"
        )
    count = len(outcomes)
    named, recovered = (sum(getattr(o, what) for o in outcomes) / count for what in ("named", "recovered"))
    false = sum(outcome.false_verged > 0 for outcome in outcomes)
    return [
        Row("faults.named_share", named, f"of {count} within {NAMED_WITHIN_S:g} s", _PEER, 1.0),
        Row("faults.recovered_share", recovered, f"of {count} within {RECOVERED_WITHIN_S:g} s", _PEER, 1.0),
        Row("faults.false_verged", float(false), f"of {count} faults", "none", 0.0),
    ]
