"""The world as a MuJoCo model: a furnished room, the head on its pedestal, movable targets and an occluder."""

import functools
from collections.abc import Sequence

import cv2
import mujoco
import numpy as np

from vergence_rig.head_bodies import BASE, CAMERAS, EYES
from vergence_rig.head_mjcf import camera_mjcf, mjcf_bodies
from vergence_rig.rig import Rig
from vergence_sim.memory import discard_pages, return_free_memory
from vergence_sim.model_builder import HIDDEN_GROUP, ModelBuilder
from vergence_sim.parameters import TARGETS, SimParameters
from vergence_sim.persons import BOARD_HALF_M, PERSONS
from vergence_sim.pictures import book_cover, cube_faces, look_alike_faces
from vergence_sim.portraits import portrait
from vergence_sim.room import Room
from vergence_sim.surfaces import Image, cloth, shaded, wood
from vergence_sim.true_gaze import fovea_sites
from vergence_sim.unit_meshes import FACES

HEAD_HEIGHT_M = 1.15
STAND = "stand"
"""The body that carries rig_base, and does not turn with it."""
CUBE_SIDE_M = 0.057
MARKER_LENGTH_M, MARKER_RADIUS_M = 0.14, 0.010
BOX_SIDES_M = (0.07, 0.09, 0.11)
"""Depth, width and height of the textured box."""
THIN_LENGTH_M = 0.24
THIN_WIDTHS_M = {"straw": 0.006, "cable": 0.011, "stick": 0.020}
"""Upright round targets whose images are 5 to 15 px wide within reach, by name."""
EXTRA_CUBES = ("cube2", "cube3", "cube4")
DISTRACTOR_SIDE_M = 0.06
OBJECTS = (*TARGETS, "occluder", "distractor", *EXTRA_CUBES, *PERSONS)
"""Movable objects; extra cubes and persons only where the room has them."""


