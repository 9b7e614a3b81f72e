"""The binocular head in Python without ROS: `from vergence import Head`."""

from vergence.body import Body, BodyError
from vergence.head import Head
from vergence.look import Look, RequestError
from vergence.pair_metric import Measurement
from vergence_gaze.goals.goal import GoalError, Outcome, Result

__all__ = ["Body", "BodyError", "GoalError", "Head", "Look", "Measurement", "Outcome", "RequestError", "Result"]
