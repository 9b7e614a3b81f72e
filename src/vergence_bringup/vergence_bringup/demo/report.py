"""The demo's report: one HTML file that contains its images and plots."""

import base64
import html
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vergence_bringup.demo import overview, photo_report
from vergence_bringup.demo.result import Series, StationResult, duration_text, verdict_line
from vergence_bringup.figures.boxes import CORNERS, signed
from vergence_bringup.figures.svg_plot import Line, plot

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 1180px; padding: 0 1rem; color: #1d2530; }
h1 { margin-bottom: 0; } h2 { margin-top: 3rem; border-top: 2px solid #e3e7ec; padding-top: 1rem; }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #e3e7ec; }
th:first-child, td:first-child { text-align: left; } th { background: #f4f6f8; }
.good { color: #17803d; font-weight: 600; } .bad { color: #b3261e; font-weight: 600; }
.row { display: grid; grid-template-columns: repeat(3, 1fr); gap: .6rem; }
.two { display: grid; grid-template-columns: repeat(2, 1fr); gap: .6rem; }
figure { margin: 0; } figure img { width: 100%; display: block; } figcaption { font-size: 13px; color: #55606e; }
.plot { width: 100%; background: #fbfcfd; } .plot text { font-size: 11px; fill: #55606e; }
.plot .grid { stroke: #e3e7ec; }
"""


def write_report(path: Path, results: Sequence[StationResult], settings: dict[str, Any], out_dir: Path) -> None:
    """Write the report; images are read from `out_dir`/pictures, where the demo wrote them."""
    parts = [
        "<!doctype html><html lang='en'><head><meta charset='utf-8'><title>Vergence demo</title>",
        f"<style>{_STYLE}</style></head><body><h1>Vergence demo</h1>",
        f"<p>{verdict_line(results)}. "
        f"Servos: {html.escape(str(settings['servo']))}, cameras: {html.escape(str(settings['cameras']))}, "
        f"{duration_text(settings)}.</p>",
    ]
    if overview.write_overview(results, out_dir / "pictures"):
        parts.append(_figure(out_dir / "pictures" / overview.FILE, overview.CAPTION))
    if "photographs" in settings:
        parts += [photo_report.introduction(settings["photographs"]), _photographs(out_dir / "pictures")]
    parts.append(_overview(results))
    parts += [_station(result, out_dir / "pictures") for result in results]
    parts.append("</body></html>\n")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(parts), encoding="utf-8")


def _overview(results: Sequence[StationResult]) -> str:
    rows = []
    for result in results:
        verdict = _verdict(result.reported_verged, "verged", "not verged")
        truth = _verdict(result.truth_agrees, result.truth_text.lower(), result.truth_text.lower())
        rows.append(
            f"<tr><td><a href='#{result.name}'>{result.name}</a></td><td>{verdict}</td><td>{truth}</td>"
            f"<td>{html.escape(result.answer) or '-'}</td><td>{_text(result.answer_s)} s</td>"
            f"<td>{_text(result.time_s)} s</td><td>{_text(result.true_error_deg)}&deg;</td>"
            f"<td>{_text(result.tolerance_deg)}&deg;</td><td>{_text(result.off_axis_deg)}&deg;</td></tr>"
        )
    columns = (
        "station",
        "reported",
        "ground truth",
        "goal's result",
        "after",
        "time to vergence",
        "vergence error",
        "tolerance",
        "target off axis",
    )
    head = "".join(f"<th>{column}</th>" for column in columns)
    return f"<table><tr>{head}</tr>{''.join(rows)}</table>"


def _station(result: StationResult, pictures: Path) -> str:
    series = result.series
    vergence = plot(
        "Vergence angle: the one that fixates the target, the true one, and the controller's estimate",
        "s",
        "deg",
        [
            Line("target", series.truth_time_s, series.wanted_vergence_deg, "#17803d", dashed=True),
            Line("true", series.truth_time_s, series.true_vergence_deg, "#1d2530"),
            Line("estimated", series.state_time_s, series.vergence_deg, "#2563eb"),
        ],
    )
    metric = plot(
        "Metric I (mean of both directions, 100 px window) and contrast (1: unrelated images, well below 1: verged)",
        "s",
        "px, 1",
        [
            Line("metric", series.time_s, series.metric_px, "#b45309"),
            Line("contrast", series.time_s, series.contrast, "#7c3aed"),
        ],
    )
    figures = [vergence, metric, *_box_plot(series)]
    reason = f"<p class='bad'>{html.escape(result.reason)}</p>" if result.reason else ""
    return "\n".join(
        (
            f"<h2 id='{result.name}'>{result.name}</h2><p>{html.escape(result.title)}. {_place(result)}</p>{reason}",
            *(_pictures(result.name, moment, caption, pictures) for moment, caption in _MOMENTS),
            f"<div class='two'>{''.join(figures)}</div>",
            _metric_table(result),
            _box_table(result),
        )
    )


_MOMENTS = (("start", "before"), ("end", "at the end"))


def _place(result: StationResult) -> str:
    if result.photo is not None:
        return photo_report.about(result.photo)
    place, fixation = (", ".join(_text(value) for value in point) for point in (result.target_m, result.fixation_m))
    return f"True target point ({place}) m; the graph's estimate ({fixation}) m."


def _photographs(folder: Path) -> str:
    figures = (
        _figure(folder / f"photographs_{eye}.jpg", f"{eye} photograph; rings: clicked points, crosses: eyes at rest")
        for eye in ("left", "right")
    )
    return f"<div class='two'>{''.join(figures)}</div>"


def _pictures(name: str, moment: str, caption: str, folder: Path) -> str:
    shown = (
        ("left", f"left eye, {caption}", "jpg"),
        ("right", f"right eye, {caption}", "jpg"),
        ("combined", f"combined edges, {caption}: left red, right cyan, both white", "png"),
        ("left_edges", f"left edges, {caption}", "png"),
        ("right_edges", f"right edges, {caption}", "png"),
    )
    figures = []
    for kind, text, suffix in shown:
        figures.append(_figure(folder / f"{name}_{moment}_{kind}.{suffix}", text))
    return f"<div class='row'>{''.join(figures)}</div>"


def _figure(file: Path, text: str) -> str:
    """Return a picture with its caption; nothing where the file is missing: its station was not completed."""
    if not file.is_file():
        return ""
    mime = "jpeg" if file.suffix == ".jpg" else "png"
    data = base64.b64encode(file.read_bytes()).decode("ascii")
    return f"<figure><img alt='{text}' src='data:image/{mime};base64,{data}'><figcaption>{text}</figcaption></figure>"


def _box_plot(series: Series) -> list[str]:
    if not len(series.box_time_s):
        return []
    title = "Metric II: disparity of the boxes' centres and of the surface inside them, beside the ground truth"
    lines = [
        Line("true surface", series.truth_time_s, series.true_disparity_px, "#17803d", dashed=True),
        Line("boxes' centres", series.box_time_s, series.box_center_px, "#b45309"),
        Line("refined", series.box_time_s, series.box_refined_px, "#2563eb"),
    ]
    return [plot(title, "s", "px", lines)]


def _box_table(result: StationResult) -> str:
    """Return metric II at start and end; nothing where it was not measured."""
    rows = []
    for label, box in (("start", result.start_box), ("end", result.end_box)):
        if box is None:
            continue
        first = True
        for title, corners in (
            ("left &minus; right", box.left_minus_right_px),
            ("right &minus; left", box.right_minus_left_px),
        ):
            cells = "".join(f"<td>{signed(value)}</td>" for value in corners)
            more = (
                html.escape(box.seen),
                "/".join(_text(score) for score in box.scores),
                signed(box.center_px[0]),
                signed(box.refined_px[0]),
            )
            rest = "".join(f"<td>{text}</td>" for text in more) if first else "<td></td>" * len(more)
            rows.append(f"<tr><td>{label}, {title} [px]</td>{cells}{rest}</tr>")
            first = False
    if not rows:
        return ""
    head = "".join(f"<th>{corner}</th>" for corner in (*CORNERS, "target", "scores", "centre [px]", "refined [px]"))
    return f"<table><tr><th>boxes</th>{head}</tr>{''.join(rows)}</table>"


def _metric_table(result: StationResult) -> str:
    if not result.start.windows_px:
        return ""
    head = "".join(f"<th>{size}&times;{size}</th>" for size in result.start.windows_px)
    rows = []
    for label, metric in (("start", result.start), ("end", result.end)):
        for title, values in (
            ("left to right [px]", metric.left_to_right_px),
            ("right to left [px]", metric.right_to_left_px),
            ("contrast", metric.contrast),
        ):
            cells = "".join(f"<td>{_text(value)}</td>" for value in values)
            rows.append(f"<tr><td>{label}, {title}</td>{cells}</tr>")
    return f"<table><tr><th>window</th>{head}</tr>{''.join(rows)}</table>"


def _verdict(good: bool, yes: str, no: str) -> str:
    return f"<span class='{'good' if good else 'bad'}'>{yes if good else no}</span>"


def _text(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"
