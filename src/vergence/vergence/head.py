"""`Head`: a binocular head that looks at things, in Python without ROS."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import TYPE_CHECKING, Any

from vergence.body import Body, BodyError, JointAngles, Pixels
from vergence.look import Look, Request
from vergence.vision import Measurement, Vision
from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import GazeReport
from vergence_gaze.estimation.observations import JointReport, Observation
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.parameters import GazeNodeParameters
from vergence_metric.measurement.parameters import pair_measurement_parameters
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import eye_images
from vergence_rig.rig import JOINT_NAMES, Rig, default_rig
from vergence_rig.rig_file import load_rig

if TYPE_CHECKING:
    from vergence.bags.recorder import HeadRecorder  # rosbags is needed for recordings alone

_NONE: Mapping[str, Any] = MappingProxyType({})
_FIRST_PAIR_S = 5.0


class Head:
    """Steers both eyes and the tilt of a body by what its eyes see.

    Made by `simulated`, `photographs`, `cameras` or `recording`; or from any body. To be closed, or used as a context
    manager. For one thread.
    """

    def __init__(self, body: Body, *, gaze: Mapping[str, Any] = _NONE, metric: Mapping[str, Any] = _NONE) -> None:
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
        self._controller = GazeController(body.rig, parameters, self._period_s)
        described = (CameraModel(body.rig.left_camera), CameraModel(body.rig.right_camera))
        self._images = eye_images(body.rig, described)
        self._looks: dict[int, Look] = {}
        self._closed = False
        self._recorder: HeadRecorder | None = None
        self.report: GazeReport | None = None
        """The controller's state after the newest step: phase, reason, angles, residuals, distance, ..."""

    @classmethod
    def simulated(
        cls,
        target_m: Sequence[float] = (0.8, 0.0, 0.0),
        *,
        rig: Rig | str | Path | None = None,
        simulation: Mapping[str, Any] = _NONE,
        gaze: Mapping[str, Any] = _NONE,
        metric: Mapping[str, Any] = _NONE,
    ) -> "Head":
        """Return a head in MuJoCo's furnished room; `body.world` is its `Simulator`, with the ground truth.

        Args:
            target_m: place of the target, a Rubik's cube unless `simulation` says otherwise, in rig_base (3,) [m].
            rig: what controller and metric are given: a rig or the path of a rig.yaml, empty for the built-in one;
                None for the head as it is built, as if it had been identified.
            simulation: parameters of sim_node by their full names, such as {"target.object": "marker"}.
            gaze: see `Head`.
            metric: see `Head`.
        """
        # MuJoCo is needed for this alone.
        from vergence.simulated_body import SimulatedBody
        from vergence_sim.heads import simulated_head
        from vergence_sim.parameters import SimParameters
        from vergence_sim.simulator import Simulator

        parameters = SimParameters.of(simulation).effective()
        described = simulated_head(parameters.head, default_rig()) if rig is None else _rig(rig)
        world = Simulator(parameters, described)
        try:
            world.place_target(parameters.target.object, target_m)
            return cls(SimulatedBody(world, described), gaze=gaze, metric=metric)
        except BaseException:
            world.close()
            raise

    @classmethod
    def photographs(
        cls,
        left: str | Path,
        right: str | Path,
        *,
        rig: Rig | str | Path | None = None,
        simulation: Mapping[str, Any] = _NONE,
        gaze: Mapping[str, Any] = _NONE,
        metric: Mapping[str, Any] = _NONE,
    ) -> "Head":
        """Return a simulated head before a rectified stereo pair of photographs; `body.world` is its `PhotoWorld`.

        Args:
            left: path of the left photograph.
            right: path of the right one.
            rig: see `simulated`.
            simulation: parameters of the head and its cameras as sim_node has them.
            gaze: see `Head`.
            metric: see `Head`.
        """
        from vergence.simulated_body import SimulatedBody
        from vergence_sim.heads import simulated_head
        from vergence_sim.parameters import SimParameters
        from vergence_sim.photo.pair import read_pair
        from vergence_sim.photo.parameters import PhotoParameters
        from vergence_sim.photo.world import PhotoWorld, cropped

        photo = PhotoParameters(left=str(left), right=str(right))
        parameters = SimParameters.of(simulation).effective()
        whole = simulated_head(parameters.head, default_rig()) if rig is None else _rig(rig)
        described = cropped(whole, photo.view_width_px, photo.view_height_px)
        world = PhotoWorld(read_pair(photo.left, photo.right), parameters, described)
        return cls(SimulatedBody(world, described), gaze=gaze, metric=metric)

    @classmethod
    def recording(
        cls,
        bag: str | Path,
        *,
        namespace: str | None = None,
        rig: Rig | str | Path = "",
        metric: Mapping[str, Any] = _NONE,
    ) -> "Head":
        """Return a head that sees what a recording shows, at the recorded times, without waiting; it cannot be moved.

        Args:
            bag: folder or .mcap file of a recording; see docs/recordings.md.
            namespace: of the head in it; None for the only one that there is.
            rig: a rig, or the path of a rig.yaml; the built-in one if empty.
            metric: see `Head`.
        """
        # rosbags is needed for this alone.
        from vergence.recorded_body import RecordedBody

        return cls(RecordedBody(bag, _rig(rig), namespace), metric=metric)

    @classmethod
    def cameras(
        cls,
        left: str,
        right: str,
        *,
        rig: str | Path = "",
        servos: str | Path | None = None,
        backend: str = "kernel_pwm",
        width_px: int = 640,
        height_px: int = 480,
        rate_hz: float = 30.0,
        loop: bool = False,
        gaze: Mapping[str, Any] = _NONE,
        metric: Mapping[str, Any] = _NONE,
    ) -> "Head":
        """Return a real head: two cameras, and the servos of servos.yaml.

        Args:
            left: the left eye's camera as camera_node takes it: a device, a file, a folder of pictures or a URL.
            right: the right eye's.
            rig: path of rig.yaml; empty for the built-in one.
            servos: path of servos.yaml; None for eyes that stay as they are, which count as looking straight ahead.
            backend: servo driver of the servos for which servos.yaml names none; "fake" moves no servo.
            width_px: width asked of a camera; 0 for any.
            height_px: height asked of it; 0 for any.
            rate_hz: rate asked of it; 0 for any.
            loop: whether a file begins again at its end.
            gaze: see `Head`.
            metric: see `Head`.

        Raises:
            CameraError: a camera that cannot be opened.
            ParameterError: a backend or a servo that is not described.
        """
        from vergence.camera_body import CameraBody
        from vergence_camera.frame import ModeRequest
        from vergence_camera.source_choice import SourceOptions, make_source
        from vergence_servo.parameters import ServoNodeParameters
        from vergence_servo.servo_channel import RetryParameters
        from vergence_servo.servo_hardware import ServoHardware

        options = SourceOptions(ModeRequest("", width_px, height_px, rate_hz), replay_loop=loop)
        sources = make_source(left, options), make_source(right, options)
        described, hardware = _rig(rig), None
        if servos is not None:
            values = ServoNodeParameters(rig=str(rig), servos=str(servos), backend=backend)
            hardware = ServoHardware(values, RetryParameters())
        body = CameraBody(*sources, described, hardware)
        try:
            return cls(body, gaze=gaze, metric=metric)
        except BaseException:
            body.close()
            raise

    @property
    def time_s(self) -> float:
        """The present on the body's clock."""
        return self.body.time_s

    @property
    def pictures(self) -> tuple[Pixels, Pixels]:
        """The newest pair as it was taken, (h, w, 3) BGR each; a pixel of `look_at` is one of these."""
        pair = self._vision.newest
        if pair is None:
            self._step_to_first_pair()
            pair = self._vision.newest
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
                self._vision.add_joints(one)
                angles = dict(zip(JOINT_NAMES, one.angles_rad.tolist(), strict=True))
                observations.append(JointReport(one.stamp_ns * 1e-9, angles))
            else:
                if recorder is not None:
                    recorder.on_picture(one, now_ns)
                self._vision.add_picture(one, now_ns)
        observations += self._vision.observe(now_ns)
        self._images = self._vision.images or self._images
        command = self._controller.step(now_s, observations)
        if command.track_request is not None:
            self._vision.request_track(command.track_request)
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
        if self._vision.newest is None:
            self._step_to_first_pair()
        pair = self._vision.newest
        stamp_s = math.nan if pair is None else pair.left_stamp_ns * 1e-9
        request = Request(pixel, stereo_pixel, point_m, angles_rad, turn_rad, eye, depth_m, time_limit_s)
        goal = request.goal(self._images, stamp_s)
        self._controller.check(goal, self.time_s)
        look = Look(self._controller.look_at(goal, self.time_s), self.step)
        self._looks[look.goal_id] = look
        return look

    def measure(self) -> Measurement:
        """Return what the newest pair shows: metric I, contrast, signed disparity, the followed target."""
        found = self._vision.measurement()
        if found is None:
            self._step_to_first_pair()
            found = self._vision.measurement()
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

    def __enter__(self) -> "Head":
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
        while self._vision.newest is None:
            self.step()
            if self.time_s > end_s:
                fault = self._vision.fault or "no pair has arrived"
                raise BodyError(f"the head must give pictures within {_FIRST_PAIR_S:g} s: {fault}")


def _rig(rig: Rig | str | Path) -> Rig:
    return rig if isinstance(rig, Rig) else load_rig(rig)
