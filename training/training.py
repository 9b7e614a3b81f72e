"""The training loop: one cycle of the learning rate, a moving average of the weights, resumable."""

import math
import time
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from training.assignment import assign
from training.augmentation import Strength, part_of, second_look_crop
from training.dataset import INPUT_PX, MOST, Shard
from training.losses import detection_loss
from training.network import STRIDES, Detector, cell_centers
from vergence_metric.boxes.second_look import CROP_PX as SECOND_LOOK_PX

CROP_PX = (192, 144)
_LOG_EVERY = 50


@dataclass(frozen=True)
class Schedule:
    """How long [min of wall time] and how fast.

    `second_look_share` of the batches are second looks, cropped as the detector does. The others are crops about the
    objects in the first `crop_share` of the time, since most of a render is background and a crop costs a third of it;
    then whole renders, in the last `plain_share` all but unchanged. The statistics of batch normalisation are held for
    the last `held_share`: batches of several kinds differ in them, and a deployed network has only one set.

    Time, not steps, drives the learning rate: a busy machine trains less, but to the end of its cycle.
    """

    minutes: float
    batch: int = 16
    crop_batch: int = 32
    second_look_batch: int = 48
    second_look_share: float = 0.4
    crop_share: float = 0.85
    rate: float = 3e-3
    weight_decay: float = 0.02
    warm_up: int = 200
    average: float = 0.999
    plain_share: float = 0.07
    held_share: float = 0.5
    seed: int = 1


def train(
    detector: Detector, shards: Callable[[], Shard], schedule: Schedule, folder: Path, say: Callable[[str], None]
) -> nn.Module:
    """Train and return the averaged network; its state is saved in `folder`, from which a later call continues.

    Args:
        detector: the network, changed in place.
        shards: returns the renders; called again after every pass over them, so that there may be more.
        schedule: see there.
        folder: for `last.pt`.
        say: called with each line of progress.

    """
    averaged = deepcopy(detector).eval()
    detector = detector.train().to(memory_format=torch.channels_last)
    decayed = [p for p in detector.parameters() if p.ndim > 1]
    others = [p for p in detector.parameters() if p.ndim <= 1]
    optimiser = torch.optim.AdamW(
        [{"params": decayed, "weight_decay": schedule.weight_decay}, {"params": others, "weight_decay": 0.0}],
        lr=schedule.rate,
    )
    step, spent_before_s = 0, 0.0
    state_path = folder / "last.pt"
    if state_path.exists():
        state = torch.load(state_path)
        detector.load_state_dict(state["detector"])
        averaged.load_state_dict(state["averaged"])
        optimiser.load_state_dict(state["optimiser"])
        step, spent_before_s = int(state["step"]), float(state["spent_s"])
        say(f"continues at step {step}, after {spent_before_s / 60:.1f} min")
    started, began, total_s = time.monotonic(), step, schedule.minutes * 60
    share = spent_before_s / total_s
    batches = _batches(shards, schedule, step, lambda: share)
    sums = np.zeros(2)
    while share < 1.0:
        images, truth, valid = next(batches)
        if share >= 1 - schedule.held_share:
            _hold_statistics(detector)
        for group in optimiser.param_groups:
            group["lr"] = schedule.rate * _factor(step, share, schedule)
        with torch.autocast("cpu", torch.bfloat16):
            logits, boxes = detector(images)
        logits, boxes = logits.float(), boxes.float()
        classes = torch.zeros(truth.shape[:2], dtype=torch.long)
        centers = all_centers(images.shape[3], images.shape[2])
        wanted = assign(torch.sigmoid(logits.detach()), boxes.detach(), centers, truth, classes, valid)
        loss = detection_loss(logits, boxes, wanted)
        optimiser.zero_grad(set_to_none=True)
        loss.total.backward()
        nn.utils.clip_grad_norm_(detector.parameters(), 10.0)
        optimiser.step()
        _average(averaged, detector, min(schedule.average, (step + 1) / (step + 10)))
        sums += loss.score, loss.box
        step += 1
        spent_s = spent_before_s + time.monotonic() - started
        share = spent_s / total_s
        if step % _LOG_EVERY == 0:
            rate = (step - began) / (spent_s - spent_before_s)
            score, box = sums / _LOG_EVERY
            say(f"{share:.0%}, step {step}: score loss {score:.3f}, box loss {box:.3f}, {rate:.1f} steps/s")
            sums[:] = 0
        if step % 500 == 0 or share >= 1.0:
            state = {"detector": detector.state_dict(), "averaged": averaged.state_dict(), "step": step}
            torch.save(state | {"optimiser": optimiser.state_dict(), "spent_s": spent_s}, state_path)
    return averaged


