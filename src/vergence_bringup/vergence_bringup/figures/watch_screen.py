"""The screen of `vergence watch`: lines of text from the newest messages."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from vergence_bringup.figures.distance_text import distance_text
from vergence_rig.stream import Stream

_STALE_S = 1.0
_COLOURS = {"good": "32", "warn": "33", "bad": "31", "dim": "2", "bold": "1"}
_LEVELS = {0: ("ok", "good"), 1: ("warn", "warn"), 2: ("ERROR", "bad"), 3: ("stale", "warn")}


@dataclass(frozen=True)
class Snapshot:
    """State at one moment: monotonic and wall time [s], streams by topic, health by diagnostic name."""

    now_s: float
    wall_s: float
    streams: Mapping[str, Stream]
    health: Mapping[str, tuple[int, str, float]]


class Screen:
    """Turns snapshots into lines. `limits_rad` are the joints' by name."""

    def __init__(self, limits_rad: Mapping[str, tuple[float, float]]) -> None:
        self._limits = limits_rad

    def lines(self, snapshot: Snapshot, width: int, colour: bool) -> list[str]:
        """Return the lines of one view, none longer than `width` characters; `colour` adds ANSI colours."""
        painter = _Painter(width, colour)
        lines = [painter.line(("bold", "vergence watch"), ("dim", "   q ends"))]
        for title, part in (
            ("gaze", self._gaze(snapshot)),
            ("metric", self._metric(snapshot)),
            ("joints", self._joints(snapshot)),
            ("topics", self._topics(snapshot)),
            ("health", self._health(snapshot)),
        ):
            lines += ["", painter.line(("bold", title))]
            lines += [painter.line(*pieces) for pieces in part]
        return lines

    def _gaze(self, snapshot: Snapshot) -> Iterator[tuple[tuple[str, str], ...]]:
        stream = snapshot.streams["gaze/state"]
        state = stream.message
        if state is None:
            yield (("dim", "  no gaze/state yet"),)
            return
        style = "" if snapshot.now_s - stream.arrived_s < _STALE_S else "dim"
        judged = ("good", "verged") if state.verged else ("warn", "not verged")
        yield ((style or "bold", f"  {state.phase_name:<8} "), judged, (style, f"  {state.reason}"))
        if state.attention not in ("", "disabled"):
            yield ((style, f"  attention {state.attention}"),)
        residuals = (state.version_residual_rad, state.vergence_residual_rad, state.tilt_residual_rad)
        yield (
            (style, f"  version {_degrees(state.version_rad)}  vergence {_degrees(state.vergence_rad)}"),
            (style, f"  tilt {_degrees(state.tilt_rad)}   residuals {' '.join(_degrees(r) for r in residuals)}"),
        )
        yield ((style, f"  distance {_reach(state) or '-'}  law {state.law}  mode {state.mode}"),)

    def _metric(self, snapshot: Snapshot) -> Iterator[tuple[tuple[str, str], ...]]:
        edge, error = snapshot.streams["vergence/edge"].message, snapshot.streams["vergence/error"].message
        if edge is None:
            yield (("dim", "  no vergence/edge yet"),)
        else:
            yield (("dim", "  window  left-to-right  right-to-left  contrast"),)
            rows = zip(
                edge.windows_px, edge.left_to_right_px, edge.right_to_left_px, edge.contrast, edge.status, strict=False
            )
            for window, forth, back, contrast, status in rows:
                style = "dim" if status else "good" if contrast < 0.6 else ""
                yield ((style, f"  {window:4d} px  {_figure(forth)} px     {_figure(back)} px   {_figure(contrast)}"),)
        if error is not None:
            style = "warn" if error.status else ""
            yield (
                (style, f"  error {_figure(error.horizontal_px)} px  vertical {_figure(error.vertical_px)} px"),
                (style, f"  {_degrees(error.horizontal_rad)}  confidence {_figure(error.confidence)}"),
                (style, f"  {error.estimator} {error.reason}"),
            )
        box = snapshot.streams["vergence/box"].message
        if box is not None:
            found = f"{box.class_name or 'no target'} {_figure(box.center_horizontal_px)} px  {_reach(box)}".rstrip()
            found = f"{found}  {box.reason}"
            yield (("warn" if box.status else "", f"  boxes {found}"),)

    def _joints(self, snapshot: Snapshot) -> Iterator[tuple[tuple[str, str], ...]]:
        stream = snapshot.streams["joint_states"]
        if stream.message is None:
            yield (("dim", "  no joint_states yet"),)
            return
        command = snapshot.streams["joint_command"]
        commands: dict[str, float] = {}
        if command.message is not None and snapshot.now_s - command.arrived_s < _STALE_S:
            commands = dict(zip(command.message.name, command.message.position, strict=False))
        stale = snapshot.now_s - stream.arrived_s >= _STALE_S
        for name, position in zip(stream.message.name, stream.message.position, strict=False):
            low, high = self._limits.get(name, (-math.pi, math.pi))
            near = position - low < 0.02 or high - position < 0.02
            style = "dim" if stale else "warn" if near else ""
            commanded = f" -> {_degrees(commands[name])}" if name in commands else ""
            ends = f"{_degrees(low)} [{_bar(position, low, high, 24)}] {_degrees(high)}"
            yield ((style, f"  {name:<10} {_degrees(position)}  {ends}{commanded}"),)

    def _topics(self, snapshot: Snapshot) -> Iterator[tuple[tuple[str, str], ...]]:
        for topic, stream in snapshot.streams.items():
            if not stream.count:
                yield (("dim", f"  {topic:<20} silent"),)
                continue
            age_s = snapshot.now_s - stream.arrived_s
            header = getattr(stream.message, "header", None)
            text = f"  {topic:<20} {stream.rate_hz(snapshot.now_s):6.1f} Hz  {age_s:6.2f} s ago"
            if header is not None and header.stamp.sec:
                stamp_age_s = snapshot.wall_s - (header.stamp.sec + header.stamp.nanosec * 1e-9)
                text += f"  stamp {stamp_age_s:7.3f} s old"
            yield (("bad" if age_s > _STALE_S else "", text),)

    def _health(self, snapshot: Snapshot) -> Iterator[tuple[tuple[str, str], ...]]:
        if not snapshot.health:
            yield (("dim", "  no /diagnostics yet"),)
        worst_first = sorted(snapshot.health.items(), key=lambda item: (-item[1][0], item[0]))
        for name, (level, message, arrived_s) in worst_first:
            gone = snapshot.now_s - arrived_s > 3.0
            word, style = ("gone", "bad") if gone else _LEVELS.get(level, ("?", "warn"))
            yield ((style, f"  {word:<6}"), ("", f"{name}: {message}"))


