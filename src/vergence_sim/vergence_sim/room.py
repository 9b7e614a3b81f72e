"""A furnished room about a head at the origin: x forward, y left, z up from the floor. Different for every seed.

What is nearer than two metres and in reach of a gaze (35 degrees to the sides, 20 up and down) stays free for targets.
"""

import math

import numpy as np

from vergence_sim.model_builder import ModelBuilder
from vergence_sim.pictures import book_cover, book_spines, screen, window_view
from vergence_sim.surfaces import (
    Colour,
    Image,
    bricks,
    card,
    carpet,
    cloth,
    cloud,
    grain,
    leaf,
    muted,
    plaster,
    shaded,
    wallpaper,
    wood,
)
from vergence_sim.walls import PX_PER_M, Face, wall

FRONT_M, BACK_M, SIDE_M, HEIGHT_M = 3.8, -1.2, 2.5, 2.8
"""The walls' distances along x and to both sides, and the ceiling's height."""

_Triple = tuple[float, float, float]


class Room:
    """Furnishes a model by a generator."""

    def __init__(self, builder: ModelBuilder, seed: int) -> None:
        self._builder, self._seed = builder, seed
        self._rng = np.random.default_rng([seed, 0])
        self._materials = 0
        self._mirror = 1.0 if self._rng.random() < 0.7 else -1.0

    def furnish(self) -> None:
        """Put the furniture in and things on it, near ones first: what is drawn behind them is never textured."""
        for put in (self._stool, self._table, self._plant, self._armchair, self._boxes, self._shelf, self._lamp):
            put()

    def free_table_places(self, count: int) -> list[_Triple]:
        """Return `count` places along the table's near edge, where nothing else stands."""
        rng = np.random.default_rng([self._seed, 7])
        y = self._mirror * 0.25 + 0.85 * np.linspace(-1, 1, 2 * count + 1)[1::2] if count else np.empty(0)
        return [(2.15 + float(rng.uniform(0.0, 0.04)), float(v), 0.75) for v in rng.permutation(y)]

    def shell(self) -> None:
        """Put in walls, floor, ceiling and a rug."""
        rng, length, middle = np.random.default_rng([self._seed, 6]), FRONT_M - BACK_M, 0.5 * (FRONT_M + BACK_M)
        kinds: list[Face] = [
            lambda r, s: plaster(r, s, muted(r, 150, 200, 12)),
            lambda r, s: bricks(r, s, (75, 95, 150)),
            lambda r, s: wallpaper(r, s, muted(r, 150, 205, 14)),
            lambda r, s: plaster(r, s, muted(r, 140, 200, 16)),
        ]
        order = [0, *(1 + rng.permutation(3)).tolist()]
        half = HEIGHT_M / 2
        walls: tuple[tuple[str, float, _Triple, _Triple, list[Face]], ...] = (
            ("wall_front", 2 * SIDE_M, (FRONT_M, 0.0, half), (math.pi / 2, -math.pi / 2, 0.0), [window_view]),
            ("wall_left", length, (middle, SIDE_M, half), (math.pi / 2, 0.0, 0.0), []),
            ("wall_right", length, (middle, -SIDE_M, half), (-math.pi / 2, 0.0, math.pi), []),
            ("wall_back", 2 * SIDE_M, (BACK_M, 0.0, half), (math.pi / 2, math.pi / 2, 0.0), [window_view]),
        )
        for (name, wide, centre, turn, first), kind in zip(walls, order, strict=True):
            self._materials += 1
            if self._builder.textured:
                self._builder.flat(name, wall(self._generator(), (wide, HEIGHT_M), kinds[kind], first))
            self._builder.add(self._builder.shape("plane", centre, (wide / 2, half, 1), name, turn, name))
        size = (round(2 * SIDE_M * PX_PER_M), round(length * PX_PER_M))
        ground = self._flat(lambda r, _: wood(r, size, (60, 98, 138), planks=24))
        above = self._flat(lambda r, _: plaster(r, (700, 700), (196, 200, 202)))
        self._builder.add(
            self._builder.shape("plane", (middle, 0, 0), (length / 2, SIDE_M, 1), ground, name="floor"),
            self._builder.shape(
                "plane", (middle, 0, HEIGHT_M), (length / 2, SIDE_M, 1), above, (math.pi, 0, 0), name="ceiling"
            ),
            self._builder.shape(
                "plane", (1.5, 0.2, 0.004), (0.9, 1.2, 1), self._flat(lambda r, _: carpet(r, (720, 540)))
            ),
        )

    def _stool(self) -> None:
        y = self._mirror * 1.35
        board = self._wrap(lambda r, s: wood(r, s))
        carton = self._wrap(card)
        self._box((1.35, y, 0.45), (0.2, 0.2, 0.02), board)
        for dx in (-0.15, 0.15):
            for dy in (-0.15, 0.15):
                self._box((1.35 + dx, y + dy, 0.215), (0.018, 0.018, 0.215), board)
        self._box((1.35, y, 0.57), (0.13, 0.16, 0.1), carton, float(self._rng.uniform(-0.6, 0.6)))

    def _table(self) -> None:
        rng, x, y = self._rng, 2.5, self._mirror * 0.25
        board = self._wrap(lambda r, s: wood(r, s, (62, 100, 150)), 384)
        self._box((x, y, 0.73), (0.42, 0.95, 0.02), board)
        for dx in (-0.36, 0.36):
            for dy in (-0.88, 0.88):
                self._box((x + dx, y + dy, 0.355), (0.03, 0.03, 0.355), board)
        self._box((x + 0.3, y, 0.6), (0.015, 0.86, 0.11), board)
        top = 0.75
        slots = y + np.linspace(-0.8, 0.8, 6) + rng.uniform(-0.05, 0.05, 6)
        for put, slot in zip(rng.permutation(6).tolist(), slots.tolist(), strict=True):
            things = (self._books, self._monitor, self._globe, self._mugs, self._carton, self._vase)
            things[put](x + float(rng.uniform(-0.2, 0.15)), slot, top)

    def _books(self, x: float, y: float, z: float) -> None:
        for _ in range(int(self._rng.integers(3, 6))):
            half = (float(self._rng.uniform(0.07, 0.1)), float(self._rng.uniform(0.1, 0.13)), 0.016)
            self._box((x, y, z + half[2]), half, self._wrap(book_cover, 160), float(self._rng.normal(0, 0.2)))
            z += 2 * half[2]

    def _monitor(self, x: float, y: float, z: float) -> None:
        self._box((x, y, z + 0.01), (0.09, 0.1, 0.01), (0.1, 0.1, 0.1))
        self._box((x + 0.03, y, z + 0.09), (0.012, 0.02, 0.08), (0.12, 0.12, 0.12))
        self._box((x, y, z + 0.27), (0.015, 0.2, 0.125), self._wrap(screen, 256), float(self._rng.normal(0, 0.15)))

    def _globe(self, x: float, y: float, z: float) -> None:
        self._add("cylinder", (x, y, z + 0.01), (0.06, 0.01), (0.25, 0.2, 0.15))
        self._add("cylinder", (x, y, z + 0.05), (0.008, 0.05), (0.5, 0.45, 0.3))
        self._add("sphere", (x, y, z + 0.2), (0.11,), self._wrap(_continents, 192))

    def _mugs(self, x: float, y: float, z: float) -> None:
        for dy in (-0.07, 0.06):
            self._add(
                "cylinder",
                (x + float(self._rng.normal(0, 0.03)), y + dy, z + 0.05),
                (0.04, 0.05),
                self._wrap(book_cover, 128),
            )

    def _carton(self, x: float, y: float, z: float) -> None:
        half = tuple(float(v) for v in self._rng.uniform(0.07, 0.13, 3))
        self._box(
            (x, y, z + half[2]), (half[0], half[1], half[2]), self._wrap(card), float(self._rng.uniform(-0.7, 0.7))
        )

    def _vase(self, x: float, y: float, z: float) -> None:
        self._add(
            "cylinder",
            (x, y, z + 0.08),
            (0.05, 0.08),
            self._wrap(lambda r, s: wallpaper(r, s, muted(r, 120, 210)), 128),
        )
        self._leaves(x, y, z + 0.16, 9, 0.1)

    def _plant(self) -> None:
        x, y = 2.2, -self._mirror * 1.75
        pot = self._wrap(lambda r, s: plaster(r, s, muted(r, 90, 170)))
        self._add("cylinder", (x, y, 0.2), (0.17, 0.2), pot)
        self._leaves(x, y, 0.4, 22, 0.34)

    def _leaves(self, x: float, y: float, z: float, count: int, reach: float) -> None:
        blade, rng = self._wrap(leaf, 96), self._rng
        for _ in range(count):
            turn, rise = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(0.3, 1.45))
            far = reach * float(rng.uniform(0.5, 1.0))
            place = (
                x + far * math.cos(turn) * math.cos(rise),
                y + far * math.sin(turn) * math.cos(rise),
                z + 1.5 * far * math.sin(rise),
            )
            self._add(
                "ellipsoid", place, (0.55 * far, 0.16 * far, 0.01), blade, (float(rng.normal(0, 0.4)), -rise, turn)
            )

    def _armchair(self) -> None:
        x, y = 3.0, self._mirror * 1.75
        colour = muted(self._rng, 60, 150, 40)
        stuff = self._wrap(lambda r, s: cloth(r, s, colour))
        self._box((x, y, 0.22), (0.35, 0.36, 0.2), stuff)
        self._box((x + 0.28, y, 0.6), (0.09, 0.36, 0.35), stuff)
        for dy in (-0.38, 0.38):
            self._box((x - 0.02, y + dy, 0.33), (0.33, 0.07, 0.3), stuff)
        cushion = self._wrap(lambda r, s: carpet(r, s), 128)
        self._add("ellipsoid", (x + 0.1, y, 0.58), (0.08, 0.2, 0.18), cushion, (0.0, 0.3, 0.0))

    def _boxes(self) -> None:
        rng = self._rng
        for side, x0 in ((self._mirror, 2.0), (-self._mirror, 1.3), (-self._mirror, 2.9)):
            z = 0.0
            for level in range(int(rng.integers(1, 4))):
                half = tuple(float(v) * (1 - 0.2 * level) for v in rng.uniform(0.14, 0.24, 3))
                place = (x0 + float(rng.normal(0, 0.05)), side * (2.1 + float(rng.normal(0, 0.05))), z + half[2])
                self._box(place, (half[0], half[1], half[2]), self._wrap(card), float(rng.uniform(-0.5, 0.5)))
                z += 2 * half[2]

    def _shelf(self) -> None:
        x, y, wide, tall = 3.6, -self._mirror * 1.05, 0.55, 1.9
        board = self._wrap(lambda r, s: wood(r, s, (55, 90, 135)))
        for dy in (-wide, wide):
            self._box((x, y + dy, tall / 2), (0.15, 0.015, tall / 2), board)
        for level in range(6):
            z = 0.04 + level * (tall - 0.06) / 5
            self._box((x, y, z), (0.15, wide, 0.012), board)
            if level == 5:
                self._carton(x, y + float(self._rng.uniform(-0.3, 0.3)), z + 0.012)
                break
            left = y - wide + 0.02
            while left < y + wide - 0.12:
                long = float(self._rng.uniform(0.2, 0.5))
                long = min(long, y + wide - 0.02 - left)
                if self._rng.random() < 0.85:
                    depth = float(self._rng.uniform(0.08, 0.13))
                    high = float(self._rng.uniform(0.1, 0.15))
                    face = self._wrap(book_spines, 256)
                    self._box((x - 0.02, left + long / 2, z + 0.012 + high), (depth, long / 2, high), face)
                left += long + 0.01

    def _lamp(self) -> None:
        x, y = 3.45, self._mirror * 0.95
        self._add("cylinder", (x, y, 0.02), (0.14, 0.02), (0.15, 0.15, 0.16))
        self._add("cylinder", (x, y, 0.8), (0.012, 0.8), (0.3, 0.3, 0.32))
        self._add("cylinder", (x, y, 1.7), (0.17, 0.14), self._wrap(lambda r, s: cloth(r, s, muted(r, 170, 220, 15))))

    def _box(
        self,
        centre: _Triple,
        half: _Triple,
        material: str | _Triple,
        yaw_rad: float = 0.0,
    ) -> None:
        self._add("box", centre, half, material, (0.0, 0.0, yaw_rad))

    def _add(
        self,
        kind: str,
        centre: _Triple,
        size: tuple[float, ...],
        material: str | _Triple,
        turn: _Triple = (0.0, 0.0, 0.0),
    ) -> None:
        self._builder.add(self._builder.shape(kind, centre, size, material, turn))

    def _wrap(self, face: Face, size_px: int = 192) -> str:
        self._materials += 1
        name = f"material{self._materials}"
        if self._builder.textured:
            rng = self._generator()
            self._builder.wrap(name, [face(rng, (size_px, size_px)) for _ in range(6)])
        return name

    def _flat(self, face: Face) -> str:
        self._materials += 1
        name = f"material{self._materials}"
        if self._builder.textured:
            self._builder.flat(name, face(self._generator(), (256, 256)))
        return name

    def _generator(self) -> np.random.Generator:
        # Of each texture's own, so that an untextured room is furnished alike.
        return np.random.default_rng([self._seed, 1, self._materials])


def _continents(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    land = cloud(rng, shape, 6)
    colour: Colour = (150, 95, 45)
    globe = np.empty((*shape, 3), np.float32)
    globe[:] = colour
    globe[land > 0.2] = (70, 140, 120)
    globe[land > 1.0] = (70, 110, 160)
    for line in range(0, shape[0], shape[0] // 6):
        globe[line, :] = globe[:, line] = (60, 60, 60)
    return shaded(globe, grain(rng, shape) * 4)
