"""Which registered layout a model has: by metadata, output names, and shapes and values of its warm-up run."""

from vergence_metric.boxes.errors import DetectorError, ModelLayoutError
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
    matching = _fitting(warm_up)
    fitting = [layout for layout in matching if not _unexplained(layout, warm_up)]
    named = wanted if wanted != AUTO else warm_up.metadata.get("layout")
    for layout in fitting:
        if layout.name == named:
            return _checked(layout, warm_up)
    shapes = ", ".join(
        f"{name} {list(output.shape)}" for name, output in zip(warm_up.output_names, warm_up.outputs, strict=True)
    )
    if matching and not fitting:
        layout = next((layout for layout in matching if layout.name == named), matching[0])
        raise ModelLayoutError(
            f"every output of the model must be explained: {', '.join(_unexplained(layout, warm_up))} is no part of "
            f"the layout {layout.name!r} ({layout.description}), which the outputs {shapes} would fit otherwise"
        )
    if wanted != AUTO:
        raise ModelLayoutError(f"the model's outputs must have the layout {wanted!r}: got {shapes}")
    width, height = warm_up.input_px
    if not fitting:
        maps = all(output.ndim in (4, 5) for output in warm_up.outputs)
        hint = ", maps before decoding: export it with its detection head (YOLOv7: --grid)" if maps else ""
        raise ModelLayoutError(
            f"the model's outputs must have one of the detector layouts {', '.join(layout_names())}: got {shapes} "
            f"for an input of {width}x{height} px{hint}"
        )
    against = {layout: layout.contradiction(warm_up) for layout in (_checked(one, warm_up) for one in fitting)}
    agreeing = [layout for layout, reason in against.items() if not reason]
    if len(agreeing) == 1:
        return agreeing[0]
    parameter = "the parameter 'detector.layout'"
    if not agreeing:
        reasons = "; ".join(f"to be {layout.name}, {reason}" for layout, reason in against.items())
        raise ModelLayoutError(
            f"the model's outputs {shapes} must have the values of a layout, not only its shape: {reasons}. If it is "
            f"one of these nevertheless, say which by {parameter}"
        )
    names = " or ".join(layout.name for layout in agreeing)
    also = "" if len({layout.classes for layout in agreeing}) == 1 else ", or name its classes by 'detector.labels'"
    raise ModelLayoutError(f"the model's outputs {shapes} could be {names}: say which by {parameter}{also}")


def _checked(layout: Layout, warm_up: WarmUp) -> Layout:
    try:
        layout.check_numbers([warm_up.outputs[i] for i in layout.outputs])
    except DetectorError as error:
        raise ModelLayoutError(f"{error} (for a picture of test patterns)") from error
    return layout


def _unexplained(layout: Layout, warm_up: WarmUp) -> list[str]:
    """Return name and shape of every output that the layout neither needs nor explains."""
    named = zip(warm_up.output_names, warm_up.outputs, strict=True)
    return [
        f"{name} {list(output.shape)}"
        for i, (name, output) in enumerate(named)
        if i not in layout.outputs and not layout.explains(output, warm_up)
    ]


def _fitting(warm_up: WarmUp) -> list[Layout]:
    """Return the layouts that fit by names and shapes."""
    fitting = [layout for kind in registered_layouts() if (layout := kind.matches(warm_up)) is not None]
    certain = [layout for layout in fitting if layout.certain]
    if certain:
        return certain
    # Further outputs repeat the first ones before decoding.
    first = min((layout.outputs[0] for layout in fitting), default=0)
    return [layout for layout in fitting if layout.outputs[0] == first]
