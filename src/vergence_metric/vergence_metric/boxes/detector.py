"""A detector in an ONNX file; `detect` returns boxes in raw pixels of the image, whatever the model's layout."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.class_names import class_names, read_labels
from vergence_metric.boxes.detections import Detections, make_detections
from vergence_metric.boxes.errors import DetectorError, DetectorImageError, ModelClassError, ModelLayoutError
from vergence_metric.boxes.layouts import Candidates, Layout, WarmUp, find_layout
from vergence_metric.boxes.letterbox import BORDER_GREY, Letterbox
from vergence_metric.boxes.parameters import DetectorParameters
from vergence_metric.boxes.preprocessing import Preprocessing
from vergence_metric.boxes.second_look import CROP_PX, look_again
from vergence_metric.boxes.session import ModelSession
from vergence_metric.boxes.suppression import suppress
from vergence_metric.boxes.warm_up_picture import warm_up_picture

_DEFAULT_SIZE_PX = (640, 640)
_MAX_DIGITS = 9
_FIRST_LOOK_SHARE = 0.5  # of the threshold: score that earns a box a second look
_LEAST_CROP_SCORE = 0.05


class Detector:
    """A loaded detector. Loading runs it once, so that the first image is not late and its layout is recognised."""

    def __init__(self, parameters: DetectorParameters, threads: int = 1) -> None:
        """Load the model that the parameters name.

        Args:
            parameters: which model, and what is done to its input and output.
            threads: that one operator of the network may use; 0 leaves it to onnxruntime.

        Raises:
            ModelFileError, ModelLayoutError, ModelClassError, DetectorError: one clear line each.

        """
        self._session = ModelSession(parameters.model, parameters.device, threads)
        self.input_px = _input_size(self._session, parameters)
        given, metadata = read_labels(parameters.labels), self._session.class_names()
        self.layout = self._recognised(parameters.layout, len(metadata), len(given))
        self.preprocessing = self.layout.preprocessing(self._session.input.dtype).overridden(
            parameters.color, parameters.scale, parameters.resize
        )
        self.class_names = class_names(parameters.labels, given, metadata, self.layout.class_names, self.layout.classes)
        self._letterboxes: dict[tuple[int, int], Letterbox] = {}
        fixed = self._session.input.width_px or self._session.input.height_px
        whole_strides = not any(side % self._session.stride_px() for side in CROP_PX)
        # Suppression inside the model has its own threshold, which hides what a second look could have saved.
        self._accepts_crops = whole_strides and not fixed and not self.layout.suppressed
        self._batches_crops = self._accepts_crops and self._accepts_batches()
        self.set_parameters(parameters)

    @property
    def path(self) -> Path:
        """The model's file."""
        return self._session.path

    @property
    def threshold(self) -> float:
        """The score that objects need: the parameter's, else the one in the model's metadata, else the layout's."""
        return self._parameters.threshold or self._session.metadata_threshold() or self.layout.default_threshold

    @property
    def second_look(self) -> bool:
        """True if boxes are looked at a second time: the parameter asks for it, and the model accepts crops."""
        return self._parameters.second_look and self._accepts_crops

    def describe(self) -> str:
        """Return one line on what was loaded."""
        width, height = self.input_px
        return (
            f"{self.path.name}: {self.layout}, input {width}x{height} {self.preprocessing}, "
            f"threshold {self.threshold:g}, {'with' if self.second_look else 'without'} a second look"
        )

    def set_parameters(self, parameters: DetectorParameters) -> None:
        """Apply changed thresholds and classes; raises ModelClassError for classes the model does not have."""
        self._wanted = self.class_ids(parameters.classes)
        self._parameters = parameters

    def class_ids(self, wanted: tuple[str, ...]) -> NDArray[np.int64] | None:
        """Return the numbers of classes given by name or number, None for none; raises ModelClassError."""
        return _class_ids(wanted, self.class_names)

    def classes_of(self, wanted: tuple[str, ...]) -> tuple[str, ...]:
        """Return the names of the classes that are looked for where these are wanted, all for none."""
        ids = self.class_ids(wanted)
        return self.class_names if ids is None else tuple(self._name(number) for number in ids)

    def _name(self, number: int) -> str:
        return self.class_names[number] if number < len(self.class_names) else str(number)

    def detect(self, image: NDArray[Any]) -> Detections:
        """Return the objects in an image (h, w, 3) BGR or (h, w) grey uint8; raises DetectorImageError for others."""
        colour = _colour(image)
        p, size, threshold = self._parameters, (image.shape[1], image.shape[0]), self.threshold
        least = _FIRST_LOOK_SHARE * threshold if self.second_look else threshold
        found = self.layout.candidates(self._session.run(self._tensor(colour)), self.input_px, least)
        if self._wanted is not None:
            found = found.rows(np.isin(found.class_ids, self._wanted))
        if self.layout.suppressed:
            found = found.rows(np.argsort(-found.scores, kind="stable")[: p.max_objects])
        else:
            found = found.rows(suppress(found.xyxy, found.scores, found.class_ids, p.iou_threshold, p.max_objects))
        found = _to_source(found, self._letterboxes[size])
        if self.second_look:
            found = look_again(colour, found, size[0] / self.input_px[0], self._detect_in_crops)
            # After it, two boxes may be the same object's.
            found = found.rows(suppress(found.xyxy, found.scores, found.class_ids, p.iou_threshold, p.max_objects))
            found = found.rows(found.scores >= threshold)
        return make_detections(found.xyxy, found.scores, found.class_ids, self.class_names, size, found.landmarks)

    def _recognised(self, wanted: str, named: int, given: int) -> Layout:
        """Return the layout; the number of names in a labels file counts only where nothing else decides.

        `named` and `given` are how many names the metadata and the labels file hold.
        """
        warm_up = self._warm_up(named or None)
        try:
            return find_layout(warm_up, wanted)
        except ModelLayoutError as undecided:
            if named or not given:
                raise
            try:
                return find_layout(replace(warm_up, class_count=given), wanted)
            except ModelLayoutError:
                raise undecided from None

    def _warm_up(self, class_count: int | None) -> WarmUp:
        # Range and order of the channels change neither the outputs' shapes nor what recognition looks for in them.
        dtype = self._session.input.dtype
        any_order = Preprocessing("rgb", dtype != np.uint8, "letterbox")
        outputs = self._session.run(any_order.tensor([warm_up_picture(self.input_px)], dtype))
        return WarmUp(self._session.output_names, outputs, self.input_px, self._session.metadata, class_count)

    def _detect_in_crops(self, crops: list[NDArray[np.uint8]]) -> list[Candidates]:
        found = []
        for batch in [crops] if self._batches_crops else [[crop] for crop in crops]:
            outputs = self._session.run(self.preprocessing.tensor(batch, self._session.input.dtype))
            for i in range(len(batch)):
                one = [output[i : i + 1] for output in outputs]
                found.append(self.layout.candidates(one, CROP_PX, _LEAST_CROP_SCORE))
        return found

    def _accepts_batches(self) -> bool:
        """Return whether the model accepts several crops at once; a declared batch size proves nothing."""
        pictures = [_grey(CROP_PX)] * 2
        try:
            outputs = self._session.run(self.preprocessing.tensor(pictures, self._session.input.dtype))
        except DetectorError:
            return False
        return all(len(outputs[i]) == 2 for i in self.layout.outputs)

    def _tensor(self, colour: NDArray[np.uint8]) -> NDArray[Any]:
        size = (colour.shape[1], colour.shape[0])
        if size not in self._letterboxes:
            self._letterboxes = {size: Letterbox.fit(size, self.input_px, self.preprocessing.resize)}
        return self.preprocessing.tensor(
            [self._letterboxes[size].place(colour, self.preprocessing.border)], self._session.input.dtype
        )


