"""The world as a MuJoCo model: a furnished room, the head on its pedestal, movable targets and an occluder."""

import math
from dataclasses import dataclass

import cv2
import mujoco
import numpy as np

from vergence_rig.rig import Rig
from vergence_sim.parameters import SimParameters
from vergence_sim.textures import collage, cube_face, painted, wooden

HEAD_HEIGHT_M = 1.15
CUBE_SIDE_M = 0.057
MARKER_LENGTH_M, MARKER_RADIUS_M = 0.14, 0.008
_FACES = ("right", "left", "up", "down", "front", "back")
_ROOM = (-1.2, 3.8, -2.3, 2.3, 0.0, 2.6)  # x, y, z limits [m]


@dataclass(frozen=True)
class Furniture:
    """One textured box: centre and half sides [m], turned about z [rad]."""

    centre_m: tuple[float, float, float]
    half_m: tuple[float, float, float]
    yaw_rad: float
    kind: str


def _triple(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


class SceneBuilder:
    """Collects assets and bodies and compiles them."""

    def __init__(self, rig: Rig, seed: int, offsamples: int) -> None:
        self._rig = rig
        self._rng = np.random.default_rng(seed)
        self._offsamples = offsamples
        self._assets: dict[str, bytes] = {}
        self._textures: list[str] = []
        self._bodies: list[str] = []

    def _file(self, name: str, image: np.ndarray) -> str:
        self._assets[f"{name}.png"] = cv2.imencode(".png", image)[1].tobytes()
        return f"{name}.png"

    def _flat(self, name: str, image: np.ndarray) -> None:
        self._textures.append(f'<texture name="{name}" type="2d" file="{self._file(name, image)}"/>')
        self._textures.append(f'<material name="{name}" texture="{name}" texrepeat="1 1" specular="0.05"/>')

    def _cubic(self, name: str, images: list[np.ndarray]) -> None:
        files = " ".join(
            f'file{face}="{self._file(f"{name}_{face}", image)}"' for face, image in zip(_FACES, images, strict=True)
        )
        self._textures.append(f'<texture name="{name}" type="cube" {files}/>')
        self._textures.append(f'<material name="{name}" texture="{name}" specular="0.1"/>')

    def room(self) -> None:
        """Floor, ceiling, four walls with pictures on them."""
        x0, x1, y0, y1, z0, z1 = _ROOM
        rng = self._rng
        self._flat("floor", wooden(rng, 1024))
        self._flat("ceiling", painted(rng, 512, (205, 210, 212), 9))
        walls = {
            "wall_front": ((x1, 0.5 * (y0 + y1), 0.5 * (z0 + z1)), (y1 - y0) / 2, (z1 - z0) / 2, "0 -1 0 0 0 1"),
            "wall_back": ((x0, 0.5 * (y0 + y1), 0.5 * (z0 + z1)), (y1 - y0) / 2, (z1 - z0) / 2, "0 1 0 0 0 1"),
            "wall_left": ((0.5 * (x0 + x1), y1, 0.5 * (z0 + z1)), (x1 - x0) / 2, (z1 - z0) / 2, "1 0 0 0 0 1"),
            "wall_right": ((0.5 * (x0 + x1), y0, 0.5 * (z0 + z1)), (x1 - x0) / 2, (z1 - z0) / 2, "-1 0 0 0 0 1"),
        }
        for name, (centre, half_u, half_v, axes) in walls.items():
            base = tuple(int(v) for v in rng.integers(140, 205, 3))
            self._flat(name, painted(rng, 1024, base, 20))
            self._plane(name, name, centre, half_u, half_v, axes)
            for number in range(7):
                u, v = rng.uniform(-0.85, 0.85) * half_u, rng.uniform(-0.6, 0.75) * half_v
                size_u, size_v = rng.uniform(0.14, 0.42), rng.uniform(0.14, 0.36)
                picture = f"{name}_picture{number}"
                self._flat(picture, collage(rng, 384))
                right = np.array([float(word) for word in axes.split()[:3]])
                up = np.array([float(word) for word in axes.split()[3:]])
                place = np.array(centre) + right * u + up * v + np.cross(right, up) * (0.01 + 0.002 * number)
                self._plane(picture, picture, tuple(place), size_u, size_v, axes)
        self._plane("floor", "floor", (0.5 * (x0 + x1), 0, z0), (x1 - x0) / 2, (y1 - y0) / 2, "1 0 0 0 1 0")
        self._plane("ceiling", "ceiling", (0.5 * (x0 + x1), 0, z1), (x1 - x0) / 2, (y1 - y0) / 2, "1 0 0 0 -1 0")

    def _plane(self, name: str, material: str, centre: tuple, half_u: float, half_v: float, axes: str) -> None:
        place = " ".join(f"{v:.5f}" for v in centre)
        self._bodies.append(
            f'<geom name="{name}" type="plane" pos="{place}" xyaxes="{axes}" size="{half_u:.4f} {half_v:.4f} 0.1"'
            f' material="{material}"/>'
        )

    def furniture(self) -> None:
        """A table, a shelf with things on it, boxes on the floor: distractors at many depths."""
        rng = self._rng
        pieces = [
            Furniture((2.3, 0.25, 0.36), (0.5, 0.9, 0.36), 0.1, "wood"),
            Furniture((3.4, -1.5, 0.9), (0.2, 0.55, 0.9), 0.0, "wood"),
            Furniture((3.2, 1.75, 0.7), (0.3, 0.3, 0.7), 0.3, "collage"),
        ]
        for _ in range(9):
            half = _triple(rng.uniform(0.05, 0.13, 3))
            pieces.append(
                Furniture(
                    (rng.uniform(1.95, 2.7), rng.uniform(-0.5, 1.0), 0.72 + half[2]),
                    half,
                    rng.uniform(-1, 1),
                    "collage",
                )
            )
        for _ in range(8):
            half = _triple(rng.uniform(0.12, 0.3, 3))
            side = -1 if rng.random() < 0.5 else 1
            place = (rng.uniform(1.5, 3.2), side * rng.uniform(1.1, 2.0), half[2])
            pieces.append(Furniture(place, half, rng.uniform(-1, 1), "collage"))
        for number, piece in enumerate(pieces):
            name = f"furniture{number}"
            make = (lambda: wooden(rng, 384)) if piece.kind == "wood" else (lambda: collage(rng, 256, 40))
            self._cubic(name, [make() for _ in _FACES])
            centre = " ".join(f"{v:.4f}" for v in piece.centre_m)
            sides = " ".join(f"{v:.4f}" for v in piece.half_m)
            self._bodies.append(
                f'<geom name="{name}" type="box" pos="{centre}" size="{sides}" euler="0 0 {piece.yaw_rad:.3f}"'
                f' material="{name}"/>'
            )

    def targets(self) -> None:
        """The Rubik's cube, the marker pen, and an occluder: mocap bodies that go where they are put."""
        self._cubic("cube", [cube_face(self._rng) for _ in _FACES])
        half = CUBE_SIDE_M / 2
        self._bodies.append(
            f'<body name="cube" mocap="true" pos="0 0 -5"><geom name="cube" type="box" size="{half} {half} {half}"'
            ' material="cube"/></body>'
        )
        self._cubic("pen", [collage(self._rng, 128, 60) for _ in _FACES])
        self._bodies.append(
            '<body name="marker" mocap="true" pos="0 0.3 -5">'
            f'<geom name="marker" type="cylinder" size="{MARKER_RADIUS_M} {MARKER_LENGTH_M / 2}" material="pen"/>'
            f'<geom name="marker_cap" type="cylinder" pos="0 0 {MARKER_LENGTH_M * 0.36}"'
            f' size="{MARKER_RADIUS_M * 1.15} {MARKER_LENGTH_M * 0.15}" rgba="0.1 0.15 0.6 1"/></body>'
        )
        self._cubic("occluder", [collage(self._rng, 256, 60) for _ in _FACES])
        self._bodies.append(
            '<body name="occluder" mocap="true" pos="0 0.6 -5">'
            '<geom name="occluder" type="box" size="0.01 0.09 0.12" material="occluder"/></body>'
        )

    def head(self, fovy_rad: float, mounts: dict[str, tuple[float, float]]) -> None:
        """The paper's second hardware design: two pans on top of a tilt bar, a camera on each, on a turning base."""
        half = self._rig.baseline_m / 2
        eyes = "".join(
            f'<body name="{eye}_camera" pos="0 {sign * half} 0">'
            f'<joint name="pan_{eye}" type="hinge" axis="0 0 1"/>'
            '<inertial pos="0 0 0" mass="0.05" diaginertia="1e-4 1e-4 1e-4"/>'
            # Rolled about its axis and pitched: no mount is square.
            f'<body name="{eye}_lens" euler="{mounts[eye][0]} {mounts[eye][1]} 0">'
            '<inertial pos="0 0 0" mass="0.01" diaginertia="1e-5 1e-5 1e-5"/>'
            f'<camera name="{eye}" xyaxes="0 -1 0 0 0 1" fovy="{math.degrees(fovy_rad):.9f}"/></body></body>'
            for eye, sign in (("left", 1), ("right", -1))
        )
        self._bodies.append(
            f'<body name="rig_base" pos="0 0 {HEAD_HEIGHT_M}"><joint name="yaw" type="hinge" axis="0 0 1"/>'
            '<inertial pos="0 0 0" mass="1" diaginertia="1e-2 1e-2 1e-2"/>'
            '<body name="tilt_bar"><joint name="tilt" type="hinge" axis="0 1 0"/>'
            f'<inertial pos="0 0 0" mass="0.1" diaginertia="1e-3 1e-3 1e-3"/>{eyes}</body></body>'
        )

    def compile(self, width_px: int, height_px: int, light: float) -> mujoco.MjModel:
        """Return the compiled model, lit by a lamp and by light from everywhere."""
        ambient, headlight, lamp = (f"{share * light:.4f} " * 3 for share in (0.55, 0.2, 0.5))
        xml = f"""<mujoco model="vergence room"><compiler angle="radian"/>
        <visual>
          <global offwidth="{width_px}" offheight="{height_px}"/>
          <quality offsamples="{self._offsamples}" shadowsize="0"/>
          <map znear="0.002" zfar="20"/>
          <headlight ambient="{ambient}" diffuse="{headlight}" specular="0 0 0"/>
        </visual>
        <asset>{"".join(self._textures)}</asset>
        <worldbody>
          <light name="lamp" pos="1 0.4 2.5" dir="0.1 -0.1 -1" diffuse="{lamp}" specular="0.1 0.1 0.1"
            castshadow="false"/>
          {"".join(self._bodies)}
        </worldbody></mujoco>"""
        return mujoco.MjModel.from_xml_string(xml, self._assets)


def build_scene(rig: Rig, parameters: SimParameters, fovy_rad: float) -> mujoco.MjModel:
    """Return the compiled room with head and targets; `fovy_rad` is the rendered views' vertical field of view."""
    builder = SceneBuilder(rig, parameters.world_seed, parameters.samples)
    # Near things first: what is drawn behind them is never textured.
    builder.targets()
    builder.furniture()
    builder.room()
    mounts = {
        "left": (parameters.left_roll_rad, 0.0),
        "right": (parameters.right_roll_rad, parameters.right_pitch_rad),
    }
    builder.head(fovy_rad, mounts)
    return builder.compile(rig.left_camera.width_px, rig.left_camera.height_px, parameters.light)
