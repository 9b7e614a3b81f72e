"""Which registered layout a model has: by metadata, output names, and shapes and values of its warm-up run."""

from vergence_metric.boxes.errors import ModelLayoutError
from vergence_metric.boxes.layouts.protocol import Layout, WarmUp
from vergence_metric.boxes.layouts.registry import layout_names, registered_layouts

AUTO = "auto"


def find_layout(warm_up: WarmUp, wanted: str = AUTO) -> Layout:
    """Return the layout of a model.

    Args:
        warm_up: its first run; of the metadata `task` and `layout` count.
        wanted: a layout's name, or auto.

    Raises:
        ModelLayoutError: no detector, or a layout that is unknown, ambiguous or not the one wanted.

    """
    task = warm_up.metadata.get("task", "detect")
    if task != "detect":
        raise ModelLayoutError(f"the model's task must be 'detect': got {task!r}")
    fitting = _fitting(warm_up)
    named = wanted if wanted != AUTO else warm_up.metadata.get("layout")
    for layout in fitting:
        if layout.name == named:
            return layout
    shapes = ", ".join(
        f"{name} {list(output.shape)}" for name, output in zip(warm_up.output_names, warm_up.outputs, strict=True)
    )
    if wanted != AUTO:
        raise ModelLayoutError(f"the model's outputs must have the layout {wanted!r}: got {shapes}")
    width, height = warm_up.input_px
    if not fitting:
        raise ModelLayoutError(
            f"the model's outputs must have one of the detector layouts {', '.join(layout_names())}: got {shapes} "
            f"for an input of {width}x{height} px"
        )
    agreeing = fitting if len(fitting) == 1 else [layout for layout in fitting if layout.values_agree(warm_up)]
    if len(agreeing) != 1:
        names = " or ".join(layout.name for layout in fitting)
        raise ModelLayoutError(
            f"the model's outputs {shapes} could be {names}: say which by the parameter 'detector.layout'"
        )
    return agreeing[0]


def _fitting(warm_up: WarmUp) -> list[Layout]:
    """Return the layouts that fit by names and shapes."""
    fitting = [layout for kind in registered_layouts() if (layout := kind.matches(warm_up)) is not None]
    certain = [layout for layout in fitting if layout.certain]
    if certain:
        return certain
    # Further outputs repeat the first ones before decoding.
    first = min((layout.outputs[0] for layout in fitting), default=0)
    return [layout for layout in fitting if layout.outputs[0] == first]
