"""Parameters of the detector, of metric II and of box_metric_node, group by group."""

from dataclasses import dataclass, field

from vergence_metric.boxes.follow_parameters import FollowParameters, MotionParameters
from vergence_metric.boxes.layouts import AUTO, layout_names
from vergence_metric.boxes.letterbox import RESIZES
from vergence_metric.boxes.preprocessing import COLORS, SCALES
from vergence_metric.boxes.session import DEVICES
from vergence_metric.pairs.parameters import PairingParameters, StereoParameters
from vergence_rig.parameters import Groups, ParameterError, Parameters, parameter

_LARGEST_INPUT_PX = 4096


def _layout_choices() -> tuple[str, ...]:
    return (AUTO, *layout_names())


@dataclass(frozen=True)
class DetectorParameters(Parameters):
    """Which model detects objects, and what is done to its input and output."""

    model: str = parameter(
        "",
        "path of the detector's ONNX file; empty for the one that ships with the package, which detects Rubik's cubes",
        read_only=True,
        formerly="model",
    )
    device: str = parameter(
        "cpu", "device on which onnxruntime runs the detector", choices=DEVICES, read_only=True, formerly="device"
    )
    threshold: float = parameter(
        0.0,
        "least score of an object; 0 takes the one in the model's metadata, else 0.35, of YuNet 0.6. An export with "
        "suppression inside has its own threshold, which this one can only raise",
        minimum=0.0,
        maximum=1.0,
        formerly="threshold",
    )
    iou_threshold: float = parameter(
        0.45,
        "IoU threshold of non-maximum suppression: of two boxes of one class that overlap by more, the one with the "
        "lower score is dropped",
        minimum=0.0,
        maximum=1.0,
        formerly="iou",
    )
    max_objects: int = parameter(
        20,
        "most objects that are kept of one image, the best scores first",
        minimum=1,
        maximum=3000,
        formerly="max_det",
    )
    classes: tuple[str, ...] = parameter(
        (),
        'names of the classes that are detected, or their numbers as texts, such as "0"; empty for all',
        formerly="classes",
    )
    input_height_px: int = parameter(
        0,
        "height of the network's input; 0 takes the one in the model's metadata, else 640. A model with a fixed input "
        "size keeps that",
        unit="px",
        minimum=0,
        maximum=_LARGEST_INPUT_PX,
        read_only=True,
        formerly="imgsz_height",
    )
    input_width_px: int = parameter(
        0,
        "width of the network's input; 0 takes the one in the model's metadata, else 640. A model with a fixed input "
        "size keeps that",
        unit="px",
        minimum=0,
        maximum=_LARGEST_INPUT_PX,
        read_only=True,
        formerly="imgsz_width",
    )
    layout: str = parameter(
        AUTO,
        "layout of the model's outputs; auto recognises it by a run at the start",
        choices=_layout_choices,
        read_only=True,
        formerly="layout",
    )
    labels: str = parameter(
        "",
        "file of the classes' names: one a line, or 'names' in a YAML or JSON file; coco for the 80 classes of COCO; "
        "empty takes those in the model's metadata, else COCO's for a model of 80 classes, else numbers",
        read_only=True,
    )
    color: str = parameter(
        "auto",
        "order of the channels of the network's input; auto takes the layout's own, rgb for most",
        choices=("auto", *COLORS),
        read_only=True,
        formerly="color",
    )
    scale: str = parameter(
        "auto",
        "range of the network's input: unit is 0 to 1, byte 0 to 255; auto takes the layout's own, unit for most",
        choices=("auto", *SCALES),
        read_only=True,
        formerly="scale",
    )
    resize: str = parameter(
        "auto",
        "how an image is fitted into the network's input: letterbox centres it between borders, corner puts it top "
        "left, stretch fills the input; auto takes the layout's own, letterbox for most",
        choices=("auto", *RESIZES),
        read_only=True,
        formerly="resize",
    )
    second_look: bool = parameter(
        True,
        "run the network a second time on a crop of the full image about each of the best boxes, for more accurate "
        "sides and scores; a model with a fixed input size or with suppression inside runs once only",
        formerly="second_look",
    )

    def check(self) -> None:
        """Raise ParameterError where only one side of the input is given."""
        super().check()
        if (self.input_height_px == 0) != (self.input_width_px == 0):
            both = f"0 if input_width_px is 0, else at least 1 (input_width_px is {self.input_width_px})"
            raise ParameterError("input_height_px", self.input_height_px, both)


