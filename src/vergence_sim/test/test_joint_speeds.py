"""The speeds of joint_states: the change of the angles over the time between two reports."""

from vergence_sim.joint_speeds import JointSpeeds


def test_speeds_are_the_change_of_the_angles_over_time():
    speeds = JointSpeeds()
    assert speeds.at(1.0, {"tilt": 0.5}) == {"tilt": 0.0}
    assert speeds.at(1.5, {"tilt": 0.4}) == {"tilt": -0.19999999999999996}
    # A second report of one moment has no time to differentiate by: the speed stays.
    assert speeds.at(1.5, {"tilt": 0.4}) == {"tilt": -0.19999999999999996}
    assert speeds.at(2.5, {"tilt": 0.4}) == {"tilt": 0.0}
