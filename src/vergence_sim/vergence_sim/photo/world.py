"""A pair of photographs in lockstep, without ROS: command joints, let time pass, take pictures, ask for the truth."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import EyeAngles
from vergence_rig.rig import CameraSpec, Rig, default_rig
from vergence_sim.optics import Lens, Sensor, motion_blurred
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.joints import PhotoHead, Plant
from vergence_sim.photo.pair import PhotoPair, PhotoPoint
from vergence_sim.photo.views import PhotoEye, mount_rotation
from vergence_sim.world import EYES

Image = npt.NDArray[np.uint8]


class PhotoWorld:
    """A head before a pair of photographs. Deterministic: the same parameters and calls give the same pictures.

    Time is `time_s`, from 0, and moves only by `advance_to`. The eyes' baseline plays no part: angles are all there is.
    """

    def __init__(
        self,
        pair: PhotoPair,
        parameters: SimParameters | None = None,
        rig: Rig | None = None,
        plant: Plant | None = None,
    ) -> None:
        self.pair = pair
        self.parameters = (parameters or SimParameters()).effective()
        self.rig = rig or default_rig()
        self.head = PhotoHead(self.rig, plant)
        self.time_s = 0.0
        p = self.parameters
        cameras = {"left": self.rig.left_camera, "right": self.rig.right_camera}
        mounts = {"left": (p.left_camera.roll_rad, 0.0), "right": (p.right_camera.roll_rad, p.right_camera.pitch_rad)}
        self.lenses = {eye: Lens(camera, p.camera.distortion) for eye, camera in cameras.items()}
        *photographs, matrix = pair.seen_at(self.rig.left_camera.fx_px)
        self._eyes = {
            eye: PhotoEye(photograph, matrix, self.lenses[eye], mount_rotation(*mounts[eye]))
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
        joints, rates, parameters = self.head.true_rad, self.head.velocity_rad_s, self.parameters
        lens, pan = self.lenses[eye], f"pan_{eye}"
        smear = lens.camera.fx_px * parameters.camera.exposure_s
        motion_px = smear * rates[pan], smear * rates["tilt"]

        def develop() -> Image:
            view = motion_blurred(self._eyes[eye].view(joints[pan], joints["tilt"]), motion_px)
            return self._sensors[eye].apply(lens.apply(view), parameters)

        return develop

    def view(self, eye: str) -> Image:
        """Return what one eye, "left" or "right", sees now: (h, w, 3) BGR uint8."""
        return self.expose(eye)()

    def errors_to(self, point: PhotoPoint) -> tuple[float, float, float]:
        """Return how much vergence, version and tilt are short of a point of the photographs [rad]."""
        wanted, present = self.pair.fixation(point), self.eye_angles
        return (
            wanted.vergence_rad - present.vergence_rad,
            wanted.version_rad - present.version_rad,
            wanted.tilt_rad - present.tilt_rad,
        )

    def project(self, eye: str, point: PhotoPoint) -> tuple[float, float]:
        """Return the pixel (x, y) of an eye's image, as its lens distorts it, at which a point is seen now."""
        joints, rays = self.head.true_rad, self.pair.rays(point)
        return self._eyes[eye].project(rays[EYES.index(eye)], joints[f"pan_{eye}"], joints["tilt"])

    def outside_share(self, eye: str) -> float:
        """Return the share of an eye's view that now lies outside its photograph."""
        joints = self.head.true_rad
        return self._eyes[eye].outside_share(joints[f"pan_{eye}"], joints["tilt"])

    @property
    def eye_angles(self) -> EyeAngles:
        """Where the shafts really are."""
        joints = self.head.true_rad
        return EyeAngles(joints["pan_left"], joints["pan_right"], joints["tilt"])

    def close(self) -> None:
        """Nothing is held."""

    def joint_states(self) -> dict[str, float]:
        """Return the joint angles as a driver of servos without feedback publishes them [rad]."""
        return self.head.modelled_rad

    def true_joints(self) -> dict[str, float]:
        """Return where the shafts really are [rad]."""
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
