"""The network: a small one-stage, anchor-free detector with heads of their own for class and box at strides 8 and 16.

Convolution, batch normalisation and ReLU throughout, cross-stage-partial blocks, a top-down path; sized so that one
320x240 image takes about 2 ms on one thread of a processor.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

STRIDES = (8, 16)


@dataclass(frozen=True)
class Widths:
    """Channels at strides 2, 4, 8, 16 and 32, and in the heads of strides 8 and 16.

    Multiples of 16: what onnxruntime's convolutions work on at a time on a processor with 512 bit vectors.
    """

    stem: int = 16
    four: int = 32
    eight: int = 32
    sixteen: int = 64
    thirtytwo: int = 96
    heads: tuple[int, int] = (32, 32)


class ConvUnit(nn.Module):
    """Convolution, batch normalisation, ReLU."""

    def __init__(self, inputs: int, outputs: int, kernel: int = 3, stride: int = 1) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False)
        self.norm = nn.BatchNorm2d(outputs, eps=1e-3, momentum=0.03)

    def forward(self, x: Tensor) -> Tensor:
        """(B, inputs, h, w) to (B, outputs, h/stride, w/stride)."""
        return functional.relu(self.norm(self.convolution(x)), inplace=True)

    def fused(self) -> nn.Sequential:
        """Return the same function without batch normalisation (Jacob et al. 2018, folding)."""
        gain = self.norm.weight / torch.sqrt(self.norm.running_var + self.norm.eps)
        plain = nn.Conv2d(
            self.convolution.in_channels,
            self.convolution.out_channels,
            self.convolution.kernel_size,
            self.convolution.stride,
            self.convolution.padding,
        )
        plain.weight.data = self.convolution.weight.data * gain.data[:, None, None, None]
        assert plain.bias is not None
        plain.bias.data = (self.norm.bias - self.norm.running_mean * gain).data
        return nn.Sequential(plain, nn.ReLU(inplace=True))


class Residual(nn.Module):
    """Two 3x3 units around which the input passes."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first, self.second = ConvUnit(channels, channels), ConvUnit(channels, channels)

    def forward(self, x: Tensor) -> Tensor:
        """(B, channels, h, w) to the same."""
        return x + self.second(self.first(x))


class PartialBlock(nn.Module):
    """Half of the channels pass residual units, every stage's output is kept and mixed (Wang et al. 2020)."""

    def __init__(self, inputs: int, outputs: int, depth: int) -> None:
        super().__init__()
        self.half = outputs // 2
        self.enter = ConvUnit(inputs, 2 * self.half, 1)
        self.stages = nn.ModuleList([Residual(self.half) for _ in range(depth)])
        self.mix = ConvUnit((2 + depth) * self.half, outputs, 1)

    def forward(self, x: Tensor) -> Tensor:
        """(B, inputs, h, w) to (B, outputs, h, w)."""
        parts = list(self.enter(x).split(self.half, dim=1))
        for stage in self.stages:
            parts.append(stage(parts[-1]))
        return self.mix(torch.cat(parts, dim=1))


class Head(nn.Module):
    """Class scores and box distances of one stride."""

    def __init__(self, inputs: int, width: int, classes: int, stride: int) -> None:
        super().__init__()
        self.stride = stride
        self.score_unit, self.box_unit = ConvUnit(inputs, width), ConvUnit(inputs, width)
        self.score = nn.Conv2d(width, classes, 1)
        self.box = nn.Conv2d(width, 4, 1)
        assert self.score.bias is not None
        assert self.box.bias is not None
        nn.init.constant_(self.score.bias, -4.6)  # a score of 0.01 at the start
        nn.init.constant_(self.box.bias, 1.0)
        nn.init.normal_(self.score.weight, std=0.01)
        nn.init.normal_(self.box.weight, std=0.01)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """(B, inputs, h, w) to logits (B, classes, h, w) and left, top, right, bottom distances (B, 4, h, w) [px]."""
        # Straight, so that a cell may also predict a small box beside its centre: a distance is negative then.
        distances = self.box(self.box_unit(x)) * float(self.stride)
        return self.score(self.score_unit(x)), distances


