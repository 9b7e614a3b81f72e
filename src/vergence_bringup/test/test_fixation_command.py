"""`vergence fixation`."""

import json
import math

import pytest

from vergence_bringup.command_line import main


def test_it_prints_the_papers_lengths(capsys):
    assert main(["fixation", "--c1", "80", "--c2", "80", "--baseline", "0.065", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["om_m"] == pytest.approx(0.0325 * math.tan(math.radians(80)))
    assert said["c1m_m"] == pytest.approx(0.0325)
    assert said["vergence_deg"] == pytest.approx(20)
    assert (said["pan_left_deg"], said["pan_right_deg"]) == (-10, 10)
    assert main(["fixation", "--c1", "80", "--c2", "80"]) == 0
    assert "OM   0.184317 m" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("c1", "c2", "baseline", "named"),
    [
        ("100", "80", "0.065", "parallel"),
        ("100", "90", "0.065", "diverge"),
        ("200", "80", "1", "C1"),
        ("80", "80", "0", "baseline"),
    ],
)
def test_axes_that_do_not_meet_are_one_line(capsys, c1, c2, baseline, named):
    assert main(["fixation", "--c1", c1, "--c2", c2, "--baseline", baseline]) == 2
    assert named in capsys.readouterr().err
