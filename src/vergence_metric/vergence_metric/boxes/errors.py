"""What can be wrong with a detector: one clear line each."""


class DetectorError(ValueError):
    """A detector that cannot be used."""


class ModelFileError(DetectorError):
    """A model file that is missing, truncated, no ONNX, or needs operators that are not here."""


class ModelLayoutError(DetectorError):
    """A model whose inputs or outputs are none of the layouts known, or could be several."""


class ModelClassError(DetectorError):
    """Classes asked for that the model does not have."""


class DetectorImageError(DetectorError):
    """An image that is not (h, w, 3) or (h, w) uint8."""