def all_centers(width: int, height: int) -> Tensor:
    """Return the centres (N, 2) of the cells of every stride for images of this size [px]."""
    return torch.cat([cell_centers(height // s, width // s, s, torch.device("cpu")) for s in STRIDES])


def _hold_statistics(detector: nn.Module) -> None:
    for module in detector.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.eval()


def _factor(step: int, share: float, schedule: Schedule) -> float:
    warm = min((step + 1) / schedule.warm_up, 1.0)
    return warm * (0.02 + 0.98 * 0.5 * (1 + math.cos(math.pi * min(share, 1.0))))


def _average(averaged: nn.Module, current: nn.Module, keep: float) -> None:
    with torch.no_grad():
        for kept, new in zip(averaged.state_dict().values(), current.state_dict().values(), strict=True):
            if kept.dtype.is_floating_point:
                kept.mul_(keep).add_(new, alpha=1 - keep)
            else:
                kept.copy_(new)


def _batches(
    shards: Callable[[], Shard], schedule: Schedule, first_step: int, share: Callable[[], float]
) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
    rng = np.random.default_rng([schedule.seed, first_step])
    while True:
        data = shards()
        order, start = rng.permutation(len(data.images)), 0
        while True:
            plain, cropped = share() >= 1 - schedule.plain_share, share() < schedule.crop_share
            strength = Strength(0.0, 0.0) if plain else Strength()
            second_look = rng.random() < schedule.second_look_share
            size_px = SECOND_LOOK_PX if second_look else CROP_PX if cropped else INPUT_PX
            count = schedule.second_look_batch if second_look else schedule.crop_batch if cropped else schedule.batch
            chosen = order[start : start + count]
            start += len(chosen)
            # A smaller batch at the end is left out, unless it is all there is.
            if start >= len(order) and start > len(chosen):
                break
            yield _batch(rng, data, chosen, strength, size_px, second_look_crop if second_look else part_of)


def _batch(
    rng: np.random.Generator,
    data: Shard,
    chosen: np.ndarray,
    strength: Strength,
    size_px: tuple[int, int],
    vary: Callable[..., tuple[np.ndarray, np.ndarray]],
) -> tuple[Tensor, Tensor, Tensor]:
    width, height = size_px
    images = np.empty((len(chosen), 3, height, width), np.float32)
    truth, valid = torch.zeros(len(chosen), MOST, 4), torch.zeros(len(chosen), MOST, dtype=torch.bool)
    for row, i in enumerate(chosen):
        alikes = data.alikes[i][~np.isnan(data.alikes[i, :, 0])]
        boxes = data.boxes[i, : data.count[i]]
        image, boxes = vary(rng, data.images[i], boxes, alikes, size_px, strength)
        images[row] = image[:, :, ::-1].transpose(2, 0, 1) * np.float32(1 / 255)
        truth[row, : len(boxes)] = torch.from_numpy(boxes.astype(np.float32))
        valid[row, : len(boxes)] = True
    return torch.from_numpy(images).to(memory_format=torch.channels_last), truth, valid
