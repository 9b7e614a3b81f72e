"""A binocular head in a furnished room, on MuJoCo: stands in for cameras, servos and world."""

import os

# MuJoCo reads this once, when it is imported. One rasteriser thread leaves the cores to the other nodes.
os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")
# Mesa's software rasteriser spends a third of a frame on blending between mipmaps, which nobody sees.
os.environ.setdefault("LP_PERF", "no_mip_linear")
