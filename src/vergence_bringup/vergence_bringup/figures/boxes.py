"""Metric II's figures of one pair, from the library's result or from the topic, as text and as JSON."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vergence_metric.boxes import BoxVergenceResult

CORNERS = ("top left x", "top left y", "bottom right x", "bottom right y")
_STATUSES = ("ok", "no target", "left only", "right only", "ambiguous", "cut", "occluded")

Corners = tuple[float, float, float, float]
Pair = tuple[float, float]
_NAN4: Corners = (math.nan, math.nan, math.nan, math.nan)


@dataclass(frozen=True)
class BoxFigures:
    """Metric II of one pair; NaN where a figure could not be computed, and `status` says why.

    `left_minus_right_px` is in the order of CORNERS. `center_px` and `refined_px` are the disparities of the boxes'
    centres and of the surface inside them, (horizontal, vertical). `left_xyxy_px` and `right_xyxy_px` are the boxes,
    `scores` the detector's for (left, right). `left_point_px` and `right_point_px` are what a goal looks at: between
    the eyes of a face, else the box's middle.
    """

    status: str
    reason: str
    class_name: str
    left_minus_right_px: Corners
    center_px: Pair
    refined_px: Pair
    scores: Pair
    left_xyxy_px: Corners
    right_xyxy_px: Corners
    left_point_px: Pair = (math.nan, math.nan)
    right_point_px: Pair = (math.nan, math.nan)

    @classmethod
    def from_result(cls, result: "BoxVergenceResult") -> "BoxFigures":
        """Return the figures of the library's own result."""
        boxes = (result.left, result.right)
        left_xyxy, right_xyxy = (box.xyxy_px if box else _NAN4 for box in boxes)
        left_score, right_score = (box.score if box else math.nan for box in boxes)
        return cls(
            status=_STATUSES[result.status],
            reason=result.reason,
            class_name=result.class_name,
            left_minus_right_px=_four(result.corners.left_minus_right_px),
            center_px=result.center_px,
            refined_px=(result.refined.horizontal_px, result.refined.vertical_px),
            scores=(left_score, right_score),
            left_xyxy_px=left_xyxy,
            right_xyxy_px=right_xyxy,
            left_point_px=result.left.point_px if result.left else (math.nan, math.nan),
            right_point_px=result.right.point_px if result.right else (math.nan, math.nan),
        )

    @classmethod
    def from_message(cls, message: Any) -> "BoxFigures":
        """Return the figures of a vergence_msgs/BoxVergence."""
        boxes = [(box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px) for box in (message.left, message.right)]
        return cls(
            status=_STATUSES[message.status],
            reason=message.reason,
            class_name=message.class_name,
            left_minus_right_px=(
                message.left_minus_right_top_left_x_px,
                message.left_minus_right_top_left_y_px,
                message.left_minus_right_bottom_right_x_px,
                message.left_minus_right_bottom_right_y_px,
            ),
            center_px=(message.center_horizontal_px, message.center_vertical_px),
            refined_px=(message.refined_horizontal_px, message.refined_vertical_px),
            scores=(message.left.score, message.right.score),
            left_xyxy_px=boxes[0],
            right_xyxy_px=boxes[1],
            left_point_px=(message.left.point_x_px, message.left.point_y_px),
            right_point_px=(message.right.point_x_px, message.right.point_y_px),
        )

    @property
    def right_minus_left_px(self) -> Corners:
        """The corner differences the other way."""
        return _four([-value for value in self.left_minus_right_px])

    @property
    def seen(self) -> str:
        """Return the class and, unless it is ok, the status."""
        name = self.class_name or "no target"
        return name if self.status == "ok" else f"{name}: {self.status}" if self.class_name else name

    def as_json(self) -> dict[str, Any]:
        """Return the figures for JSON, null where one is unknown."""
        return {
            "class": self.class_name or None,
            "status": self.status,
            "reason": self.reason,
            "left_minus_right_px": _numbers(self.left_minus_right_px),
            "right_minus_left_px": _numbers(self.right_minus_left_px),
            "center_px": _numbers(self.center_px),
            "refined_px": _numbers(self.refined_px),
            "scores": _numbers(self.scores),
            "left_xyxy_px": _numbers(self.left_xyxy_px),
            "right_xyxy_px": _numbers(self.right_xyxy_px),
            "left_point_px": _numbers(self.left_point_px),
            "right_point_px": _numbers(self.right_point_px),
        }


def corner_text(corners_px: Sequence[float]) -> str:
    """Return four corner differences as two points."""
    x_low, y_low, x_high, y_high = (signed(value) for value in corners_px)
    return f"({x_low}, {y_low}) ({x_high}, {y_high})"


def signed(value: float) -> str:
    """Return a difference with its sign; a dash where it is unknown."""
    # Adding zero makes the zero that a negation left behind a plain one.
    return f"{round(value, 2) + 0.0:+.2f}" if math.isfinite(value) else "-"


def _numbers(values: Sequence[float]) -> list[float | None]:
    return [float(value) + 0.0 if math.isfinite(value) else None for value in values]


def _four(values: Any) -> Corners:
    a, b, c, d = (float(value) for value in values)
    return a, b, c, d
