"""Writes a MuJoCo model: named textures and shapes in, a compiled model out."""

import copy

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from vergence_sim.surfaces import Image
from vergence_sim.unit_meshes import FACES, SHEET, SHEET_KINDS, SLICES, unit_meshes

# Seen from outside with z up, MuJoCo shows the images of the first three on their sides or upside down.
_UPRIGHT = {"right": cv2.ROTATE_90_COUNTERCLOCKWISE, "left": cv2.ROTATE_90_CLOCKWISE, "up": cv2.ROTATE_180}
_VISIBLE = 0
HIDDEN_GROUP = 3
"""Group of the head's own parts: not rendered in the eyes' images, only in a viewer."""


class ModelBuilder:
    """Collects textures and shapes. Without `textured` shapes stay grey, which compiles in milliseconds."""

    def __init__(self, textured: bool) -> None:
        self.textured = textured
        self._files: dict[str, bytes] = {}
        self._assets: list[str] = []
        self._bodies: list[str] = []
        self._wraps: dict[str, list[Image]] = {}
        self._materials: set[str] = set()
        self._shapes = 0

    def flat(self, name: str, image: Image) -> str:
        """Add a texture for planes, stretched over each once; returns its name."""
        self._assets.append(f'<texture name="{name}" type="2d" file="{self._file(name, image)}"/>')
        self._assets.append(f'<material name="{name}" texture="{name}" texrepeat="1 1" specular="0.02"/>')
        return name

    def wrap(self, name: str, images: list[Image]) -> str:
        """Name a texture around boxes, cylinders or ellipsoids: six square images as in FACES, upright from outside."""
        self._wraps[name] = images
        return name

    def shape(
        self,
        kind: str,
        centre_m: tuple[float, float, float],
        size_m: tuple[float, ...],
        material: str | tuple[float, float, float],
        turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0),
        name: str = "",
        group: int = _VISIBLE,
    ) -> str:
        """Return a geom: MuJoCo's kind and half sizes, a texture's name or a colour RGB, Euler angles x y z."""
        self._shapes += 1
        if isinstance(material, str):
            look = f'material="{self._material(kind, material)}"' if self.textured else 'rgba="0.5 0.5 0.5 1"'
        else:
            look = f'rgba="{_text(material)} 1"'
        return (
            f'<geom name="{name or f"shape{self._shapes}"}" type="{kind}" pos="{_text(centre_m)}"'
            f' size="{_text(size_m)}" euler="{_text(turn_rad)}" group="{group}" {look}/>'
        )

    def add(self, *elements: str) -> None:
        """Add shapes or bodies to the world."""
        self._bodies += elements

    def movable(self, name: str, *shapes: str, place_m: tuple[float, float, float] = (0.0, 0.0, -5.0)) -> None:
        """Add a body whose place is set from outside; it starts below the floor unless `place_m` is given."""
        self._bodies.append(f'<body name="{name}" mocap="true" pos="{_text(place_m)}">{"".join(shapes)}</body>')

    def compiled(self, size_px: tuple[int, int], samples: int, headlight: str, lights: str) -> mujoco.MjModel:
        """Return the model. `size_px` is (width, height) of its views; `headlight` and `lights` are MJCF."""
        # A side of a box in one piece (numquads): in four the lamp's light on a table is rounder, by some grey levels,
        # and a view costs a tenth more.
        xml = f"""<mujoco model="room"><compiler angle="radian"/>
        <visual>
          <global offwidth="{size_px[0]}" offheight="{size_px[1]}"/>
          <quality offsamples="{samples}" shadowsize="0" numslices="{SLICES}" numstacks="8" numquads="1"/>
          <map znear="0.002" zfar="20"/>
          {headlight}
        </visual>
        <statistic extent="1" center="0 0 1"/>
        <asset>{"".join([*unit_meshes(), *self._assets]) if self.textured else ""}</asset>
        <worldbody>{lights}{"".join(self._bodies)}</worldbody></mujoco>"""
        model = mujoco.MjModel.from_xml_string(xml, self._files)
        # The pictures stay in MuJoCo's cache and in the model's compiler, as large as the model each: drop both.
        mujoco.mj_clearCache(mujoco.mj_getCache())
        # A builder and its room refer to one another: the collector frees them late.
        self._files.clear()
        self._wraps.clear()
        return copy.copy(model)

    def _material(self, kind: str, name: str) -> str:
        """Return the material of a texture on a kind of shape; makes that of a wrapped one when it is first needed.

        A box's or ball's is one flat texture of its six sides: Mesa draws a cube texture in more than twice the time.
        """
        images = self._wraps.get(name)
        if images is None:
            return name
        material = f"{name}_sheet" if kind in SHEET_KINDS else name
        if material not in self._materials:
            self._materials.add(material)
            if kind in SHEET_KINDS:
                faces = dict(zip(FACES, images, strict=True))
                sheet = np.vstack([np.hstack([faces[face] for face in row]) for row in SHEET])
                texture = f'type="2d" file="{self._file(material, sheet)}"'
            else:
                files = {
                    face: np.asarray(cv2.rotate(image, _UPRIGHT[face]), np.uint8) if face in _UPRIGHT else image
                    for face, image in zip(FACES, images, strict=True)
                }
                texture = 'type="cube" ' + " ".join(
                    f'file{face}="{self._file(f"{name}_{face}", image)}"' for face, image in files.items()
                )
            self._assets.append(f'<texture name="{material}" {texture}/>')
            self._assets.append(f'<material name="{material}" texture="{material}" specular="0.1"/>')
        return material

    def _file(self, name: str, image: Image) -> str:
        if self.textured:
            # Uncompressed: MuJoCo unpacks it a moment later.
            self._files[f"{name}.png"] = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 0])[1].tobytes()
        return f"{name}.png"


def _text(values: tuple[float, ...] | NDArray[np.float64]) -> str:
    return " ".join(f"{value:.5f}" for value in values)
