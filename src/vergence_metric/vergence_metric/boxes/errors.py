"""Errors of a detector; each message is one line."""


class DetectorError(ValueError):
    """A detector that cannot be used."""


class ModelFileError(DetectorError):
    """A model file that is missing, truncated, not ONNX, or needs operators that onnxruntime lacks."""


class ModelLayoutError(DetectorError):
    """A model whose inputs or outputs are none of the registered layouts, or could be several."""


class ModelClassError(DetectorError):
    """A class that the parameters name and the model does not have."""


class DetectorImageError(DetectorError):
    """An image that is not (h, w, 3) or (h, w) uint8."""