def _to_source(found: Candidates, letterbox: Letterbox) -> Candidates:
    """Return candidates in raw pixels of the image."""
    landmarks = None if found.landmarks is None else letterbox.points_to_source(found.landmarks)
    return Candidates(letterbox.to_source(found.xyxy), found.scores, found.class_ids, landmarks)


def _grey(size_px: tuple[int, int]) -> NDArray[np.uint8]:
    return np.full((size_px[1], size_px[0], 3), BORDER_GREY, np.uint8)


def _colour(image: NDArray[Any]) -> NDArray[np.uint8]:
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)) or not image.size:
        raise DetectorImageError(f"image must be uint8 (h, w, 3) or (h, w), not empty: got {image.dtype} {image.shape}")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image, np.uint8)


def _input_size(session: ModelSession, parameters: DetectorParameters) -> tuple[int, int]:
    wanted = (parameters.input_width_px, parameters.input_height_px)
    if 0 in wanted:
        wanted = session.metadata_input_px() or _DEFAULT_SIZE_PX
    stride = session.stride_px()
    # A dynamic input must still be whole strides, or the network's own maps do not fit each other.
    width, height = (-(-side // stride) * stride for side in wanted)
    return session.input.width_px or width, session.input.height_px or height


def _class_ids(wanted: tuple[str, ...], names: tuple[str, ...]) -> NDArray[np.int64] | None:
    if not wanted:
        return None
    ids = []
    for name in wanted:
        if name in names:
            ids.append(names.index(name))
        elif name.isdecimal() and len(name) <= _MAX_DIGITS and (not names or int(name) < len(names)):
            ids.append(int(name))
        else:
            raise ModelClassError(
                f"class must be one of the model's ({', '.join(names) or 'numbers only'}): got {name!r}"
            )
    return np.array(ids, np.int64)