class SceneBuilder(ModelBuilder):
    """A model with a room, targets and the head, each added by its own method."""

    def __init__(self, rig: Rig, seed: int, samples: int, textured: bool = True) -> None:
        super().__init__(textured)
        self._rig, self._seed, self._samples = rig, seed, samples
        self._rng = np.random.default_rng(seed)
        self._room = Room(self, seed)

    def room(self) -> None:
        """Floor, ceiling, four walls with pictures and a window."""
        self._room.shell()

    def furniture(self) -> None:
        """A table, a shelf and more with things on them: distractors at many depths."""
        self._room.furnish()

    def targets(self) -> None:
        """Add the Rubik's cube, the marker pen, a textured box and an occluder: movable bodies."""
        half = CUBE_SIDE_M / 2
        cube = self._wrapped("cube", cube_faces(np.random.default_rng([self._seed, 2])))
        self.movable("cube", self.shape("box", (0, 0, 0), (half, half, half), cube, name="cube"))
        radius, length = MARKER_RADIUS_M, MARKER_LENGTH_M
        cap: tuple[float, float, float] = (0.1, 0.15, 0.6)
        self.movable(
            "marker",
            *self._stacked("marker", radius, (-0.5 * length, 0.26 * length), self._pen_labels(length, radius)),
            self.shape("cylinder", (0, 0, 0.36 * length), (1.15 * radius, 0.14 * length), cap, name="marker_cap"),
            self.shape(
                "cylinder", (0, 0, 0.2 * length), (1.18 * radius, 0.02 * length), (0.9, 0.9, 0.88), name="marker_ring"
            ),
        )
        covers = [book_cover(np.random.default_rng([self._seed, 12, face]), (256, 256)) for face in range(6)]
        sides = (BOX_SIDES_M[0] / 2, BOX_SIDES_M[1] / 2, BOX_SIDES_M[2] / 2)
        self.movable("box", self.shape("box", (0, 0, 0), sides, self._wrapped("box", covers), name="box"))
        board = [book_cover(np.random.default_rng([self._seed, 4, face]), (256, 256)) for face in range(6)]
        self.movable(
            "occluder",
            self.shape("box", (0, 0, 0), (0.01, 0.09, 0.12), self._wrapped("occluder", board), name="occluder"),
        )

    def distractor(self, kind: str) -> None:
        """Add a box of the cube's size and colours that is no Rubik's cube, of a kind of DISTRACTORS."""
        side = DISTRACTOR_SIDE_M / 2
        alike = self._wrapped("distractor", look_alike_faces(np.random.default_rng([self._seed, 10]), kind=kind))
        self.movable("distractor", self.shape("box", (0, 0, 0), (side, side, side), alike, name="distractor"))

    def thin(self) -> None:
        """Add upright things a few pixels wide, movable: a striped straw, a cable with marks, a wooden stick."""
        rng, half = np.random.default_rng([self._seed, 11]), THIN_LENGTH_M / 2
        radii = {name: width / 2 for name, width in THIN_WIDTHS_M.items()}
        paper, ink = (0.9, 0.9, 0.88), _colour(rng, 0.1, 0.65)
        self.movable("straw", *self._stacked("straw", radii["straw"], (-half, half), [paper, ink] * 10))
        sheath, mark = _colour(rng, 0.12, 0.25), _colour(rng, 0.6, 0.9)
        places = rng.uniform(-0.95 * half, 0.95 * half, 12).tolist()
        marks = [
            self.shape("cylinder", (0, 0, z), (1.02 * radii["cable"], 0.0015), mark, name=f"cable_mark{number}")
            for number, z in enumerate(places)
        ]
        self.movable("cable", *self._stacked("cable", radii["cable"], (-half, half), [sheath]), *marks)
        grain = [
            self._wrapped(f"stick_wood{kind}", [np.rot90(wood(rng, (96, 96), (80, 130, 175))) for _ in range(6)])
            for kind in range(3)
        ]
        self.movable("stick", *self._stacked("stick", radii["stick"], (-half, half), grain * 4))

    def _stacked(
        self, name: str, radius: float, ends: tuple[float, float], looks: Sequence[str | tuple[float, float, float]]
    ) -> list[str]:
        """Return an upright cylinder between two heights, in one piece a look, a texture's name or a colour RGB.

        A texture is undistorted only on a piece as high as wide.
        """
        low, half = ends[0], 0.5 * (ends[1] - ends[0]) / len(looks)
        return [
            self.shape("cylinder", (0, 0, low + (2 * number + 1) * half), (radius, half), look, name=f"{name}{number}")
            for number, look in enumerate(looks)
        ]

    def _pen_labels(self, length: float, radius: float) -> list[str]:
        """Return the textures of the pieces of a pen's barrel."""
        return [
            self._wrapped(
                f"marker{number}",
                [_pen_label(np.random.default_rng([self._seed, 3, number, face])) for face in range(6)],
            )
            for number in range(max(1, round(0.76 * length / (2 * radius))))
        ]

    def crowd(self, extra_cubes: int, look_alikes: int) -> None:
        """Add more Rubik's cubes on the table, and objects that share their colours or their pattern."""
        half = CUBE_SIDE_M / 2
        places = self._room.free_table_places(extra_cubes + look_alikes)
        for number, name in enumerate(EXTRA_CUBES[:extra_cubes]):
            x, y, z = places[number]
            faces = self._wrapped(name, cube_faces(np.random.default_rng([self._seed, 8, number])))
            shape = self.shape("box", (0, 0, 0), (half, half, half), faces, name=name)
            self.movable(name, shape, place_m=(x, y, z + half))
        for number, (x, y, z) in enumerate(places[extra_cubes:]):
            rng = np.random.default_rng([self._seed, 9, number])
            name, side = f"look_alike{number}", half * float(rng.uniform(0.8, 1.5))
            faces = self._wrapped(name, look_alike_faces(rng))
            turn = (0.0, 0.0, float(rng.uniform(-0.7, 0.7)))
            self.add(self.shape("box", (x, y, z + side), (side, side, side), faces, turn, name))

    def persons(self, count: int) -> None:
        """Add boards with portraits on both sides, which stand for persons."""
        for number, name in enumerate(PERSONS[:count]):
            front = portrait(number, self._seed)
            edge = np.full((8, 8, 3), 90, np.uint8)
            sides = [front if face in ("right", "left") else edge for face in FACES]
            squares = [cv2.resize(side, (256, 256), interpolation=cv2.INTER_AREA) for side in sides]
            board = self._wrapped(name, [np.asarray(square, np.uint8) for square in squares])
            self.movable(name, self.shape("box", (0, 0, 0), BOARD_HALF_M, board, name=name))

    def head(self, fovy_rad: tuple[float, float]) -> None:
        """The rig's head on a post: two pans on top of a tilt bar, a camera on each, all on a base that turns.

        The head's own parts are in HIDDEN_GROUP.
        """
        below = 0.09 - min(self._rig.tilt_axis_z_m, 0.0)
        height = HEAD_HEIGHT_M - below
        steel = (0.6, 0.62, 0.64)
        post = self.shape("cylinder", (0, 0, -below - height / 2), (0.015, height / 2), steel, group=HIDDEN_GROUP)
        inside = {BASE: '<joint name="yaw" type="hinge" axis="0 0 1"/>' + post} | fovea_sites(self._rig)
        inside |= {CAMERAS[eye]: camera_mjcf(eye, self._rig, fovy) for eye, fovy in zip(EYES, fovy_rad, strict=True)}
        bodies = mjcf_bodies(self._rig, inside, HIDDEN_GROUP)
        self.add(f'<body name="{STAND}" pos="0 0 {HEAD_HEIGHT_M}">{bodies}</body>')

    def compile(self, width_px: int, height_px: int, light: float) -> mujoco.MjModel:
        """Return the compiled model, lit by a ceiling lamp, a window's light and light from everywhere."""
        rng = np.random.default_rng([self._seed, 5])
        ambient, lamp, window = (share * light for share in (0.7, 0.5, 0.25))
        warm = 1.0 - float(rng.uniform(0.0, 0.12))
        place = f"{rng.uniform(0.5, 1.8):.3f} {rng.uniform(-0.8, 0.8):.3f} 2.6"
        side = float(rng.choice([-1.0, 1.0]))
        return self.compiled(
            (width_px, height_px),
            self._samples,
            f'<headlight ambient="{ambient} {ambient} {ambient}" diffuse="0 0 0" specular="0 0 0"/>',
            f'<light name="lamp" pos="{place}" dir="0.1 -0.1 -1" diffuse="{lamp} {lamp * (1 + warm) / 2} {lamp * warm}"'
            ' specular="0.15 0.15 0.15" castshadow="false"/>'
            f'<light name="window" directional="true" pos="0 0 2" dir="0.7 {side * 0.5} -0.5"'
            f' diffuse="{window} {window} {window}" specular="0 0 0" castshadow="false"/>',
        )

    def _wrapped(self, name: str, images: list[Image]) -> str:
        return self.wrap(name, images) if self.textured else name


