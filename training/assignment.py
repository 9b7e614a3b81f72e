"""Which cells predict which object: task-aligned assignment (Feng et al., "TOOD", 2021)."""

from dataclasses import dataclass

import torch
from torch import Tensor

_TOP = 10
_SCORE_POWER = 0.5
_OVERLAP_POWER = 6.0
_REACH_PX = 6.0  # of a cell's centre beyond a small object's box: 8 px objects need more than one candidate
_TINY = 1e-9


@dataclass(frozen=True)
class Assignment:
    """For every cell: its target scores (B, N, C), the box it predicts (B, N, 4), and whether it does (B, N)."""

    scores: Tensor
    boxes: Tensor
    positive: Tensor


def assign(scores: Tensor, boxes: Tensor, centers: Tensor, truth: Tensor, classes: Tensor, valid: Tensor) -> Assignment:
    """Choose for every object the cells whose score and overlap are best together.

    Args:
        scores: (B, N, C) predicted probabilities.
        boxes: (B, N, 4) predicted, xyxy [px].
        centers: (N, 2) of the cells [px].
        truth: (B, M, 4) objects' boxes, padded.
        classes: (B, M) their classes, 0 where padded.
        valid: (B, M) which of them are objects.

    """
    with torch.no_grad():
        return _assigned(scores, boxes, centers, truth, classes, valid)


def _assigned(
    scores: Tensor, boxes: Tensor, centers: Tensor, truth: Tensor, classes: Tensor, valid: Tensor
) -> Assignment:
    count = scores.shape[1]
    overlap = pairwise_iou(truth, boxes).clamp(min=0)  # (B, M, N)
    of_class = scores.gather(2, classes[:, None, :].expand(-1, count, -1)).transpose(1, 2)  # (B, M, N)
    # Small boxes are widened, so that at least the cells around them are candidates.
    size = truth[..., 2:] - truth[..., :2]
    widen = ((2 * _REACH_PX - size) / 2).clamp(min=0)
    low, high = truth[..., :2] - widen, truth[..., 2:] + widen
    near = ((centers[None, None] > low[:, :, None]) & (centers[None, None] < high[:, :, None])).all(-1)
    quality = of_class.pow(_SCORE_POWER) * overlap.pow(_OVERLAP_POWER) * near * valid[..., None]
    top = quality.topk(min(_TOP, count), dim=2)
    chosen = torch.zeros_like(quality, dtype=torch.bool).scatter_(2, top.indices, top.values > _TINY)
    # Early on no box overlaps: then the nearest cell is chosen, so that every object has a gradient.
    distance = (centers[None, None] - 0.5 * (truth[..., :2] + truth[..., 2:])[:, :, None]).square().sum(-1)
    nearest = torch.zeros_like(chosen).scatter_(2, distance.argmin(2, keepdim=True), True)
    chosen |= nearest & valid[..., None] & ~chosen.any(2, keepdim=True)
    # A cell chosen for several objects goes to the one it overlaps most.
    rank = torch.where(chosen, overlap + 1e-6, torch.zeros_like(overlap))
    best = rank.argmax(1)  # (B, N)
    positive = chosen.any(1)
    taken = torch.zeros_like(chosen).scatter_(1, best[:, None], positive[:, None])
    quality, overlap = quality * taken, overlap * taken
    # The best cell of an object gets the root of its overlap as target score: the overlap itself would leave small
    # objects, whose boxes overlap less, with scores that clutter reaches.
    scale = overlap.amax(2, keepdim=True).sqrt() / quality.amax(2, keepdim=True).clamp(min=_TINY)
    score = (quality * scale).amax(1)
    score = torch.where(positive, score.clamp(min=0.05), torch.zeros_like(score))
    target_classes = classes.gather(1, best)
    wanted = torch.zeros_like(scores)
    wanted.scatter_(2, target_classes[..., None], score[..., None].to(wanted.dtype))
    return Assignment(wanted, truth.gather(1, best[..., None].expand(-1, -1, 4)), positive)


def pairwise_iou(a: Tensor, b: Tensor) -> Tensor:
    """Return (B, M, N) intersections over unions of boxes (B, M, 4) and (B, N, 4)."""
    low = torch.maximum(a[:, :, None, :2], b[:, None, :, :2])
    high = torch.minimum(a[:, :, None, 2:], b[:, None, :, 2:])
    shared = (high - low).clamp(min=0).prod(-1)
    area_a = (a[..., 2:] - a[..., :2]).clamp(min=0).prod(-1)
    area_b = (b[..., 2:] - b[..., :2]).clamp(min=0).prod(-1)
    return shared / (area_a[:, :, None] + area_b[:, None] - shared + _TINY)
