"""Parameters of the detector, of metric II and of box_metric_node."""

from dataclasses import dataclass

from vergence_metric.pairs.stereo_parameters import StereoParameters
from vergence_rig.parameters import Groups, ParameterError, Parameters, parameter

LAYOUTS = ("auto", "yolov6", "yolov6_end_to_end", "yolov6_ort", "yolov5", "yolov8", "yolov10", "yolox")
DEVICES = ("cpu", "cuda", "tensorrt", "openvino", "coreml", "directml")
STRIDE_LIMIT_PX = 4096


@dataclass(frozen=True)
class DetectorParameters(Parameters):
    """Which model finds things, and what is done to its input and output."""

    model: str = parameter(
        "", "path of an ONNX detector; empty for the one that ships with the package, for Rubik's cubes", read_only=True
    )
    device: str = parameter("cpu", "where onnxruntime runs it", choices=DEVICES, read_only=True)
    threshold: float = parameter(
        0.0,
        "objects with a lower score are left out; 0 for what the model says, else 0.35; an export with suppression "
        "inside has its own threshold besides",
        minimum=0.0,
        maximum=1.0,
    )
    iou: float = parameter(
        0.45, "of two boxes of a class that overlap by more the weaker goes", minimum=0.0, maximum=1.0
    )
    max_det: int = parameter(20, "most objects of one image", minimum=1, maximum=3000)
    classes: tuple[str, ...] = parameter((), "names or numbers of the classes that count; empty for all")
    imgsz_height: int = parameter(
        0,
        "height of the network's input; 0 for what the model says; a fixed input size of the model goes before",
        unit="px",
        minimum=0,
        maximum=STRIDE_LIMIT_PX,
        read_only=True,
    )
    imgsz_width: int = parameter(
        0,
        "width of the network's input, like imgsz_height",
        unit="px",
        minimum=0,
        maximum=STRIDE_LIMIT_PX,
        read_only=True,
    )
    layout: str = parameter("auto", "how the model's output reads; auto finds out", choices=LAYOUTS, read_only=True)
    color: str = parameter(
        "auto",
        "order of the input's channels; auto is rgb, bgr for yolox",
        choices=("auto", "rgb", "bgr"),
        read_only=True,
    )
    scale: str = parameter(
        "auto",
        "range of the input: unit is 0..1, byte 0..255; auto is unit, byte for yolox",
        choices=("auto", "unit", "byte"),
        read_only=True,
    )
    resize: str = parameter(
        "auto",
        "how an image becomes the input: letterbox centres it, corner puts it top left, stretch fills the input; auto "
        "is letterbox, corner for yolox",
        choices=("auto", "letterbox", "corner", "stretch"),
        read_only=True,
    )

    second_look: bool = parameter(
        True,
        "look at each box again on a crop of the full image, for finer sides and a surer score; models with a fixed "
        "input size or suppression inside look once",
    )

    def check(self) -> None:
        """Raise ParameterError where only one side of the input is given."""
        super().check()
        if (self.imgsz_height == 0) != (self.imgsz_width == 0):
            raise ParameterError(
                "imgsz_height", self.imgsz_height, f"0 if imgsz_width is 0, else at least 1 (it is {self.imgsz_width})"
            )


@dataclass(frozen=True)
class BoxMetricParameters(Parameters):
    """How the target's two boxes are chosen, measured and smoothed."""

    pair_vertical_px: float = parameter(
        12.0,
        "boxes of one object lie within this of the same row, besides the vertical offset learnt from earlier pairs",
        unit="px",
        minimum=1.0,
        maximum=200.0,
    )
    pair_size_ratio: float = parameter(
        1.6, "one object's two boxes differ in height by no more than this factor", minimum=1.05, maximum=5.0
    )
    pair_disparity_px: float = parameter(
        320.0, "largest disparity of one object, either way", unit="px", minimum=10.0, maximum=4000.0
    )
    pair_misfit: float = parameter(
        24.0,
        "boxes that fit worse than this in place, size, score and looks are not one object's "
        "[standard deviations squared, summed]",
        minimum=1.0,
        maximum=1000.0,
    )
    pair_margin: float = parameter(
        1.5,
        "the best pair must be better than one that shares a box with it by this [standard deviations squared]",
        minimum=0.0,
        maximum=50.0,
    )
    follow_gate_px: float = parameter(
        60.0,
        "the target is taken for the same if it moved less than this between pairs",
        unit="px",
        minimum=1.0,
        maximum=1000.0,
    )
    forget_s: float = parameter(
        1.0, "the target is forgotten when unseen for this", unit="s", minimum=0.0, maximum=60.0
    )
    occluded_ratio: float = parameter(
        1.25,
        "a pair whose widths or heights differ by more than this factor is partly hidden in one eye",
        minimum=1.02,
        maximum=3.0,
    )
    smoothing_lag_s: float = parameter(
        0.0,
        "lag that smoothing of the boxes may add to a steady motion; 0 is no smoothing",
        unit="s",
        minimum=0.0,
        maximum=1.0,
    )
    refine: bool = parameter(True, "measure the surface's disparity inside the pair of boxes too")


@dataclass(frozen=True)
class BoxMetricNodeParameters(BoxMetricParameters, DetectorParameters, StereoParameters):
    """Everything box_metric_node can be told; defaults equal config/box_metric_node.yaml."""

    enable: bool = parameter(True, "whether pairs are measured at all")
    rate_hz: float = parameter(
        10.5,
        "pairs measured a second at most, so that the rest of the graph keeps its cores",
        unit="Hz",
        minimum=0.1,
        maximum=240.0,
    )
    niceness: int = parameter(
        15,
        "how far detection gives way to other nodes that want the same core, as nice(1) means it",
        minimum=0,
        maximum=19,
        read_only=True,
    )

    def check(self) -> None:
        """Hold every part to its own rules."""
        for part in (BoxMetricParameters, DetectorParameters, StereoParameters):
            part.check(self)


GROUPS: Groups = (("", BoxMetricNodeParameters),)
