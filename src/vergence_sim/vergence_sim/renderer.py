"""Offscreen rendering of both eyes with MuJoCo, on EGL or OSMesa."""

import os
from collections.abc import Mapping
from typing import Any

import cv2
import mujoco
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]


class RenderError(RuntimeError):
    """This machine cannot render offscreen."""


class EyeRenderer:
    """Renders named cameras of a model as (h, w, 3) BGR uint8, each in its own size, `sizes_px` (width, height)."""

    def __init__(self, model: Any, sizes_px: Mapping[str, tuple[int, int]]) -> None:
        width_px, height_px = (max(sides) for sides in zip(*sizes_px.values(), strict=True))
        self._context: Any = None
        try:
            self._context = mujoco.GLContext(width_px, height_px)
            self._context.make_current()
            self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        except Exception as error:
            raise RenderError(
                f"MuJoCo cannot render offscreen with MUJOCO_GL={os.environ.get('MUJOCO_GL', '')}: {error}; install "
                "libegl1 and libgl1-mesa-dri, or libosmesa6; set MUJOCO_GL to egl or osmesa, or not at all, before "
                "MuJoCo is imported"
            ) from error
        self._model = model
        self._scene = mujoco.MjvScene(model, maxgeom=1000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        self._options = mujoco.MjvOption()
        self._perturb = mujoco.MjvPerturb()
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)
        self._mjr.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZERONEAR
        self._viewports = {camera: mujoco.MjrRect(0, 0, *size) for camera, size in sizes_px.items()}
        self._views: dict[str, tuple[bytes, Image]] = {}
        self._pictures = {
            camera: np.empty((height, width, 3), np.uint8) for camera, (width, height) in sizes_px.items()
        }

    def render(self, data: Any, camera: str) -> Image:
        """Return the view of a camera; the same array again, not to be changed, while nothing has moved."""
        state = data.qpos.tobytes() + data.mocap_pos.tobytes() + data.mocap_quat.tobytes()
        before = self._views.get(camera)
        if before is not None and before[0] == state:
            return before[1]
        view = self._drawn(data, camera)
        self._views[camera] = state, view
        return view

    def _drawn(self, data: Any, camera: str) -> Image:
        self._context.make_current()
        self._camera.fixedcamid = self._model.camera(camera).id
        mujoco.mjv_updateScene(
            self._model, data, self._options, self._perturb, self._camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
        )
        viewport, rgb = self._viewports[camera], self._pictures[camera]
        mujoco.mjr_render(viewport, self._scene, self._mjr)
        mujoco.mjr_readPixels(rgb, None, viewport, self._mjr)
        # OpenGL's rows run upwards and its channels are RGB.
        return np.asarray(cv2.cvtColor(cv2.flip(rgb, 0), cv2.COLOR_RGB2BGR), np.uint8)

    def close(self) -> None:
        """Free the context and its buffers; idempotent."""
        if self._context is not None:
            self._context.make_current()
            self._mjr.free()
            self._context.free()
            self._context = None
