"""A binocular head in a furnished room, on MuJoCo: simulates cameras, servos and world."""

import ctypes
import os


def _offscreen_backend() -> str:
    """Return what MuJoCo can render with on this machine; without either it still computes."""
    for backend, libraries in (("egl", ("libEGL.so.1",)), ("osmesa", ("libOSMesa.so.8", "libOSMesa.so.6"))):
        for library in libraries:
            try:
                ctypes.CDLL(library)
            except OSError:
                continue
            return backend
    return "disabled"


# MuJoCo reads this once, when it is imported.
os.environ.setdefault("MUJOCO_GL", _offscreen_backend())
# One rasteriser thread leaves the cores to the other nodes.
os.environ.setdefault("LP_NUM_THREADS", "1")
# Mesa's software rasteriser spends a third of a frame on blending between mipmaps, which changes no image visibly.
os.environ.setdefault("LP_PERF", "no_mip_linear")
