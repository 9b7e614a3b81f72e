"""Offscreen rendering of both eyes with MuJoCo, on EGL or OSMesa."""

import ctypes
import math
import os
import threading
from collections.abc import Mapping
from typing import Any

import cv2
import mujoco
import numpy as np
import numpy.typing as npt

from vergence_sim.model_builder import HIDDEN_GROUP
from vergence_sim.unit_meshes import UnitMeshes

Image = npt.NDArray[np.uint8]

_GL_RGBA, _GL_UNSIGNED_BYTE = 0x1908, 0x1401
_GL_FRAMEBUFFER, _GL_RENDERBUFFER, _GL_DEPTH_COMPONENT32F = 0x8D40, 0x8D41, 0x8CAC
_GL_DEPTH_ATTACHMENT, _GL_STENCIL_ATTACHMENT = 0x8D00, 0x8D20
# Simulators share a model, whose shapes outside a view are hidden while that view's scene is made.
_MODEL_LOCK = threading.Lock()


class RenderError(RuntimeError):
    """This machine cannot render offscreen."""


class EyeRenderer:
    """Renders named cameras of a model as (h, w, 4) RGBA uint8, each in its own size, `sizes_px` (width, height)."""

    def __init__(self, model: Any, sizes_px: Mapping[str, tuple[int, int]]) -> None:
        width_px, height_px = (max(sides) for sides in zip(*sizes_px.values(), strict=True))
        self._context: Any = None
        try:
            self._context = mujoco.GLContext(width_px, height_px)
            self._context.make_current()
            self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
            self._gl = _opengl()
            if not self._mjr.offSamples:
                self._drop_stencil()
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
        self._unit_meshes = UnitMeshes(model)
        self._pixels = np.empty((height_px, width_px, 4), np.uint8)

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
        viewport = self._viewports[camera]
        self._update_scene(data, viewport.width / viewport.height)
        mujoco.mjr_render(viewport, self._scene, self._mjr)
        # OpenGL's rows run upwards.
        return np.asarray(cv2.flip(self._read(viewport), 0), np.uint8)

    def _update_scene(self, data: Any, aspect: float) -> None:
        groups = self._model.geom_group
        with _MODEL_LOCK:
            visible = groups.copy()
            groups[_outside(self._model, data, self._camera.fixedcamid, aspect)] = HIDDEN_GROUP
            mujoco.mjv_updateScene(
                self._model, data, self._options, self._perturb, self._camera, mujoco.mjtCatBit.mjCAT_ALL, self._scene
            )
            groups[:] = visible
        self._unit_meshes.put_in(self._scene)

    def _drop_stencil(self) -> None:
        """Give the frame a depth buffer alone: with a stencil, which only reflections need, it is twice as large."""
        gl, buffer, size_px = self._gl, self._mjr.offDepthStencil, (self._mjr.offWidth, self._mjr.offHeight)
        gl.glBindFramebuffer(_GL_FRAMEBUFFER, self._mjr.offFBO)
        gl.glFramebufferRenderbuffer(_GL_FRAMEBUFFER, _GL_STENCIL_ATTACHMENT, _GL_RENDERBUFFER, 0)
        gl.glBindRenderbuffer(_GL_RENDERBUFFER, buffer)
        gl.glRenderbufferStorage(_GL_RENDERBUFFER, _GL_DEPTH_COMPONENT32F, *size_px)
        gl.glFramebufferRenderbuffer(_GL_FRAMEBUFFER, _GL_DEPTH_ATTACHMENT, _GL_RENDERBUFFER, buffer)

    def _read(self, viewport: Any) -> Image:
        """Return the pixels just drawn (h, w, 4) RGBA, rows upwards, until the next are read."""
        if self._mjr.offSamples:
            rgb = np.empty((viewport.height, viewport.width, 3), np.uint8)
            mujoco.mjr_readPixels(rgb, None, viewport, self._mjr)
            return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2RGBA), np.uint8)
        # In the format in which they are stored: Mesa takes ten times as long to turn them into RGB.
        size, pixels = (viewport.width, viewport.height), self._pixels
        self._gl.glReadPixels(0, 0, *size, _GL_RGBA, _GL_UNSIGNED_BYTE, pixels.ctypes.data_as(ctypes.c_void_p))
        return pixels.reshape(-1)[: 4 * size[0] * size[1]].reshape(size[1], size[0], 4)

    def close(self) -> None:
        """Free the context and its buffers; idempotent."""
        if self._context is not None:
            self._context.make_current()
            self._mjr.free()
            self._context.free()
            self._context = None


def _opengl() -> Any:
    """Return the OpenGL library that MuJoCo draws with."""
    from OpenGL import platform  # MuJoCo's own binding; where there is no OpenGL it cannot be imported

    return platform.PLATFORM.GL


def _outside(model: Any, data: Any, camera_id: int, aspect: float) -> npt.NDArray[np.bool_]:
    """Return which shapes' bounding spheres are wholly outside a camera's view (N,); OpenGL would clip each."""
    points = (data.geom_xpos - data.cam_xpos[camera_id]) @ data.cam_xmat[camera_id].reshape(3, 3)
    radii = np.where(model.geom_rbound > 0, model.geom_rbound, np.inf)  # planes have none
    ahead = -points[:, 2]
    outside = ahead < -radii
    half_height = math.tan(0.5 * math.radians(model.cam_fovy[camera_id]))
    for across, half in ((points[:, 0], half_height * aspect), (points[:, 1], half_height)):
        outside |= np.abs(across) - half * ahead > radii * math.hypot(1.0, half)
    return np.asarray(outside, np.bool_)
