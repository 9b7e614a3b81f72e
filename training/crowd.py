"""The simulator's room with more movable objects: cubes, look-alikes, an occluder."""

import numpy as np

from training.look_alikes import PATTERNS, PUZZLES, SMALLEST_PX, faces
from training.textures import collage
from vergence_sim.pictures import cube_faces
from vergence_sim.scene import CUBE_SIDE_M, SceneBuilder

CUBES = 4
LOOK_ALIKES = 8


class CrowdBuilder(SceneBuilder):
    """The simulator's room with more movable objects."""

    def populate(self, puzzle_share: float) -> None:
        """Add several cubes, each scrambled its own way, look-alikes of all kinds, and an occluder."""
        rng = self._rng
        half = CUBE_SIDE_M / 2
        self.smallest_px: list[float] = []  # of each look-alike, see SMALLEST_PX
        self.puzzles: list[bool] = []
        for number in range(CUBES):
            self.wrap(f"cube{number}", cube_faces(rng))
            self._put(f"cube{number}", f'type="box" size="{half} {half} {half}"', f"cube{number}")
        for number in range(LOOK_ALIKES):
            name = f"alike{number}"
            kind = str(rng.choice(list(PUZZLES if rng.random() < puzzle_share else PATTERNS)))
            self.puzzles.append(kind in PUZZLES)
            self.smallest_px.append(SMALLEST_PX[kind])
            self.wrap(name, faces(rng, kind))
            if rng.random() < 0.75:
                sides = half * rng.uniform(0.7, 1.6, 3) if rng.random() < 0.5 else np.full(3, half)
                shape = f'type="box" size="{sides[0]} {sides[1]} {sides[2]}"'
            elif rng.random() < 0.5:
                shape = f'type="sphere" size="{half * rng.uniform(0.7, 1.4)}"'
            else:
                shape = f'type="cylinder" size="{half * rng.uniform(0.6, 1.2)} {half * rng.uniform(0.7, 2)}"'
            self._put(name, shape, name)
        self.wrap("board", [collage(rng, 128, 40) for _ in range(6)])
        self._put("board", 'type="box" size="0.01 0.06 0.09"', "board")

    def _put(self, name: str, shape: str, material: str) -> None:
        self.add(
            f'<body name="{name}" mocap="true" pos="0 0 -5"><geom name="{name}" {shape} material="{material}"/></body>'
        )
