"""Line plots as inline SVG, without a plotting library."""

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

_WIDTH, _HEIGHT = 560, 220
_LEFT, _RIGHT, _TOP, _BOTTOM = 52, 12, 26, 34


@dataclass(frozen=True)
class Line:
    """One line of a plot: x and y (N,), NaN leaves a gap."""

    label: str
    x: Any
    y: Any
    colour: str
    dashed: bool = False


def plot(title: str, x_label: str, y_label: str, lines: Sequence[Line]) -> str:
    """Return an <svg> element with the lines, axes, ticks and a legend."""
    xs = np.concatenate([np.asarray(line.x, np.float64) for line in lines] or [np.zeros(1)])
    ys = np.concatenate([np.asarray(line.y, np.float64) for line in lines] or [np.zeros(1)])
    x_low, x_high = _limits(xs)
    y_low, y_high = _limits(ys)
    inner_width, inner_height = _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM

    def place(x: float, y: float) -> tuple[float, float]:
        return (
            _LEFT + inner_width * (x - x_low) / (x_high - x_low),
            _TOP + inner_height * (1 - (y - y_low) / (y_high - y_low)),
        )

    parts = [f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" class="plot" role="img" aria-label="{html.escape(title)}">']
    for tick in _ticks(y_low, y_high):
        _, y = place(x_low, tick)
        parts.append(f'<line x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{y:.1f}" y2="{y:.1f}" class="grid"/>')
        parts.append(f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for tick in _ticks(x_low, x_high):
        x, _ = place(tick, y_low)
        parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{_TOP}" y2="{_HEIGHT - _BOTTOM}" class="grid"/>')
        parts.append(f'<text x="{x:.1f}" y="{_HEIGHT - _BOTTOM + 14}" text-anchor="middle">{tick:g}</text>')
    for line in lines:
        dash = ' stroke-dasharray="5 4"' if line.dashed else ""
        for points in _runs(line, place):
            parts.append(f'<polyline points="{points}" fill="none" stroke="{line.colour}" stroke-width="1.6"{dash}/>')
    x = _LEFT
    for line in lines:
        parts.append(f'<text x="{x}" y="14" fill="{line.colour}">{html.escape(line.label)}</text>')
        x += 8 * len(line.label) + 14
    parts.append(f'<text x="{_WIDTH - _RIGHT}" y="{_HEIGHT - 4}" text-anchor="end">{html.escape(x_label)}</text>')
    parts.append(f'<text x="4" y="{_HEIGHT - 4}">{html.escape(y_label)}</text></svg>')
    return f"<figure>{''.join(parts)}<figcaption>{html.escape(title)}</figcaption></figure>"


def _limits(values: Any) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    margin = 0.05 * (high - low) or 0.5
    return low - margin, high + margin


def _ticks(low: float, high: float) -> list[float]:
    raw = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= raw)
    return [round(i * step, 10) for i in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _runs(line: Line, place: Any) -> list[str]:
    runs: list[list[str]] = [[]]
    for x, y in zip(np.asarray(line.x, np.float64), np.asarray(line.y, np.float64), strict=True):
        if math.isfinite(x) and math.isfinite(y):
            runs[-1].append("{:.1f},{:.1f}".format(*place(x, y)))
        elif runs[-1]:
            runs.append([])
    return [" ".join(points) for points in runs if len(points) > 1]
