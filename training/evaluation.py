"""How good an exported detector is on renders of worlds it was not trained on, through the code of the node."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from training.average_precision import ImageResult, average_precision, mean_average_precision
from training.dataset import Shard
from vergence_metric.boxes import Detector
from vergence_metric.boxes.parameters import DetectorParameters

SMALL_PX = (16.0, 32.0)
"""Widths at 640, 8 to 16 at 320."""

_HARDLY_VISIBLE = 0.5
_LEAST_PX = 12.0
_THRESHOLDS = tuple(round(0.2 + 0.025 * i, 3) for i in range(29))
_FALSE_PER_1000, _LEAST_FOUND = 5.0, 0.90


@dataclass(frozen=True)
class Scores:
    """Average precisions; by threshold, false detections per 1000 images without a cube and share of cubes found."""

    images: int
    ap50: float
    ap50_95: float
    ap50_small: float
    false_per_1000: dict[str, float]
    recall: dict[str, float]

    @property
    def threshold(self) -> float:
        """The lowest threshold with few enough false detections, unless that would miss too many cubes.

        Then it is the highest one that still finds enough of them.
        """
        few_false = [float(t) for t, false in self.false_per_1000.items() if false <= _FALSE_PER_1000]
        enough_found = [float(t) for t, found in self.recall.items() if found >= _LEAST_FOUND]
        return min(min(few_false, default=max(_THRESHOLDS)), max(enough_found, default=min(_THRESHOLDS)))

    def as_json(self) -> str:
        """Return the figures as JSON."""
        return json.dumps(asdict(self), indent=1)


def evaluate(model: Path, data: Shard) -> Scores:
    """Score a model file on renders."""
    detector = Detector(DetectorParameters(model=str(model), threshold=0.01, max_objects=50))
    found = [detector.detect(image) for image in data.images]
    whole, small, empty_scores, best_of_cubes = [], [], [], []
    for i, detections in enumerate(found):
        # The renders' boxes count from the corner, detections from the first pixel's centre.
        truth = data.boxes[i, : data.count[i]].astype(np.float64) - 0.5
        width, unseen = truth[:, 2] - truth[:, 0], data.visible[i, : data.count[i]] < _HARDLY_VISIBLE
        boxes, scores = detections.xyxy_px, detections.scores
        whole.append(ImageResult(boxes, scores, truth, unseen | (width < _LEAST_PX)))
        size = boxes[:, 2] - boxes[:, 0]
        near = (size > 0.5 * SMALL_PX[0]) & (size < 2.0 * SMALL_PX[1])
        other = unseen | (width < SMALL_PX[0]) | (width >= SMALL_PX[1])
        small.append(ImageResult(boxes[near], scores[near], truth, other))
        if data.count[i]:
            best_of_cubes.append(scores.max(initial=0.0))
        else:
            empty_scores.append(scores)
    every = np.concatenate(empty_scores) if empty_scores else np.empty(0)
    best = np.array(best_of_cubes)
    return Scores(
        len(data.images),
        average_precision(whole, 0.5),
        mean_average_precision(whole),
        average_precision(small, 0.5),
        {f"{t:g}": 1000.0 * float((every >= t).sum()) / max(len(empty_scores), 1) for t in _THRESHOLDS},
        {f"{t:g}": float((best >= t).mean()) for t in _THRESHOLDS},
    )
