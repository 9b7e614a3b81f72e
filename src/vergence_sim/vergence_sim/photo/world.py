"""A pair of photographs in lockstep, without ROS: command joints, let time pass, take pictures, ask for the truth."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import EyeAngles, angle_between, rotation_rig_from_eye
from vergence_rig.rig import JOINT_NAMES, CameraSpec, Rig, default_rig
from vergence_sim.head import Head
from vergence_sim.heads import published_cameras, simulated_head
from vergence_sim.optics import Lens, Sensor, motion_blurred
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.pair import PhotoPair, PhotoPoint
from vergence_sim.photo.views import PhotoEye, mount_rotation
from vergence_sim.world import EYES

Image = npt.NDArray[np.uint8]


class PhotoWorld:
    """A head before a pair of photographs. Deterministic: the same parameters and calls give the same pictures.

    Time is `time_s`, from 0, and moves only by `advance_to`. Angles are all there is: axes, mounts, zeros, scales and
    cameras are the head's, but where its axes and lenses are plays no part, as a photograph has no parallax.
    """

    def __init__(
        self,
        pair: PhotoPair,
        parameters: SimParameters | None = None,
        rig: Rig | None = None,
        head: Rig | None = None,
    ) -> None:
        """Put a head before the photographs.

        Args:
            pair: the photographs.
            parameters: head and cameras.
            rig: that a driver and the other nodes are given; the built-in one if none.
            head: the head that is simulated; the parameters', its images cut to the rig's size, if none.
        """
        self.pair = pair
        self.parameters = p = (parameters or SimParameters()).effective()
        self.rig = rig or default_rig()
        size_px = self.rig.left_camera.width_px, self.rig.left_camera.height_px
        built = cropped(simulated_head(p.head, self.rig), *size_px) if head is None else head
        self.head = Head(self.rig, built)
        self.time_s = 0.0
        cameras = {"left": built.left_camera, "right": built.right_camera}
        self.lenses = {eye: Lens(camera) for eye, camera in cameras.items()}
        self.calibrations = published_cameras(p.head.camera_info, self.rig, built)
        *photographs, matrix = pair.seen_at(built.left_camera.fx_px)
        self._eyes = {
            eye: PhotoEye(photograph, matrix, self.lenses[eye], mount_rotation(built.mount(eye == "left")))
            for eye, photograph in zip(EYES, photographs, strict=True)
        }
        seeds = np.random.SeedSequence(p.simulation.seed).spawn(2)
        self._sensors = {
            eye: Sensor(
                np.random.default_rng(seed), (cameras[eye].height_px, cameras[eye].width_px), right=eye == "right"
            )
            for eye, seed in zip(EYES, seeds, strict=True)
        }

    def set_parameters(self, parameters: SimParameters) -> None:
        """Change the parameters that are not fixed at the start."""
        self.parameters = parameters.effective()

    def command(self, angles_rad: Mapping[str, float], now_s: float | None = None) -> None:
        """Command joints by name [rad], at `now_s` or now."""
        self.head.command(angles_rad, self.time_s if now_s is None else now_s)

    def advance_to(self, time_s: float) -> None:
        """Let time pass until `time_s`; an earlier time changes nothing."""
        if time_s > self.time_s:
            self.time_s = time_s
            self.head.step(time_s)

    def expose(self, eye: str) -> Callable[[], Image]:
        """Expose one eye now; what is returned makes the picture of it, on any thread, one after the other."""
        axes, rates, parameters = self.head.axes_rad, self.head.axis_speeds_rad_s, self.parameters
        lens, pan = self.lenses[eye], f"pan_{eye}"
        smear = lens.camera.fx_px * parameters.camera.exposure_s
        motion_px = smear * rates[pan], smear * rates["tilt"]

        def develop() -> Image:
            view = motion_blurred(self._eyes[eye].view(axes[pan], axes["tilt"]), motion_px)
            return self._sensors[eye].apply(lens.apply(view), parameters)

        return develop

    def view(self, eye: str) -> Image:
        """Return what one eye, "left" or "right", sees now: (h, w, 3) BGR uint8."""
        return self.expose(eye)()

    def fixation(self, point: PhotoPoint) -> EyeAngles:
        """Return the angles of this head that bring a point to both foveas."""
        return self.pair.fixation(point, self.head.real.mean_pitch_rad)

    def angles_to_foveas(self, point: PhotoPoint) -> tuple[float, float]:
        """Return the angles between a point and the left and the right optical axis [rad]; NaN without its depth."""
        eyes, pitch = self.eye_angles, self.head.real.mean_pitch_rad
        level = rotation_rig_from_eye(0.0, pitch)[:, 0]
        left, right = (
            angle_between(rotation_rig_from_eye(pan, eyes.tilt_rad) @ level, ray)
            for pan, ray in zip((eyes.pan_left_rad, eyes.pan_right_rad), self.pair.rays(point), strict=True)
        )
        return left, right

    def angles_to_principal_points(self, point: PhotoPoint) -> tuple[float, float]:
        """Return the angles between a point and both cameras' own axes [rad]; NaN without its depth."""
        axes = self.head.axes_rad
        left, right = (
            angle_between(self._eyes[eye].axis(axes[f"pan_{eye}"], axes["tilt"]), ray)
            for eye, ray in zip(EYES, self.pair.rays(point), strict=True)
        )
        return left, right

    def errors_to(self, point: PhotoPoint) -> tuple[float, float, float]:
        """Return how much vergence, version and tilt are short of a point of the photographs [rad]."""
        wanted, present = self.fixation(point), self.eye_angles
        return (
            wanted.vergence_rad - present.vergence_rad,
            wanted.version_rad - present.version_rad,
            wanted.tilt_rad - present.tilt_rad,
        )

    def project(self, eye: str, point: PhotoPoint) -> tuple[float, float]:
        """Return the pixel (x, y) of an eye's image, as its lens distorts it, at which a point is seen now."""
        axes, rays = self.head.axes_rad, self.pair.rays(point)
        return self._eyes[eye].project(rays[EYES.index(eye)], axes[f"pan_{eye}"], axes["tilt"])

    def outside_share(self, eye: str) -> float:
        """Return the share of an eye's view that now lies outside its photograph."""
        axes = self.head.axes_rad
        return self._eyes[eye].outside_share(axes[f"pan_{eye}"], axes["tilt"])

    @property
    def eye_angles(self) -> EyeAngles:
        """Where both optical axes and the tilt really are."""
        true = self.head.true_rad
        return EyeAngles(*self.head.real.eye_angles([true[name] for name in JOINT_NAMES]))

    def close(self) -> None:
        """Nothing is held."""

    def joint_states(self) -> dict[str, float]:
        """Return the joint angles as a driver of servos without feedback publishes them [rad]."""
        return self.head.modelled_rad

    def true_joints(self) -> dict[str, float]:
        """Return where the shafts really are, as joints [rad]."""
        return self.head.true_rad


def cropped(rig: Rig, width_px: int, height_px: int) -> Rig:
    """Return the rig with both images cut to this size about their centres; 0 leaves a side as it is.

    A photograph fills a smaller view at more poses.
    """
    return replace(
        rig,
        left_camera=_cropped(rig.left_camera, width_px, height_px),
        right_camera=_cropped(rig.right_camera, width_px, height_px),
    )


def _cropped(camera: CameraSpec, width_px: int, height_px: int) -> CameraSpec:
    width = min(width_px, camera.width_px) or camera.width_px
    height = min(height_px, camera.height_px) or camera.height_px
    return camera.replaced(
        width_px=width,
        height_px=height,
        cx_px=camera.cx_px - 0.5 * (camera.width_px - width),
        cy_px=camera.cy_px - 0.5 * (camera.height_px - height),
    )
