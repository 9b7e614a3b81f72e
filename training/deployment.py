"""The trained network as it is exported: the same function with fewer and cheaper operators.

On small pictures a graph's many small operators cost as much as its convolutions. Batch normalisation goes into the
convolutions, a block's halves come from convolutions of their own (a split would leave onnxruntime's blocked layout),
and what makes boxes of distances, all linear, goes into the heads' last convolutions.
"""

from copy import deepcopy

import torch
from torch import Tensor, nn

from training.network import ConvUnit, Detector, Head, PartialBlock

_MOST_CELLS = 512  # of a map's side: inputs up to 4096 px
_CERTAIN = 30.0  # whose sigmoid is 1

# Centre off the cell's, and size, of left, top, right, bottom distances.
_BOX_OF_DISTANCES = torch.tensor([[-0.5, 0, 0.5, 0], [0, -0.5, 0, 0.5], [1, 0, 1, 0], [0, 1, 0, 1]])


class Deployed(nn.Module):
    """What is exported: one output (B, N, 5 + classes), centre and size in input pixels, objectness 1, scores 0..1."""

    def __init__(self, detector: Detector) -> None:
        """Copy and fuse a trained network."""
        super().__init__()
        self.detector = fuse(deepcopy(detector).eval())
        self.heads = nn.ModuleList([DeployedHead(head) for head in self.detector.heads])

    def forward(self, images: Tensor) -> Tensor:
        """(B, 3, h, w) in 0..1 RGB to (B, N, 5 + classes)."""
        rows = [head(features) for head, features in zip(self.heads, self.detector.features(images), strict=True)]
        return torch.cat(rows, dim=2).transpose(1, 2)


class DeployedHead(nn.Module):
    """One stride's rows, (B, 5 + classes, h * w)."""

    def __init__(self, head: Head) -> None:
        """Convert a fused head."""
        super().__init__()
        self.score_unit, self.box_unit = head.score_unit, head.box_unit
        matrix = _BOX_OF_DISTANCES * float(head.stride)
        assert head.box.bias is not None
        assert head.score.bias is not None
        box = matrix @ head.box.weight.data.flatten(1)
        self.box = _convolution(box[:, :, None, None], matrix @ head.box.bias.data)
        nothing = torch.zeros_like(head.score.weight.data[:1])
        self.score = _convolution(
            torch.cat([nothing, head.score.weight.data]), torch.cat([torch.tensor([_CERTAIN]), head.score.bias.data])
        )
        centers = (torch.arange(_MOST_CELLS) + 0.5) * float(head.stride)
        none = torch.zeros(_MOST_CELLS)
        self.register_buffer("columns", torch.stack([centers, none, none, none])[None, :, None, :])
        self.register_buffer("rows", torch.stack([none, centers, none, none])[None, :, :, None])

    def forward(self, features: Tensor) -> Tensor:
        """(B, inputs, h, w) to (B, 5 + classes, h * w)."""
        height, width = features.shape[2:]
        box = self.box(self.box_unit(features)) + self.columns[..., :width] + self.rows[:, :, :height]
        return torch.cat([box, torch.sigmoid(self.score(self.score_unit(features)))], dim=1).flatten(2)


class DeployedBlock(nn.Module):
    """A PartialBlock whose halves come from convolutions of their own."""

    def __init__(self, block: PartialBlock) -> None:
        """Convert a fused block."""
        super().__init__()
        assert isinstance(block.enter, nn.Sequential)
        enter = block.enter[0]
        kept, passed = enter.weight.data.split(block.half)
        kept_bias, passed_bias = enter.bias.data.split(block.half)
        self.keep = nn.Sequential(_convolution(kept, kept_bias), nn.ReLU())
        self.enter = nn.Sequential(_convolution(passed, passed_bias), nn.ReLU())
        self.stages, self.mix = block.stages, block.mix

    def forward(self, x: Tensor) -> Tensor:
        """(B, inputs, h, w) to (B, outputs, h, w)."""
        parts = [self.keep(x), self.enter(x)]
        for stage in self.stages:
            parts.append(stage(parts[-1]))
        return self.mix(torch.cat(parts, dim=1))


def fuse(module: nn.Module) -> nn.Module:
    """Fold every batch normalisation into its convolution and part the blocks' halves, in place; for `eval` ones."""
    for name, child in module.named_children():
        if isinstance(child, ConvUnit):
            setattr(module, name, child.fused())
        else:
            fuse(child)
            if isinstance(child, PartialBlock):
                setattr(module, name, DeployedBlock(child))
    return module


def _convolution(weight: Tensor, bias: Tensor) -> nn.Conv2d:
    convolution = nn.Conv2d(weight.shape[1], weight.shape[0], 1)
    convolution.weight.data, convolution.bias = weight, nn.Parameter(bias)
    return convolution
