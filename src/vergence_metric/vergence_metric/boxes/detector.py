"""Any YOLO as an ONNX file, made to answer alike: `detect` gives boxes in raw pixels of the image."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.decoding import Raw, decode
from vergence_metric.boxes.detections import Detections, make_detections
from vergence_metric.boxes.errors import DetectorError, DetectorImageError, ModelClassError
from vergence_metric.boxes.layouts import find_layout
from vergence_metric.boxes.letterbox import Letterbox, blob
from vergence_metric.boxes.parameters import DetectorParameters
from vergence_metric.boxes.second_look import CROP_PX, look_again
from vergence_metric.boxes.session import ModelSession
from vergence_metric.boxes.suppression import suppress

_DEFAULT_SIZE_PX = (640, 640)
_DEFAULT_THRESHOLD = 0.35
_GREY = 114
_FIRST_SHARE = 0.5  # of the threshold: what the first look need say for a second one
_CLOSER_LEAST = 0.05


@dataclass(frozen=True)
class Preprocessing:
    """How an image becomes the input; see DetectorParameters."""

    color: str
    unit_scale: bool
    resize: str


class Detector:
    """A loaded detector. Loading runs it once, so that the first image is not late and its layout is known."""

    def __init__(self, parameters: DetectorParameters, threads: int = 1) -> None:
        """Load the model that the parameters name.

        Raises:
            ModelFileError, ModelLayoutError, ModelClassError, DetectorError: one clear line each.

        """
        self._session = ModelSession(parameters.model, parameters.device, threads)
        self.input_px = _input_size(self._session, parameters)
        names = self._session.class_names()
        picture = np.full((self.input_px[1], self.input_px[0], 3), _GREY, np.uint8)
        # Range and order of the channels do not change the outputs' shapes.
        outputs = self._session.run(blob(picture, "rgb", True, self._session.input.dtype))
        self.layout = find_layout(
            self._session.output_names,
            outputs,
            self.input_px,
            self._session.metadata,
            parameters.layout,
            len(names) or None,
        )
        self.preprocessing = _preprocessing(parameters, self.layout.name, self._session.input.dtype)
        self.class_names = names or tuple(str(i) for i in range(self.layout.classes or 0))
        self._letterboxes: dict[tuple[int, int], Letterbox] = {}
        fixed = self._session.input.width_px or self._session.input.height_px
        # Suppression inside the model has its own threshold, which hides what a second look could have saved.
        self._takes_crops = not (fixed or self.layout.suppressed or any(s % self._session.stride_px() for s in CROP_PX))
        self._at_once = self._takes_crops and self._takes_several()
        self.set_parameters(parameters)

    @property
    def path(self) -> Path:
        """The model's file."""
        return self._session.path

    @property
    def threshold(self) -> float:
        """The score that objects need."""
        return self._parameters.threshold or self._session.own_threshold() or _DEFAULT_THRESHOLD

    def describe(self) -> str:
        """Return one line on what was loaded."""
        how = self.preprocessing
        width, height = self.input_px
        return (
            f"{self.path.name}: {self.layout}, input {width}x{height} {how.color} "
            f"{'0..1' if how.unit_scale else '0..255'} by {how.resize}, threshold {self.threshold:g}, "
            f"{'looks twice' if self.looks_twice else 'looks once'}"
        )

    def set_parameters(self, parameters: DetectorParameters) -> None:
        """Take changed thresholds and classes; raises ModelClassError for classes the model does not have."""
        self._wanted = self.class_ids(parameters.classes)
        self._parameters = parameters

    def class_ids(self, wanted: tuple[str, ...]) -> NDArray[np.int64] | None:
        """Return the numbers of classes given by name or number, None for none; raises ModelClassError."""
        return _class_ids(wanted, self.class_names)

    def detect(self, image: NDArray[Any]) -> Detections:
        """Return the objects in an image (h, w, 3) BGR or (h, w) grey uint8; raises DetectorImageError for others."""
        colour = _colour(image)
        p, size, wanted = self._parameters, (image.shape[1], image.shape[0]), self.threshold
        outputs = self._session.run(self._tensor(colour))
        raw = decode(self.layout, outputs, self.input_px, _FIRST_SHARE * wanted if self.looks_twice else wanted)
        chosen = np.arange(len(raw.scores))
        if self._wanted is not None:
            chosen = chosen[np.isin(raw.class_ids, self._wanted)]
        if not self.layout.suppressed:
            chosen = chosen[suppress(raw.xyxy[chosen], raw.scores[chosen], raw.class_ids[chosen], p.iou, p.max_det)]
        else:
            chosen = chosen[np.argsort(-raw.scores[chosen], kind="stable")][: p.max_det]
        boxes, scores, ids = (
            self._letterboxes[size].to_source(raw.xyxy[chosen]),
            raw.scores[chosen],
            raw.class_ids[chosen],
        )
        if self.looks_twice:
            boxes, scores = look_again(colour, boxes, scores, ids, size[0] / self.input_px[0], self._see)
            # Two first boxes may turn out to be one thing.
            kept = suppress(boxes, scores, ids, p.iou, p.max_det)
            kept = kept[scores[kept] >= wanted]
            boxes, scores, ids = boxes[kept], scores[kept], ids[kept]
        return make_detections(boxes, scores, ids, self.class_names, size)

    @property
    def looks_twice(self) -> bool:
        """True if boxes are looked at again: asked for, and the model takes crops."""
        return self._parameters.second_look and self._takes_crops

    def _see(self, pictures: list[NDArray[np.uint8]]) -> list[Raw]:
        how = self.preprocessing
        found = []
        for several in [pictures] if self._at_once else [[picture] for picture in pictures]:
            outputs = self._session.run(blob(several, how.color, how.unit_scale, self._session.input.dtype))
            for i in range(len(several)):
                one = [output[i : i + 1] for output in outputs]
                found.append(decode(self.layout, one, CROP_PX, _CLOSER_LEAST))
        return found

    def _takes_several(self) -> bool:
        """Tell whether the model takes several crops at once; a declared batch size proves nothing."""
        how, picture = self.preprocessing, np.full((CROP_PX[1], CROP_PX[0], 3), _GREY, np.uint8)
        try:
            outputs = self._session.run(blob([picture] * 2, how.color, how.unit_scale, self._session.input.dtype))
        except DetectorError:
            return False
        return all(len(outputs[i]) == 2 for i in self.layout.outputs)

    def _tensor(self, colour: NDArray[np.uint8]) -> NDArray[Any]:
        size = (colour.shape[1], colour.shape[0])
        if size not in self._letterboxes:
            self._letterboxes = {size: Letterbox.fit(size, self.input_px, self.preprocessing.resize)}
        how = self.preprocessing
        return blob(self._letterboxes[size].place(colour), how.color, how.unit_scale, self._session.input.dtype)


