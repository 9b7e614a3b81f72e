"""The names of a detector's classes: of a labels file, of the model's metadata, of its layout, or the COCO list."""

from collections.abc import Sequence
from pathlib import Path

from vergence_metric.boxes.errors import ModelClassError
from vergence_rig.regular_file import FileError
from vergence_rig.yaml_file import parse_yaml, read_small_text

COCO = "coco"
"""What the parameter `detector.labels` names the COCO list by."""

_COCO = (
    "person,bicycle,car,motorcycle,airplane,bus,train,truck,boat,traffic light,fire hydrant,stop sign,"
    "parking meter,bench,bird,cat,dog,horse,sheep,cow,elephant,bear,zebra,giraffe,backpack,umbrella,handbag,tie,"
    "suitcase,frisbee,skis,snowboard,sports ball,kite,baseball bat,baseball glove,skateboard,surfboard,"
    "tennis racket,bottle,wine glass,cup,fork,knife,spoon,bowl,banana,apple,sandwich,orange,broccoli,carrot,"
    "hot dog,pizza,donut,cake,chair,couch,potted plant,bed,dining table,toilet,tv,laptop,mouse,remote,keyboard,"
    "cell phone,microwave,oven,toaster,sink,refrigerator,book,clock,vase,scissors,teddy bear,hair drier,"
    "toothbrush"
)

COCO_NAMES = tuple(_COCO.split(","))
"""The 80 classes of COCO's boxes in order, by which models that carry no names are trained in most cases."""

_STRUCTURED = (".yaml", ".yml", ".json")  # every JSON file is YAML


def read_labels(labels: str) -> tuple[str, ...]:
    """Return the names in a labels file, one a line, or the list or map `names` of a YAML or JSON file.

    Args:
        labels: path of the file, or COCO; "" returns no names.

    Raises:
        ModelClassError: a file that cannot be read, or holds no names.

    """
    if not labels:
        return ()
    if labels == COCO:
        return COCO_NAMES
    try:
        text = read_small_text(labels)
        if Path(labels).suffix.lower() in _STRUCTURED:
            content = parse_yaml(text)
            names = names_of(content.get("names", content) if isinstance(content, dict) else content)
        else:
            names = tuple(line.strip() for line in text.splitlines() if line.strip())
    except FileError as error:
        raise ModelClassError(f"labels {labels}: {error}") from error
    if not names:
        raise ModelClassError(f"labels {labels} must hold the classes' names: got none")
    return names


def names_of(value: object) -> tuple[str, ...]:
    """Return the names of a list, or of a map from numbers; empty for anything else."""
    if isinstance(value, dict):
        try:
            value = [value[key] for key in sorted(value, key=int)]
        except (TypeError, ValueError):
            return ()
    return tuple(str(name) for name in value) if isinstance(value, (list, tuple)) else ()


def class_names(
    labels: str, given: Sequence[str], metadata: Sequence[str], of_layout: Sequence[str], count: int | None
) -> tuple[str, ...]:
    """Return the names of a model's classes; numbers where nothing names them.

    Args:
        labels: what the parameter `detector.labels` is.
        given: the names in there, empty for none.
        metadata: those in the model's metadata, empty for none.
        of_layout: those of all models of its layout, empty for none.
        count: of the model's classes, None if unknown.

    Raises:
        ModelClassError: a labels file with another number of names than the model has classes.

    """
    if given and count is not None and len(given) != count:
        raise ModelClassError(f"labels {labels} must name all classes of the model, {count}: got {len(given)} names")
    coco = COCO_NAMES if count == len(COCO_NAMES) else ()
    return tuple(given or metadata or of_layout or coco) or tuple(str(i) for i in range(count or 0))
