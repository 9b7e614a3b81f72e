"""A detector of one picture's face in the layout of YuNet, built and not trained: normalised correlation at many sizes.

Its weights are the picture itself, about the point between the eyes. It finds that face at any brightness, turned by up
to about 15 degrees, its eyes 15 to 75 px apart.
"""

from pathlib import Path

import cv2
import numpy as np
from onnx import TensorProto

from vergence_metric.testing.face_panels import FacePicture
from vergence_metric.testing.onnx_graph import STRIDES, Array, Graph, save_model

_EYES_PX = 8.0  # between the eyes of the template
_HALF = (1.0, 1.25)  # of the template, in distances between the eyes
_SIZES_PX = tuple(16.0 * 1.2**i for i in range(9))  # between the eyes, as they are looked for
_CELL_PX = 8  # of the cells that answer: YuNet's finest
_STEP_PX = 2  # of the map in which the best place is looked for
_PER_CELL = _CELL_PX // _STEP_PX
_LEAST, _SURE = 0.5, 1.0  # correlations with a score of 0 and of 1
_FLOOR = 1e-4  # of the variance: where nothing is to be seen, nothing correlates


def build_face_matcher(path: Path, picture: FacePicture, size_px: tuple[int, int] = (640, 480)) -> Path:
    """Write a detector of a picture's face for inputs of (width, height), whole strides, and return its path."""
    width, height = size_px
    graph = Graph(source="input")
    grey = graph.constant("grey", np.full((1, 3, 1, 1), 1.0 / 765.0, np.float32))
    image = graph.node("Conv", ["input", grey], "brightness")
    template = _template(picture)
    kernel = graph.constant("template", template[None, None])
    maps = [
        _correlation(graph, image, kernel, template.shape, level, (height, width)) for level in range(len(_SIZES_PX))
    ]
    whole = graph.node("Concat", maps, "correlations", axis=1)
    best = graph.node("ReduceMax", [whole], "best", axes=[1], keepdims=1)
    levels = graph.node("ArgMax", [whole], "levels", axis=1, keepdims=1)
    # Each cell's pixels side by side: the best of them answers.
    by_cell = [_by_cell(graph, name, (height, width)) for name in (best, levels)]
    peak = graph.node("ReduceMax", [by_cell[0]], "peak", axes=[2], keepdims=1)
    place = graph.node("ArgMax", [by_cell[0]], "place", axis=2, keepdims=1)
    level = graph.node("GatherElements", [by_cell[1], place], "level", axis=2)
    outputs = _answers(graph, picture, peak, place, level)
    for stride in STRIDES[1:]:
        count = (height // stride) * (width // stride)
        for part, columns in (("cls", 1), ("obj", 1), ("bbox", 4), ("kps", 10)):
            nothing = graph.constant(f"nothing_{part}_{stride}", np.zeros((1, count, columns), np.float32))
            outputs.append(graph.node("Identity", [nothing], f"{part}_{stride}"))
    save_model(path, graph, [(name, TensorProto.FLOAT) for name in outputs], [1, 3, height, width], None, {})
    return path


def _template(picture: FacePicture) -> Array:
    """Return the face about the point between its eyes, of zero mean and unit norm (h, w)."""
    right_eye, left_eye = picture.landmarks_px[:2]
    scale = float(np.hypot(*(left_eye - right_eye))) / _EYES_PX
    half = [round(_EYES_PX * share) for share in _HALF]
    size = (2 * half[0] + 1, 2 * half[1] + 1)
    middle = 0.5 * (right_eye + left_eye)
    smooth = cv2.GaussianBlur(picture.image, (0, 0), 0.45 * scale) if scale > 1.3 else picture.image
    matrix = np.array([[scale, 0.0, middle[0] - scale * half[0]], [0.0, scale, middle[1] - scale * half[1]]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    patch = cv2.warpAffine(smooth, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE).mean(2)
    patch = patch - patch.mean()
    return np.asarray(patch / np.linalg.norm(patch), np.float32)


def _correlation(
    graph: Graph, image: str, kernel: str, patch: tuple[int, ...], level: int, shape: tuple[int, int]
) -> str:
    """Return the map (1, 1, h, w) of the correlation with a face of one size, at the image's resolution."""
    factor = _EYES_PX / _SIZES_PX[level]
    small = [round(side * factor) for side in shape]
    sizes = graph.constant(f"small{level}", np.array([1, 1, *small]))
    shrunk = graph.node(
        "Resize", [_smoothed(graph, image, level, 1.0 / factor), "", "", sizes], f"shrunk{level}", mode="linear"
    )
    found = graph.node("Conv", [shrunk, kernel], f"found{level}", auto_pad="SAME_UPPER")
    mean = _mean(graph, shrunk, patch)
    mean_square = _mean(graph, graph.node("Mul", [shrunk, shrunk], f"square{level}"), patch)
    variance = graph.node(
        "Sub", [mean_square, graph.node("Mul", [mean, mean], f"squared_mean{level}")], f"variance{level}"
    )
    floor = graph.node("Max", [variance, graph.constant("floor", np.array(_FLOOR, np.float32))], f"floored{level}")
    count = graph.constant("count", np.array(float(patch[0] * patch[1]), np.float32))
    norm = graph.node("Sqrt", [graph.node("Mul", [floor, count], f"sum{level}")], f"norm{level}")
    ratio = graph.node("Div", [found, norm], f"ratio{level}")
    full = graph.constant("full", np.array([1, 1, *(side // _STEP_PX for side in shape)]))
    return graph.node("Resize", [ratio, "", "", full], f"level_map{level}", mode="cubic")


def _mean(graph: Graph, image: str, patch: tuple[int, ...]) -> str:
    """Return the mean over a patch (h, w) about every pixel."""
    kernels = [(1, 1, patch[0], 1), (1, 1, 1, patch[1])]
    for i, shape in enumerate(kernels):
        even = graph.constant(f"even{i}", np.full(shape, 1.0 / max(shape), np.float32))
        image = graph.node("Conv", [image, even], f"{image}_{'hv'[i]}", auto_pad="SAME_UPPER")
    return image


def _smoothed(graph: Graph, image: str, level: int, shrink: float) -> str:
    """Return the image without what a shrunk one cannot show."""
    if shrink <= 1.3:
        return image
    line = cv2.getGaussianKernel(2 * round(1.5 * 0.45 * shrink) + 1, 0.45 * shrink).astype(np.float32)
    across = graph.constant(f"across{level}", line.reshape(1, 1, 1, -1))
    down = graph.constant(f"down{level}", line.reshape(1, 1, -1, 1))
    once = graph.node("Conv", [image, across], f"across_{level}", auto_pad="SAME_UPPER")
    return graph.node("Conv", [once, down], f"smooth{level}", auto_pad="SAME_UPPER")


def _by_cell(graph: Graph, name: str, shape: tuple[int, int]) -> str:
    """Return a map (1, 1, h, w) as (1, cells, pixels of a cell)."""
    rows, columns = shape[0] // _CELL_PX, shape[1] // _CELL_PX
    apart = graph.constant("apart", np.array([rows, _PER_CELL, columns, _PER_CELL]))
    split = graph.node("Reshape", [name, apart], f"{name}_split")
    turned = graph.node("Transpose", [split], f"{name}_turned", perm=[0, 2, 1, 3])
    flat = graph.constant("cells", np.array([1, rows * columns, _PER_CELL**2]))
    return graph.node("Reshape", [turned, flat], f"{name}_by_cell")


def _answers(graph: Graph, picture: FacePicture, peak: str, place: str, level: str) -> list[str]:
    """Return the names of the four outputs of the finest stride."""
    least = graph.constant("least", np.array(_LEAST, np.float32))
    gain = graph.constant("gain", np.array(1.0 / (_SURE - _LEAST), np.float32))
    above = graph.node("Mul", [graph.node("Sub", [peak, least], "above"), gain], "gained")
    limits = [graph.constant("none", np.array(0.0, np.float32)), graph.constant("one", np.array(1.0, np.float32))]
    score = graph.node("Clip", [above, *limits], "score")
    names = [graph.node("Identity", [score], f"{part}_{_CELL_PX}") for part in ("cls", "obj")]
    # From the cell's corner to the pixel's centre.
    y, x = np.mgrid[0:_PER_CELL, 0:_PER_CELL]
    pixels = ((np.column_stack([x.ravel(), y.ravel()]) + 0.5) / _PER_CELL).astype(np.float32)
    right_eye, left_eye = picture.landmarks_px[:2]
    units = np.array(_SIZES_PX) / _CELL_PX / float(np.hypot(*(left_eye - right_eye)))
    middle = 0.5 * (right_eye + left_eye)
    box = np.array(picture.xyxy_px).reshape(2, 2)
    centre, size = box.mean(0) - middle, box[1] - box[0]
    places = {
        "bbox": np.hstack([units[:, None] * centre, np.log(units[:, None] * size)]),
        "kps": units[:, None] * (picture.landmarks_px - middle).ravel(),
    }
    index = [
        graph.node("Squeeze", [name, graph.constant("axis", np.array([2]))], f"{name}_index") for name in (place, level)
    ]
    for part, table in places.items():
        moved = np.zeros((len(pixels), table.shape[1]), np.float32)
        moved[:, : 2 if part == "bbox" else None] = np.tile(pixels, 1 if part == "bbox" else 5)
        shift = graph.node("Gather", [graph.constant(f"pixels_{part}", moved), index[0]], f"shift_{part}", axis=0)
        known = graph.constant(f"table_{part}", table.astype(np.float32))
        there = graph.node("Gather", [known, index[1]], f"there_{part}", axis=0)
        names.append(graph.node("Add", [shift, there], f"{part}_{_CELL_PX}"))
    return names
