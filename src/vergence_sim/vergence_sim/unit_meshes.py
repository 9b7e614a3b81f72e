"""Meshes of half size 1 that are drawn, stretched, in place of MuJoCo's own shapes: they cost less.

A textured box or ball has one flat texture of its six sides, which Mesa draws faster than a cube texture; on a ball the
sides' pictures meet as on a cube. A cylinder has as many sides as MuJoCo's (`numslices`), but these and its ends are in
one piece each.
"""

import math
from collections.abc import Iterable, Sequence

import mujoco
import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import as_strided

FACES = ("right", "left", "up", "down", "front", "back")
"""Sides of a box, or of a ball, named as in MuJoCo's cube textures: what looks along +x, -x, +y, -y, +z, -z."""
SHEET = (("right", "up", "left"), ("down", "front", "back"))
"""Rows of a box's or ball's flat texture, each face upright as seen from outside."""
SHEET_KINDS = ("box", "ellipsoid", "sphere")
"""MuJoCo's kinds of shapes that have a sheet."""
UNIT_BOX, UNIT_BALL, UNIT_CYLINDER = "unit_box", "unit_ball", "unit_cylinder"
SLICES = 14
"""Sides of a cylinder."""

# Of each of FACES, upright: where its picture's right and its top are.
_RIGHT = np.array(((0, 1, 0), (0, -1, 0), (-1, 0, 0), (1, 0, 0), (1, 0, 0), (-1, 0, 0)))
_TOP = np.array(((0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 0, 1), (0, 1, 0), (0, 1, 0)))

_BOX, _BALLS = mujoco.mjtGeom.mjGEOM_BOX, (mujoco.mjtGeom.mjGEOM_ELLIPSOID, mujoco.mjtGeom.mjGEOM_SPHERE)
_CYLINDER, _MESH = int(mujoco.mjtGeom.mjGEOM_CYLINDER), int(mujoco.mjtGeom.mjGEOM_MESH)
_GEOM = int(mujoco.mjtObj.mjOBJ_GEOM)

_Corners = list[npt.NDArray[np.float64]]


class UnitMeshes:
    """Puts a model's meshes into scenes of it."""

    def __init__(self, model: mujoco.MjModel) -> None:
        meshes = np.full(model.ngeom, -1)
        textured = model.geom_matid >= 0
        meshes[textured & (model.geom_type == _BOX)] = model.mesh(UNIT_BOX).id
        meshes[textured & np.isin(model.geom_type, _BALLS)] = model.mesh(UNIT_BALL).id
        meshes[model.geom_type == _CYLINDER] = model.mesh(UNIT_CYLINDER).id
        self._meshes: list[int] = meshes.tolist()

    def put_in(self, scene: mujoco.MjvScene) -> None:
        """Let a scene's textured boxes and balls and its cylinders be drawn as the meshes, once after each update."""
        geoms = scene.geoms[: scene.ngeom]
        replaced = [
            number for number, geom in enumerate(geoms) if geom.objtype == _GEOM and self._meshes[geom.objid] >= 0
        ]
        if not replaced:
            return
        for geom in (geoms[number] for number in replaced):
            geom.texcoord = int(geom.type != _CYLINDER)
            geom.type, geom.dataid = _MESH, 2 * self._meshes[geom.objid]
        # Orientations (N, 3, 3) times half sizes (N, 3), of all geoms at once: one by one takes much longer.
        step = geoms[-1].size.ctypes.data - geoms[0].size.ctypes.data
        step //= max(len(geoms) - 1, 1)
        turns = as_strided(geoms[0].mat, (len(geoms), 3, 3), (step, *geoms[0].mat.strides))
        sizes = as_strided(geoms[0].size, (len(geoms), 3), (step, *geoms[0].size.strides))
        turns[replaced] *= sizes[replaced, None]


def unit_meshes() -> tuple[str, str, str]:
    """Return UNIT_BOX, UNIT_BALL and UNIT_CYLINDER as MJCF assets."""
    return _sides(UNIT_BOX, 1, False), _sides(UNIT_BALL, 4, True), _cylinder()


def _sides(name: str, parts: int, rounded: bool) -> str:
    """Return a cube of six sides in parts x parts quadrangles each, or a ball: the same, moved to distance 1."""
    corners: _Corners = []
    normals: _Corners = []
    places: _Corners = []
    faces = []
    # Parts of a ball are seen from its centre under equal angles.
    steps = np.tan(np.linspace(-math.pi / 4, math.pi / 4, parts + 1))
    for side, right, top in zip(FACES, _RIGHT, _TOP, strict=True):
        (row,) = (number for number, names in enumerate(SHEET) if side in names)
        column, outwards = SHEET[row].index(side), np.cross(right, top)
        first = len(corners)
        for up in steps:
            for across in steps:
                corner = outwards + across * right + up * top
                corners.append(corner / np.linalg.norm(corner) if rounded else corner)
                normals.append(corners[-1] if rounded else outwards)
                places.append(np.array([(column + 0.5 + 0.5 * across) / 3, (row + 0.5 - 0.5 * up) / 2]))
        for k in (first + i * (parts + 1) + j for i in range(parts) for j in range(parts)):
            faces.append((k, k + 1, k + parts + 2, k + parts + 1))
    return _mesh(name, corners, normals, faces, places)


def _cylinder() -> str:
    turns = np.linspace(0, 2 * math.pi, SLICES, endpoint=False)
    around = [np.array([math.cos(turn), math.sin(turn), 0.0]) for turn in turns]
    corners: _Corners = []
    normals: _Corners = []
    for end in (-1, 1):
        up = np.array([0.0, 0.0, end])
        corners += [place + up for place in around] * 2
        normals += [*around, *[up] * SLICES]
    lower, upper = 0, 2 * SLICES
    following = [*range(1, SLICES), 0]
    sides = [(lower + k, lower + n, upper + n, upper + k) for k, n in enumerate(following)]
    ends = [range(lower + 2 * SLICES - 1, lower + SLICES - 1, -1), range(upper + SLICES, upper + 2 * SLICES)]
    return _mesh(UNIT_CYLINDER, corners, normals, [*sides, *ends])


def _mesh(
    name: str, corners: _Corners, normals: _Corners, faces: Iterable[Sequence[int]], places: _Corners | None = None
) -> str:
    """Return a mesh as MJCF: corners (N, 3) with their normals and places in a texture (N, 2), convex polygons."""
    triangles = [(face[0], face[k], face[k + 1]) for face in faces for k in range(1, len(face) - 1)]
    values = {"vertex": corners, "normal": normals, "face": triangles} | ({"texcoord": places} if places else {})
    text = " ".join(
        f'{key}="{" ".join(f"{v:.9g}" for v in np.asarray(value, np.float64).ravel())}"'
        for key, value in values.items()
    )
    return f'<mesh name="{name}" {text}/>'
