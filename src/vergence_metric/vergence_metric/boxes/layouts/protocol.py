"""What a detector layout is: how a network's input is prepared and its output read."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.errors import DetectorError
from vergence_metric.boxes.preprocessing import Preprocessing

Array = NDArray[np.float64]
Output = NDArray[Any]


@dataclass(frozen=True)
class WarmUp:
    """The first run of a model, on a structured picture, from which its layout is recognised.

    `output_names` and `outputs` are in the model's order, `input_px` is the (width, height) it was run with,
    `metadata` the file's own entries, and `class_count` the number of class names of the user or among them, None if
    there are none. Shapes declared in the file are not used: exporters get them wrong.
    """

    output_names: Sequence[str]
    outputs: Sequence[Output]
    input_px: tuple[int, int]
    metadata: Mapping[str, str] = field(default_factory=dict)
    class_count: int | None = None


@dataclass(frozen=True)
class Candidates:
    """Possible objects of one image.

    `xyxy` (K, 4) are corners [px of the input, counted from its outer corner], `scores` (K,), `class_ids` (K,).
    `landmarks` (K, L, 2) are points on the objects in the same pixels, None where the model gives none.
    """

    xyxy: Array
    scores: Array
    class_ids: NDArray[np.int64]
    landmarks: Array | None = None

    def rows(self, chosen: NDArray[Any]) -> "Candidates":
        """Return the candidates at these indices, or where a mask (K,) is True."""
        landmarks = None if self.landmarks is None else self.landmarks[chosen]
        return Candidates(self.xyxy[chosen], self.scores[chosen], self.class_ids[chosen], landmarks)


@dataclass(frozen=True)
class Layout(ABC):
    """One layout of a detector's outputs. Subclasses are frozen dataclasses; an instance belongs to one model.

    `outputs` are the indices of the outputs that `decode` needs, in its order, `classes` is the number of classes,
    None if neither shape nor metadata contain it, and `strides` are the strides [px] of the grid, if there is one.
    """

    name: ClassVar[str]
    """What the parameter `detector.layout` and the metadata entry `layout` select it by."""

    description: ClassVar[str]
    """Short description of its outputs, for logs and errors."""

    suppressed: ClassVar[bool] = False
    """True if the model itself has removed overlapping boxes."""

    certain: ClassVar[bool] = False
    """True if a match cannot be another layout, because the outputs' names say so."""

    class_names: ClassVar[tuple[str, ...]] = ()
    """Names of the classes of every model of this layout; empty if its models differ."""

    default_threshold: ClassVar[float] = 0.35
    """Least score of an object, where neither the parameters nor the metadata name one."""

    outputs: tuple[int, ...]
    classes: int | None
    strides: tuple[int, ...] = ()

    @classmethod
    @abstractmethod
    def matches(cls, warm_up: WarmUp) -> "Layout | None":
        """Return this layout for a model by the shapes of its outputs; None if they do not fit."""

    def contradiction(self, warm_up: WarmUp) -> str:
        """Return what in the warm-up's values, or in an output's name, this layout cannot have; "" for nothing."""
        return ""

    def preprocessing(self, dtype: Any) -> Preprocessing:
        """Return how an image becomes the input (of element type `dtype`), unless the parameters override it."""
        return Preprocessing("rgb", dtype != np.uint8, "letterbox")

    def explains(self, output: Output, warm_up: WarmUp) -> bool:
        """Return whether an output that `decode` does not need repeats those that it does, as before decoding."""
        return False

    @abstractmethod
    def decode(self, outputs: Sequence[Output], input_px: tuple[int, int], threshold: float) -> Candidates:
        """Return the candidates of one image; those below the score `threshold` may be left out already.

        Args:
            outputs: of one image, those of `self.outputs`.
            input_px: (width, height) of the input.
            threshold: score from which candidates are of use.

        """

    def candidates(self, outputs: Sequence[Output], input_px: tuple[int, int], threshold: float) -> Candidates:
        """Return the candidates of one image that reach the threshold, are finite and have an area.

        Args:
            outputs: all outputs of the model, of one image.
            input_px: (width, height) of the input.
            threshold: least score.

        Raises:
            DetectorError: an output that is not a number: it says nothing of what is seen.

        """
        used = [outputs[i] for i in self.outputs]
        self.check_numbers(used)
        found = self.decode(used, input_px, threshold)
        good = (found.scores >= threshold) & np.isfinite(found.xyxy).all(1) & np.isfinite(found.scores)
        good &= (found.xyxy[:, 2:] > found.xyxy[:, :2]).all(1)
        if found.landmarks is not None:
            good &= np.isfinite(found.landmarks).all((1, 2))
        return found.rows(good)

    def check_numbers(self, outputs: Sequence[Output]) -> None:
        """Raise DetectorError where one of the outputs that `decode` needs holds NaN."""
        for place, output in zip(self.outputs, outputs, strict=True):
            if output.dtype.kind == "f" and np.isnan(output).any():
                share = float(np.isnan(output).mean())
                raise DetectorError(
                    f"output {place} of the model must be numbers: {share:.0%} of {list(output.shape)} are NaN"
                )

    def __str__(self) -> str:
        count = "" if self.classes is None else f", {self.classes} class{'' if self.classes == 1 else 'es'}"
        return f"{self.name} ({self.description}{count})"


def whole_ids(values: Array) -> NDArray[np.int64]:
    """Return class numbers (K,) given as floats; -1 where one is not a number."""
    return np.rint(np.nan_to_num(values, nan=-1.0)).astype(np.int64)