@dataclass(frozen=True)
class AssociationParameters(Parameters):
    """Which box of the right image can be the same object as a box of the left one."""

    max_vertical_px: float = parameter(
        12.0,
        "largest distance of one object's two boxes from the epipolar line, beside the vertical offset of the mounts, "
        "which is estimated from earlier pairs",
        unit="px",
        minimum=1.0,
        maximum=200.0,
        formerly="pair_vertical_px",
    )
    max_height_ratio: float = parameter(
        1.6,
        "largest ratio of the heights of one object's two boxes",
        minimum=1.05,
        maximum=5.0,
        formerly="pair_size_ratio",
    )
    max_disparity_px: float = parameter(
        320.0,
        "largest disparity of one object, positive or negative",
        unit="px",
        minimum=10.0,
        maximum=4000.0,
        formerly="pair_disparity_px",
    )
    max_cost: float = parameter(
        24.0,
        "largest cost of a pair of boxes, the sum of squared deviations in place, size, score and appearance; boxes "
        "with a larger one are not paired",
        unit="standard deviations squared",
        minimum=1.0,
        maximum=1000.0,
        formerly="pair_misfit",
    )
    min_margin: float = parameter(
        1.5,
        "least difference of cost between a pair and the next best one that shares a box with it; with less the pair "
        "is ambiguous",
        unit="standard deviations squared",
        minimum=0.0,
        maximum=50.0,
        formerly="pair_margin",
    )


@dataclass(frozen=True)
class BoxMeasurementParameters(Parameters):
    """How the target's pair of boxes is measured."""

    occlusion_ratio: float = parameter(
        1.25,
        "ratio of widths or of heights of the target's two boxes above which it counts as partly hidden in one eye",
        minimum=1.02,
        maximum=3.0,
        formerly="occluded_ratio",
    )
    smoothing_lag_s: float = parameter(
        0.0,
        "time by which smoothed boxes lag behind a steady motion; 0 does not smooth",
        unit="s",
        minimum=0.0,
        maximum=1.0,
        formerly="smoothing_lag_s",
    )
    refine: bool = parameter(
        True,
        "measure, beside the disparity of the boxes' centres, the mean disparity of the surface inside the boxes",
        formerly="refine",
    )


@dataclass(frozen=True)
class BoxMetricParameters:
    """All parameters that metric II of a pair of images depends on."""

    detector: DetectorParameters = field(default_factory=DetectorParameters)
    association: AssociationParameters = field(default_factory=AssociationParameters)
    follow: FollowParameters = field(default_factory=FollowParameters)
    motion: MotionParameters = field(default_factory=MotionParameters)
    measurement: BoxMeasurementParameters = field(default_factory=BoxMeasurementParameters)


@dataclass(frozen=True)
class BoxMetricNodeParameters(StereoParameters):
    """When box_metric_node measures, and where its images come from."""

    enable: bool = parameter(True, "measure pairs; false stops detection and frees its processor time")
    rate_hz: float = parameter(
        10.5,
        "most pairs that are measured per second; the rest of the processor time is left to other nodes",
        unit="Hz",
        minimum=0.1,
        maximum=240.0,
    )
    niceness: int = parameter(
        15,
        "niceness of the measuring thread, as of nice(1): with a higher value other nodes on the same core go first; "
        "0 in simulated time, which waits for it",
        minimum=0,
        maximum=19,
        read_only=True,
    )


GROUPS: Groups = (
    ("", BoxMetricNodeParameters),
    ("pair.", PairingParameters),
    ("detector.", DetectorParameters),
    ("association.", AssociationParameters),
    ("follow.", FollowParameters),
    ("motion.", MotionParameters),
    ("measurement.", BoxMeasurementParameters),
)
