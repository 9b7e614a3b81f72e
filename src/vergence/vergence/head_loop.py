"""The loop of a head: body, eyes and controller, one control cycle after the other."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

from vergence.body import Body, BodyError, JointAngles, Pixels
from vergence.look import Look, Request
from vergence.pair_metric import Measurement
from vergence.vision import Vision
from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import GazeReport
from vergence_gaze.estimation.observations import JointReport, Observation
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.parameters import GazeNodeParameters
from vergence_metric.measurement.parameters import pair_measurement_parameters
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import eye_images
from vergence_rig.rig import JOINT_NAMES

if TYPE_CHECKING:
    from vergence.bags.recorder import HeadRecorder  # rosbags is needed for recordings alone

NONE: Mapping[str, Any] = MappingProxyType({})
_FIRST_PAIR_S = 5.0

Loop = TypeVar("Loop", bound="HeadLoop")


class HeadLoop:
    """Steers both eyes and the tilt of a body by what its eyes see.

    To be closed, or used as a context manager. For one thread.
    """

    def __init__(self, body: Body, *, gaze: Mapping[str, Any] = NONE, metric: Mapping[str, Any] = NONE) -> None:
        """Steer a body.

        Args:
            body: the head.
            gaze: parameters of gaze_controller_node by their full names, such as {"mode": "left_held"}.
            metric: parameters of edge_metric_node by their full names, such as {"edges.windows_px": (50, 100)}.

        Raises:
            ParameterError: an unknown name or an invalid value.
        """
        self.body = body
        parameters = gaze_parameters(gaze)
        assert isinstance(parameters.control, GazeNodeParameters)
        self._period_s = 1.0 / parameters.control.control_rate_hz
        self._vision = Vision(body.rig, body.cameras, pair_measurement_parameters(metric))
        self._metric = self._vision.metric
        self._controller = GazeController(body.rig, parameters, self._period_s)
        described = (CameraModel(body.rig.left_camera), CameraModel(body.rig.right_camera))
        self._images = eye_images(body.rig, described)
        self._looks: dict[int, Look] = {}
        self._closed = False
        self._recorder: HeadRecorder | None = None
        self.report: GazeReport | None = None
        """The controller's state after the newest step: phase, reason, angles, residuals, distance, ..."""

    @property
    def time_s(self) -> float:
        """The present on the body's clock."""
        return self.body.time_s

    @property
    def pictures(self) -> tuple[Pixels, Pixels]:
        """The newest pair as it was taken, (h, w, 3) BGR each; a pixel of `look_at` is one of these."""
        pair = self._metric.newest
        if pair is None:
            self._step_to_first_pair()
            pair = self._metric.newest
            assert pair is not None
        return pair.left, pair.right

    def step(self) -> GazeReport:
        """Go on by one control cycle, 20 ms unless `control_rate_hz` says otherwise, and return the new state."""
        if self._closed:
            raise BodyError("the head must be open: it was closed")
        observations: list[Observation] = []
        arrived = self.body.advance(self._period_s)
        now_s = self.body.time_s
        now_ns = round(now_s * 1e9)
        recorder = self._recorder
        for one in arrived:
            if isinstance(one, JointAngles):
                if recorder is not None:
                    recorder.on_joints(one, now_ns)
                self._metric.add_joints(one)
                angles = dict(zip(JOINT_NAMES, one.angles_rad.tolist(), strict=True))
                observations.append(JointReport(one.stamp_ns * 1e-9, angles))
            else:
                if recorder is not None:
                    recorder.on_picture(one, now_ns)
                self._vision.add_picture(one, now_ns)
        observations += self._vision.observe(now_ns)
        self._images = self._metric.images or self._images
        command = self._controller.step(now_s, observations)
        if command.track_request is not None:
            self._metric.request_track(command.track_request)
        if command.joints_rad is not None and self.body.can_move:
            self.body.command(command.joints_rad)
            if recorder is not None:
                recorder.on_command(command.joints_rad, now_ns)
        for outcome in command.outcomes:
            look = self._looks.pop(outcome.goal_id, None)
            if look is not None:
                look.outcome = outcome
        self.report = command.report
        return command.report

    def run(self, duration_s: float) -> GazeReport:
        """Step for this long, and return the state then."""
        end_s = self.time_s + duration_s
        report = self.step()
        while self.time_s < end_s - 0.5 * self._period_s:
            report = self.step()
        return report

    def look_at(
        self,
        *,
        pixel: Sequence[float] | None = None,
        stereo_pixel: Sequence[float] | None = None,
        point_m: Sequence[float] | None = None,
        angles_rad: Sequence[float] | None = None,
        turn_rad: Sequence[float] | None = None,
        eye: str = "left",
        depth_m: float | None = None,
        time_limit_s: float = 0.0,
    ) -> Look:
        """Begin to look at something, and return the goal: `wait()` for it, or `step()` until it has an `outcome`.

        Exactly one target is to be given; see `vergence.look.Request` for each argument. A goal that is under way ends
        as PREEMPTED.

        Raises:
            RequestError: not one target, or not numbers.
            GoalError: a target that can never be reached, and why.
            BodyError: a head without servos, or one that gives no pictures.
        """
        if not self.body.can_move:
            raise BodyError("look_at must have servos that turn the eyes: this head has none")
        if self._metric.newest is None:
            self._step_to_first_pair()
        pair = self._metric.newest
        stamp_s = math.nan if pair is None else pair.left_stamp_ns * 1e-9
        request = Request(pixel, stereo_pixel, point_m, angles_rad, turn_rad, eye, depth_m, time_limit_s)
        goal = request.goal(self._images, stamp_s)
        self._controller.check(goal, self.time_s)
        look = Look(self._controller.look_at(goal, self.time_s), self.step)
        self._looks[look.goal_id] = look
        return look

    def measure(self) -> Measurement:
        """Return what the newest pair shows: metric I, contrast, signed disparity, the followed target."""
        found = self._metric.measurement()
        if found is None:
            self._step_to_first_pair()
            found = self._metric.measurement()
            assert found is not None
        return found

    def record(self, bag: str | Path) -> None:
        """Record pictures, joint angles and commands from the next step on, until `close` or the next call.

        Args:
            bag: folder of the new bag, which must not exist: one that `ros2 bag play` and `vergence replay` read.

        Raises:
            BagError: the folder exists, or cannot be written.
        """
        from vergence.bags.recorder import HeadRecorder

        recorder = HeadRecorder(bag, self.body.cameras)
        self._end_recording()
        self._recorder = recorder

    def stop(self) -> None:
        """End a goal and hold still."""
        self._controller.stop(self.time_s)

    def close(self) -> None:
        """Release the body; idempotent."""
        if not self._closed:
            self._closed = True
            self._end_recording()
            self.body.close()

    def __enter__(self: Loop) -> Loop:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _end_recording(self) -> None:
        if self._recorder is not None:
            self._recorder.close()
            self._recorder = None

    def _step_to_first_pair(self) -> None:
        end_s = self.time_s + _FIRST_PAIR_S
        while self._metric.newest is None:
            self.step()
            if self.time_s > end_s:
                fault = self._vision.fault or "no pair has arrived"
                raise BodyError(f"the head must give pictures within {_FIRST_PAIR_S:g} s: {fault}")