class _Painter:
    def __init__(self, width: int, colour: bool) -> None:
        self._width, self._colour = max(width, 20), colour

    def line(self, *pieces: tuple[str, str]) -> str:
        left, parts = self._width, []
        for style, text in pieces:
            cut = text.replace("\n", " ")[:left]
            left -= len(cut)
            code = _COLOURS.get(style, "")
            parts.append(f"\033[{code}m{cut}\033[0m" if self._colour and code and cut else cut)
        return "".join(parts)


def _degrees(angle_rad: float) -> str:
    return "    -    " if not math.isfinite(angle_rad) else f"{math.degrees(angle_rad):+7.2f}°"


def _reach(message: Any) -> str:
    return distance_text(message.distance_m, message.distance_low_m, message.distance_high_m)


def _figure(value: float) -> str:
    return "   -  " if not math.isfinite(value) else f"{value:6.2f}"


def _bar(value: float, low: float, high: float, width: int) -> str:
    """Return a scale with a mark at `value` and a dot at zero."""
    marks = [" "] * width

    def place(at: float) -> int:
        return min(max(int((at - low) / (high - low) * width), 0), width - 1)

    if low < 0 < high:
        marks[place(0.0)] = "·"
    if math.isfinite(value):
        marks[place(value)] = "#"
    return "".join(marks)