def _colour(rng: np.random.Generator, darkest: float, lightest: float) -> tuple[float, float, float]:
    red, green, blue = rng.uniform(darkest, lightest, 3).tolist()
    return red, green, blue


def _pen_label(rng: np.random.Generator) -> Image:
    """Return one side of a piece of a pen's barrel (128, 128, 3): white, with coloured print."""
    barrel = shaded((215, 220, 222), np.zeros((128, 128), np.float32))
    for _ in range(26):
        x, y = rng.integers(0, 110, 2).tolist()
        width, height = rng.integers(10, 40, 2).tolist()
        barrel[y : y + height, x : x + width] = [int(v) for v in rng.integers(5, 130, 3)]
    return np.minimum(barrel, cloth(rng, (128, 128), (235, 235, 235)))


@functools.lru_cache(maxsize=4)
def _compiled(
    rig: Rig,
    seed: int,
    samples: int,
    light: float,
    fovy_rad: tuple[float, float],
    extra_cubes: int,
    look_alikes: int,
    distractor: str,
    persons: int,
    textured: bool,
) -> mujoco.MjModel:
    builder = SceneBuilder(rig, seed, samples, textured)
    # Near things first: what is drawn behind them is never textured.
    builder.targets()
    builder.thin()
    builder.distractor(distractor)
    builder.persons(persons)
    builder.crowd(extra_cubes, look_alikes)
    builder.furniture()
    builder.room()
    builder.head(fovy_rad)
    cameras = (rig.left_camera, rig.right_camera)
    width_px, height_px = max(c.width_px for c in cameras), max(c.height_px for c in cameras)
    model = builder.compile(width_px, height_px, light)
    return_free_memory()
    return model


def release_textures(model: mujoco.MjModel) -> None:
    """Free the memory of a model's textures once OpenGL has copies of them; no further renderer can be made of it."""
    _compiled.cache_clear()  # what is built next has textures again
    discard_pages(model.tex_data)


def build_scene(
    head: Rig, parameters: SimParameters, fovy_rad: tuple[float, float], textured: bool = True
) -> mujoco.MjModel:
    """Return the compiled room with head and targets; `fovy_rad` is each rendered view's vertical field of view.

    The model is cached and shared between equal parameters: do not change it.
    """
    world = parameters.world
    return _compiled(
        head,
        world.seed,
        world.samples_per_pixel,
        world.light,
        fovy_rad,
        world.extra_cubes,
        world.look_alikes,
        world.distractor,
        parameters.persons.count,
        textured,
    )
