"""Meshes drawn in place of boxes: every side shows its picture upright."""

import mujoco
import numpy as np
import pytest

from vergence_sim.model_builder import ModelBuilder
from vergence_sim.renderer import EyeRenderer, RenderError

# Where right and up are for someone who looks at a side from outside, z being up; y for the sides along z.
SEEN = {
    "right": ((0, 1, 0), (0, 0, 1)),
    "left": ((0, -1, 0), (0, 0, 1)),
    "up": ((-1, 0, 0), (0, 0, 1)),
    "down": ((1, 0, 0), (0, 0, 1)),
    "front": ((1, 0, 0), (0, 1, 0)),
    "back": ((-1, 0, 0), (0, 1, 0)),
}


def quarters(number):
    """Return a picture (64, 64, 3) BGR of quarters in blue, green, black and both, with the side's number in red."""
    picture = np.full((64, 64, 3), 40 * number, np.uint8)
    picture[:, :, :2] = 0
    picture[:32, :32, 0] = picture[:32, 32:, 1] = 250
    picture[32:, 32:, :2] = 250
    return picture


def test_every_side_of_a_box_shows_its_picture_upright():
    builder = ModelBuilder(textured=True)
    pictures = [quarters(number) for number in range(6)]
    builder.add(builder.shape("box", (0, 0, 0), (1.0, 0.5, 0.8), builder.wrap("sides", pictures)))
    for name, (right, top) in SEEN.items():
        place = 3 * np.cross(right, top)
        axes = " ".join(str(value) for value in (*right, *top))
        builder.add(f'<camera name="{name}" pos="{" ".join(map(str, place))}" xyaxes="{axes}" fovy="15"/>')
    model = builder.compiled((64, 64), 0, '<headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/>', "")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    try:
        renderer = EyeRenderer(model, dict.fromkeys(SEEN, (64, 64)))
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")
    for number, (name, picture) in enumerate(zip(SEEN, pictures, strict=True)):
        seen = renderer.render(data, name)[:, :, 2::-1].astype(int)
        for row in (16, 48):
            for column in (16, 48):
                assert seen[row, column] == pytest.approx(picture[row, column].astype(int), abs=3), (name, number)
    renderer.close()
