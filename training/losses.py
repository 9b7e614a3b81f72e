"""The training loss: varifocal loss of the scores, GIoU and scaled L1 of the boxes."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from training.assignment import Assignment

_FOCUS = 2.0
_NEGATIVE_WEIGHT = 4.0
_GIOU_WEIGHT = 2.5
_L1_WEIGHT = 5.0
_L1_SOFT_PX = 0.5


@dataclass(frozen=True)
class Loss:
    """The sum, and its parts for the log."""

    total: Tensor
    score: float
    box: float


def detection_loss(logits: Tensor, boxes: Tensor, wanted: Assignment) -> Loss:
    """Return the loss of logits (B, N, C) and boxes (B, N, 4) against an assignment."""
    weight = wanted.scores.sum().clamp(min=1.0)
    score = varifocal(logits, wanted.scores) / weight
    if not bool(wanted.positive.any()):
        return Loss(score, float(score.detach()), 0.0)
    found, truth = boxes[wanted.positive], wanted.boxes[wanted.positive]
    importance = wanted.scores.sum(-1)[wanted.positive]
    apart = 1.0 - generalised_iou(found, truth)
    # Sides off by a pixel count the same for all sizes above the smallest: corners are what the metric subtracts.
    side = (truth[:, 2:] - truth[:, :2]).amax(1).clamp(min=8.0)
    off = functional.smooth_l1_loss(found, truth, reduction="none", beta=_L1_SOFT_PX).mean(1) / side.sqrt()
    box = ((_GIOU_WEIGHT * apart + _L1_WEIGHT * off) * importance).sum() / weight
    return Loss(score + box, float(score.detach()), float(box.detach()))


def varifocal(logits: Tensor, wanted: Tensor) -> Tensor:
    """Return the summed varifocal loss (Zhang et al., 2021): easy negatives count less."""
    probability = torch.sigmoid(logits)
    weight = torch.where(wanted > 0, wanted, _NEGATIVE_WEIGHT * probability.detach().pow(_FOCUS))
    return (functional.binary_cross_entropy_with_logits(logits, wanted, reduction="none") * weight).sum()


def generalised_iou(a: Tensor, b: Tensor) -> Tensor:
    """Return (K,) generalised overlaps (Rezatofighi et al., 2019) of boxes (K, 4) in pairs."""
    shared = (torch.minimum(a[:, 2:], b[:, 2:]) - torch.maximum(a[:, :2], b[:, :2])).clamp(min=0).prod(1)
    union = (a[:, 2:] - a[:, :2]).clamp(min=0).prod(1) + (b[:, 2:] - b[:, :2]).clamp(min=0).prod(1) - shared
    around = (torch.maximum(a[:, 2:], b[:, 2:]) - torch.minimum(a[:, :2], b[:, :2])).clamp(min=0).prod(1)
    return shared / union.clamp(min=1e-6) - (around - union) / around.clamp(min=1e-6)
