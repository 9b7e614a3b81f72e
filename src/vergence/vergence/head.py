"""A head in one process: `from vergence import Head`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vergence.head_loop import NONE, HeadLoop
from vergence_rig.rig import Rig, default_rig
from vergence_rig.rig_file import load_rig


class Head(HeadLoop):
    """Steers both eyes and the tilt of a body by what its eyes see.

    Made by `simulated`, `photographs`, `cameras` or `recording`; or from any body. To be closed, or used as a context
    manager. For one thread.
    """

    @classmethod
    def simulated(
        cls,
        target_m: Sequence[float] = (0.8, 0.0, 0.0),
        *,
        rig: Rig | str | Path | None = None,
        simulation: Mapping[str, Any] = NONE,
        gaze: Mapping[str, Any] = NONE,
        metric: Mapping[str, Any] = NONE,
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
        simulation: Mapping[str, Any] = NONE,
        gaze: Mapping[str, Any] = NONE,
        metric: Mapping[str, Any] = NONE,
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
        metric: Mapping[str, Any] = NONE,
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
        gaze: Mapping[str, Any] = NONE,
        metric: Mapping[str, Any] = NONE,
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


def _rig(rig: Rig | str | Path) -> Rig:
    return rig if isinstance(rig, Rig) else load_rig(rig)