class Detector(nn.Module):
    """The whole network; `forward` returns raw outputs for training, `Deployed` wraps it for export."""

    def __init__(self, classes: int, widths: Widths | None = None) -> None:
        super().__init__()
        w = widths or Widths()
        self.classes = classes
        self.stem = ConvUnit(3, w.stem, 3, 2)
        self.four = nn.Sequential(ConvUnit(w.stem, w.four, 3, 2), PartialBlock(w.four, w.four, 1))
        self.eight = nn.Sequential(ConvUnit(w.four, w.eight, 3, 2), PartialBlock(w.eight, w.eight, 2))
        self.sixteen = nn.Sequential(ConvUnit(w.eight, w.sixteen, 3, 2), PartialBlock(w.sixteen, w.sixteen, 2))
        self.thirtytwo = nn.Sequential(
            ConvUnit(w.sixteen, w.thirtytwo, 3, 2), PartialBlock(w.thirtytwo, w.thirtytwo, 1)
        )
        self.lower = ConvUnit(w.thirtytwo, w.thirtytwo // 2, 1)
        self.join_sixteen = PartialBlock(w.sixteen + w.thirtytwo // 2, w.sixteen, 1)
        self.low = ConvUnit(w.sixteen, w.eight, 1)
        self.join_eight = PartialBlock(2 * w.eight, w.eight, 1)
        self.heads = nn.ModuleList(
            [Head(w.eight, w.heads[0], classes, STRIDES[0]), Head(w.sixteen, w.heads[1], classes, STRIDES[1])]
        )

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits (B, N, classes) and boxes (B, N, 4) xyxy [input px] of images (B, 3, h, w) in 0..1.

        N runs over the cells of stride 8, row by row, then those of stride 16. Sides are multiples of 16; the smallest
        map is upsampled to its neighbour's size, so that 240 rows (15 at stride 16) need no padding.
        """
        scores, boxes = [], []
        for head, features in zip(self.heads, self.features(images), strict=True):
            logits, distances = head(features)
            scores.append(logits.flatten(2).transpose(1, 2))
            centers = cell_centers(features.shape[2], features.shape[3], head.stride, images.device)
            distances = distances.flatten(2).transpose(1, 2)
            boxes.append(torch.cat([centers - distances[..., :2], centers + distances[..., 2:]], dim=2))
        return torch.cat(scores, dim=1), torch.cat(boxes, dim=1)

    def features(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Return the input features of the heads of strides 8 and 16 for images (B, 3, h, w)."""
        eight = self.eight(self.four(self.stem(images)))
        sixteen = self.sixteen(eight)
        deep = self.lower(self.thirtytwo(sixteen))
        sixteen = self.join_sixteen(torch.cat([sixteen, _to_size_of(deep, sixteen)], dim=1))
        eight = self.join_eight(torch.cat([eight, functional.interpolate(self.low(sixteen), scale_factor=2.0)], dim=1))
        return eight, sixteen


def cell_centers(rows: int, columns: int, stride: int, device: torch.device) -> Tensor:
    """Return the centres (rows * columns, 2) of a stride's cells, row by row [input px]."""
    y, x = torch.meshgrid(torch.arange(rows, device=device), torch.arange(columns, device=device), indexing="ij")
    return (torch.stack([x, y], dim=-1).reshape(-1, 2).float() + 0.5) * float(stride)


def _to_size_of(small: Tensor, large: Tensor) -> Tensor:
    """Double by nearest neighbours and cut to the larger map (an odd side leaves half a cell over)."""
    doubled = functional.interpolate(small, scale_factor=2.0)
    return doubled[:, :, : large.shape[2], : large.shape[3]]
