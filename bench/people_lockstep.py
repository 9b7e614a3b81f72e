"""The lockstep of world, metric and controller with persons: boxes of a simulated detector beside the tracker."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from std_msgs.msg import Header

from bench.people_detector import NoDetector, detected
from bench.photos_lockstep import Lockstep, clock_s
from vergence_common.stamps import to_stamp
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.ros import gaze_messages
from vergence_metric.boxes.measurement import BoxMeasurement
from vergence_metric.boxes.parameters import BoxMetricParameters
from vergence_metric.ros.box_messages import box_vergence_message, requested_object
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig
from vergence_sim.simulator import Simulator

_BOX_PERIOD_S, _BOX_LATENCY_S = 0.095, 0.1


class PeopleLockstep(Lockstep):
    """Measures boxes of every third pair, as box_metric_node does, on the controller's request."""

    def __init__(self, world: Simulator, rig: Rig, parameters: GazeParameters, seed: int = 0) -> None:
        super().__init__(world, rig, parameters)
        self._room, self._random = world, np.random.default_rng(seed)
        self.boxes = BoxMeasurement(BoxMetricParameters(), Kinematics(rig), NoDetector())  # type: ignore[arg-type]
        self._box_due_s = -math.inf
        self._exposed: dict[str, tuple[float, Any]] = {}

    def _control(self) -> None:
        notify = self.on_step

        def also(command: Any) -> None:
            if command.object_request is not None:
                message = gaze_messages.object_request(command.object_request, 0.0)
                self.boxes.request(requested_object(message))
            notify(command)

        self.on_step = also
        super()._control()
        self.on_step = notify

    def _publish(self, eye: str, exposed_s: float, develop: Callable[[], Any]) -> None:
        image, found = develop()
        self._exposed[eye] = exposed_s, (image, found)
        super()._publish(eye, exposed_s, lambda: image)
        if len(self._exposed) < 2 or max(t for t, _ in self._exposed.values()) < self._box_due_s:
            return
        (left_s, (left, in_left)), (right_s, (right, in_right)) = self._exposed["left"], self._exposed["right"]
        self._exposed = {}
        self._box_due_s = left_s + _BOX_PERIOD_S
        eyes = self.metric.eyes_at(clock_s(left_s), clock_s(right_s))
        ideal = self.metric.images[0].ideal, self.metric.images[1].ideal
        result = self.boxes.measure_detections((left, right), (in_left, in_right), clock_s(left_s), eyes, ideal)
        header = Header(stamp=to_stamp(clock_s(left_s)))
        message = box_vergence_message(result, header, right_s - left_s, ideal[0].fx_px)
        seen = gaze_messages.box_sighting(message, self.metric.images[0].fx_px)
        self._arrive(max(left_s, right_s) + self.world.parameters.camera.latency_s + _BOX_LATENCY_S, [seen], left_s)

    def _expose(self, eye: str) -> Callable[[], Any]:
        """Expose an eye, and detect at once: the persons are elsewhere later."""
        develop, (found, _) = super()._expose(eye), detected(self._room, eye, self._random)
        return lambda: (develop(), found)
