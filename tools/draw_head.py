"""Draws docs/pictures/head_axes.svg: the axes of a head from above and from the left, from a rig, to scale."""

import math
from pathlib import Path

import numpy as np

from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import EyeMount, Rig

PICTURE = Path(__file__).resolve().parent.parent / "docs" / "pictures" / "head_axes.svg"
RIG = Rig(
    left_mount=EyeMount(lens_x_m=0.022, lens_y_m=0.004, yaw_rad=0.06, pitch_rad=0.1),
    right_mount=EyeMount(lens_x_m=0.022, lens_y_m=-0.003, yaw_rad=-0.06, pitch_rad=0.1),
    tilt_axis_z_m=-0.045,
)
PX_PER_M, RAY_M = 3200.0, 0.045
INK, AXIS, RAY = "#333", "#1a5fb4", "#c64600"


class Sketch:
    """One view: `across` and `up` are the axes of rig_base that it shows, with signs, about a place on the page."""

    def __init__(self, across: tuple[int, float], up: tuple[int, float], origin_px: tuple[float, float]) -> None:
        self._across, self._up, self._origin = across, up, origin_px
        self.parts: list[str] = []

    def at(self, point_m: np.ndarray) -> tuple[float, float]:
        """Return the pixel (x, y) of a point (3,) [m]."""
        (i, i_sign), (j, j_sign) = self._across, self._up
        x, y = self._origin
        return x + i_sign * PX_PER_M * float(point_m[i]), y - j_sign * PX_PER_M * float(point_m[j])

    def line(self, start_m: np.ndarray, end_m: np.ndarray, colour: str, dashes: str = "", arrow: bool = False) -> None:
        """Draw a line."""
        (x1, y1), (x2, y2) = self.at(start_m), self.at(end_m)
        dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
        head = ' marker-end="url(#head)"' if arrow else ""
        ends = f'x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"'
        self.parts.append(f'<line {ends} stroke="{colour}" stroke-width="1.6"{dashed}{head}/>')

    def dot(self, point_m: np.ndarray, colour: str, radius: float = 4.0) -> None:
        """Draw a dot."""
        x, y = self.at(point_m)
        self.parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}" fill="{colour}"/>')

    def text(self, point_m: np.ndarray, text: str, dx: float = 8.0, dy: float = 4.0, colour: str = INK) -> None:
        """Write beside a point."""
        x, y = self.at(point_m)
        self.parts.append(f'<text x="{x + dx:.1f}" y="{y + dy:.1f}" fill="{colour}">{text}</text>')


def picture(rig: Rig) -> str:
    """Return the SVG: from above (x up, y to the left) and from the left (x to the left, z up)."""
    kinematics = Kinematics(rig)
    above = Sketch((1, -1.0), (0, 1.0), (190.0, 250.0))
    side = Sketch((0, -1.0), (2, 1.0), (590.0, 130.0))
    for eye, left, sign in (("left", True, 1.0), ("right", False, -1.0)):
        mount, name = rig.mount(left), f"pan_{eye}"
        pan_axis = np.array([mount.axis_x_m, sign * 0.5 * rig.baseline_m, mount.axis_z_m])
        lens = kinematics.lens(left, mount.yaw_rad, 0.0)
        end = lens + RAY_M * kinematics.axis(mount.yaw_rad, 0.0)
        for view in (above, side) if left else (above,):
            view.line(pan_axis, lens, INK, "3 3")
            view.line(lens, end, RAY, arrow=True)
            view.dot(lens, RAY)
        above.dot(pan_axis, AXIS, 5.0)
        above.text(pan_axis, name, -14.0, 20.0, AXIS)
        above.text(lens, f"{eye} lens", 9.0, 2.0, RAY)
    half = np.array([0.0, 0.5 * rig.baseline_m, 0.0])
    above.line(-half, half, AXIS)
    above.text(np.zeros(3), "baseline_m", 16.0, -8.0, AXIS)
    above.text(np.array([0.075, 0.0, 0.0]), "from above, x forward", -66.0, 0.0)
    base, forward = np.zeros(3), np.array([0.012, 0.0, 0.0])
    for view, other, names in ((above, np.array([0.0, 0.012, 0.0]), "y"), (side, np.array([0.0, 0.0, 0.012]), "z")):
        view.line(base, forward, INK, arrow=True)
        view.line(base, other, INK, arrow=True)
        view.text(other, names, 6.0, -2.0)
    above.text(base, "rig_base", 8.0, 16.0)
    mount = rig.left_mount
    upright = np.array([mount.axis_x_m, 0.0, mount.axis_z_m])
    height = np.array([0.0, 0.0, 0.03])
    side.line(upright - height, upright + height, AXIS, "8 4")
    side.text(upright + height, "pan axis", 6.0, 0.0, AXIS)
    tilt = np.array([rig.tilt_axis_x_m, 0.0, rig.tilt_axis_z_m])
    side.dot(tilt, AXIS, 5.0)
    side.text(tilt, "tilt axis (tilt_axis_x_m, tilt_axis_z_m)", -120.0, 22.0, AXIS)
    lens = kinematics.lens(True, mount.yaw_rad, 0.0)
    side.text(lens, "lens (lens_x_m, lens_z_m)", -70.0, -12.0, RAY)
    side.text(
        lens + RAY_M * kinematics.axis(mount.yaw_rad, 0.0),
        f"pitch {math.degrees(mount.pitch_rad):.0f} deg",
        -20.0,
        20.0,
        RAY,
    )
    side.text(np.array([0.035, 0.0, 0.033]), "from the left, x forward", -70.0, 0.0)
    return "\n".join(
        [
            '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 760 330" font-family="sans-serif" font-size="13">',
            '<defs><marker id="head" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="6" markerHeight="6" '
            f'orient="auto"><path d="M0 0 L10 5 L0 10 z" fill="{INK}"/></marker></defs>',
            '<rect width="760" height="330" fill="white"/>',
            *above.parts,
            *side.parts,
            "</svg>",
            "",
        ]
    )


if __name__ == "__main__":
    PICTURE.write_text(picture(RIG), encoding="utf-8")
