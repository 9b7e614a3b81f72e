"""Writes the measured figures into the model card."""

import re
from pathlib import Path

from training.evaluation import Scores

_BEGIN, _END = "<!-- figures: written by training -->", "<!-- end of figures -->"


def write_figures(card: Path, scores: Scores) -> None:
    """Put the scores of the shipped model into its card, in place of those there."""
    threshold = f"{scores.threshold:g}"
    lines = [
        _BEGIN,
        f"| {scores.images} held-out renders | |",
        "|---|---|",
        f"| AP at IoU 0.5 | {scores.ap50:.3f} |",
        f"| AP at IoU 0.5 to 0.95 | {scores.ap50_95:.3f} |",
        f"| AP at IoU 0.5, small | {scores.ap50_small:.3f} |",
        f"| shipped threshold | {threshold} |",
        f"| renders with a cube in which the best detection passes it | {scores.recall[threshold]:.3f} |",
        f"| false detections per 1000 renders without a cube, look-alikes in view | "
        f"{scores.false_per_1000[threshold]:.0f} |",
        "",
        "| threshold | cubes found | false per 1000 |",
        "|---|---|---|",
        *(f"| {t} | {scores.recall[t]:.3f} | {scores.false_per_1000[t]:.0f} |" for t in list(scores.recall)[4::4]),
        _END,
    ]
    text = card.read_text(encoding="utf-8")
    block = re.compile(re.escape(_BEGIN) + ".*" + re.escape(_END), re.DOTALL)
    card.write_text(block.sub(lambda _: "\n".join(lines), text), encoding="utf-8")
