"""The graph under each fault of the table: it is named, nothing false is claimed, and its end is seen.

`make bench ONLY=faults` measures how soon.
"""

import math

import pytest

from vergence_bringup.testing.ros.fault_trial import FaultTrial
from vergence_bringup.testing.ros.faults import FAULTS, HOLDS, Fault

pytestmark = pytest.mark.graph


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_is_named_claims_nothing_false_and_ends(fault: Fault, domain_id: int) -> None:
    with FaultTrial(domain_id) as trial:
        assert trial.wait_until_verged()
        outcome = trial.run(fault)
    assert math.isfinite(outcome.named_s), f"never said: {fault.words}"
    assert outcome.false_verged == 0
    assert outcome.held or fault.head != HOLDS
    assert math.isfinite(outcome.recovered_s), f"still said: {fault.words}"


def test_names_are_told_apart() -> None:
    assert len({fault.name for fault in FAULTS}) == len(FAULTS)