def _colour(image: NDArray[Any]) -> NDArray[np.uint8]:
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)) or not image.size:
        raise DetectorImageError(
            f"image is {image.dtype} {image.shape}: allowed is uint8 (h, w, 3) or (h, w), not empty"
        )
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image, np.uint8)


def _input_size(session: ModelSession, parameters: DetectorParameters) -> tuple[int, int]:
    wanted = (parameters.imgsz_width, parameters.imgsz_height)
    if 0 in wanted:
        wanted = session.own_size_px() or _DEFAULT_SIZE_PX
    stride = session.stride_px()
    # A dynamic input must still be whole strides, or the network's own maps do not fit each other.
    width, height = (-(-side // stride) * stride for side in wanted)
    return session.input.width_px or width, session.input.height_px or height


def _preprocessing(parameters: DetectorParameters, layout: str, dtype: Any) -> Preprocessing:
    raw = layout == "yolox"
    color = parameters.color if parameters.color != "auto" else ("bgr" if raw else "rgb")
    resize = parameters.resize if parameters.resize != "auto" else ("corner" if raw else "letterbox")
    scale = parameters.scale if parameters.scale != "auto" else ("byte" if raw or dtype == np.uint8 else "unit")
    return Preprocessing(color, scale == "unit", resize)


def _class_ids(wanted: tuple[str, ...], names: tuple[str, ...]) -> NDArray[np.int64] | None:
    if not wanted:
        return None
    ids = []
    for word in wanted:
        if word in names:
            ids.append(names.index(word))
        elif word.isdigit() and (not names or int(word) < len(names)):
            ids.append(int(word))
        else:
            raise ModelClassError(f"class is {word!r}: the model has {', '.join(names) or 'numbers only'}")
    return np.array(ids, np.int64)
