"""The shipped detector on held-out renders: rooms, cubes and look-alikes of seeds that training never saw.

Full-size renders go through the detector as the node runs it. A network of YOLOv6-N's cost at the same input stands
beside its time.
"""

import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

from bench.results import Row
from training.average_precision import ImageResult, average_precision, mean_average_precision
from training.scenes import Stage, View
from vergence_metric.boxes import Detector
from vergence_metric.boxes.parameters import DetectorParameters

TARGET_SEEDS = range(950_000, 950_010)
EMPTY_SEEDS = range(960_000, 960_010)
VIEWS_WITH_TARGET, VIEWS_WITHOUT = 60, 100
SMALL_PX = (16.0, 32.0)  # 8 to 16 px wide at 320
LEAST_PX = 12.0
HARDLY_VISIBLE = 0.5


def run(say: Callable[[str], None]) -> list[Row]:
    """Render, detect, score."""
    with_target = _views(TARGET_SEEDS, VIEWS_WITH_TARGET, 1.0, say)
    empty = _views(EMPTY_SEEDS, VIEWS_WITHOUT, 0.0, say)
    everything = Detector(DetectorParameters(threshold=0.01, max_objects=50))
    say(everything.describe())
    results = [(view, everything.detect(view.image)) for view in with_target]
    whole = [_result(view, found, LEAST_PX, np.inf) for view, found in results]
    small = [_result(view, found, *SMALL_PX) for view, found in results]
    shipped = Detector(DetectorParameters())
    false_images = [len(shipped.detect(view.image)) for view in empty]
    found = sum(len(shipped.detect(view.image)) > 0 for view in with_target)
    say(f"{found} of {len(with_target)} renders with a cube have a detection at the shipped threshold")
    once_ms = _latency_ms(Detector(DetectorParameters(second_look=False)), with_target)
    shipped_ms = _latency_ms(shipped, with_target)
    size = shipped.input_px
    like = "a network of YOLOv6-N's cost, bare"
    return [
        Row("detector.ap50.cube", average_precision(whole, 0.5), "share"),
        Row("detector.ap50_95.cube", mean_average_precision(whole), "share"),
        Row("detector.ap50_small.cube", average_precision(small, 0.5), "share"),
        Row("detector.false_positives", 1000.0 * sum(false_images) / len(empty), "per 1000 renders"),
        Row("detector.latency_ms", shipped_ms, "ms, as the node runs it", like, _peer_latency_ms(size)),
        Row("detector.latency_one_look_ms", once_ms, "ms, without the closer look"),
        Row("detector.model_mb", shipped.path.stat().st_size * 1e-6, "MB"),
    ]


def _views(seeds: range, count: int, target_share: float, say: Callable[[str], None]) -> list[View]:
    views: list[View] = []
    for seed in seeds:
        stage = Stage(seed)
        views += list(stage.views(count, target_share))
        stage.close()
        say(f"{len(views)} of {len(seeds) * count} renders{'' if target_share else ' without a target'}")
    return views


def _result(view: View, found: "object", least_px: float, most_px: float) -> ImageResult:
    width = view.boxes_px[:, 2] - view.boxes_px[:, 0]
    ignored = (width < least_px) | (width >= most_px) | (view.visible < HARDLY_VISIBLE)
    boxes, scores = found.xyxy_px, found.scores  # type: ignore[attr-defined]
    if np.isfinite(most_px):
        # Targets of other sizes belong to other rows.
        own = (boxes[:, 2] - boxes[:, 0] > 0.5 * least_px) & (boxes[:, 2] - boxes[:, 0] < 2.0 * most_px)
        boxes, scores = boxes[own], scores[own]
    return ImageResult(boxes, scores, view.boxes_px, ignored)


def _latency_ms(detector: Detector, views: list[View]) -> float:
    times = []
    for i in range(120):
        image = views[i % len(views)].image
        started = time.perf_counter()
        detector.detect(image)
        times.append(time.perf_counter() - started)
    return float(np.median(times[20:]) * 1e3)


def _peer_latency_ms(size: tuple[int, int]) -> float:
    """Return the time of a plain network of about YOLOv6-N's multiplications, one thread, same input."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "peer.onnx"
        width, height = (-(-side // 32) * 32 for side in size)
        _write_peer(path, width, height)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        picture = np.random.default_rng(0).random((1, 3, height, width), np.float32)
        times = []
        for _ in range(40):
            started = time.perf_counter()
            session.run(None, {"images": picture})
            times.append(time.perf_counter() - started)
    return float(np.median(times[10:]) * 1e3)


def _write_peer(path: Path, width: int, height: int) -> None:
    """Write 3x3 convolutions with ReLU: YOLOv6-N's backbone widths and depths, and its neck's share at each stride.

    5.7 G multiplications at 640x640, of which its authors publish twice as operations (11.4 G).
    """
    rng = np.random.default_rng(1)
    nodes, weights, last, channels = [], [], "images", 3
    stages = [(16, 2)] + [(32, 2)] + [(32, 1)] * 3 + [(64, 2)] + [(64, 1)] * 6 + [(128, 2)] + [(128, 1)] * 9
    stages += [(256, 2)] + [(256, 1)] * 4
    for number, (outputs, stride) in enumerate(stages):
        kernel = rng.normal(0, 0.02, (outputs, channels, 3, 3)).astype(np.float32)
        weights.append(numpy_helper.from_array(kernel, f"w{number}"))
        nodes.append(helper.make_node("Conv", [last, f"w{number}"], [f"c{number}"], strides=[stride] * 2, pads=[1] * 4))
        nodes.append(helper.make_node("Relu", [f"c{number}"], [f"r{number}"]))
        last, channels = f"r{number}", outputs
    graph = helper.make_graph(
        nodes,
        "peer",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, height, width])],
        [helper.make_tensor_value_info(last, TensorProto.FLOAT, None)],
        weights,
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8), str(path))
