"""Pictures and segmentations of a MuJoCo world through one of its eyes."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from vergence_sim.unit_meshes import UnitMeshes

Image = NDArray[np.uint8]


class EyeRenderer:
    """Renders a model as its data stand, without shadows, through the eye chosen by `look_with`."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, size_px: tuple[int, int]) -> None:
        """Open a context of its own; `size_px` is (width, height)."""
        self._model, self._data, self._size_px = model, data, size_px
        self._context = mujoco.GLContext(*size_px)
        self._context.make_current()
        self._scene = mujoco.MjvScene(model, maxgeom=1000)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        self._mjr = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._mjr)
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._unit_meshes = UnitMeshes(model)
        self.look_with("left")

    def look_with(self, eye: str) -> None:
        """Choose the eye by its camera's name."""
        self.eye = eye
        self._camera.fixedcamid = self._model.camera(eye).id

    def close(self) -> None:
        """Free the renderer."""
        self._mjr.free()
        self._context.free()

    def _update_scene(self) -> None:
        mujoco.mjv_updateScene(
            self._model,
            self._data,
            mujoco.MjvOption(),
            mujoco.MjvPerturb(),
            self._camera,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )
        self._unit_meshes.put_in(self._scene)

    def _pixels(self) -> Image:
        width, height = self._size_px
        rgb = np.empty((height, width, 3), np.uint8)
        viewport = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(viewport, self._scene, self._mjr)
        mujoco.mjr_readPixels(rgb, None, viewport, self._mjr)
        return rgb[::-1]

    def render(self) -> Image:
        """Return (height, width, 3) BGR."""
        self._context.make_current()
        self._update_scene()
        return np.ascontiguousarray(self._pixels()[:, :, ::-1])

    def segmentation(self) -> NDArray[np.int32]:
        """Return for every pixel the geom seen there, -1 for none (height, width)."""
        self._context.make_current()
        self._update_scene()
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = 1
        self._scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 1
        codes = self._pixels().astype(np.int32)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = 0
        self._scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = 0
        numbers = codes[:, :, 0] + codes[:, :, 1] * 256 + codes[:, :, 2] * 65536
        of_scene = np.full(self._scene.ngeom + 1, -1, np.int32)
        for i in range(self._scene.ngeom):
            geom = self._scene.geoms[i]
            if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.segid >= 0:
                of_scene[geom.segid + 1] = geom.objid
        return of_scene[np.clip(numbers, 0, self._scene.ngeom)]
