"""Detectors built with the onnx library, with answers that are known by construction."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


@pytest.fixture
def onnx_model(tmp_path: Path) -> Callable[..., Path]:
    """A maker of ONNX detectors of every layout: see `build_detector`."""
    pytest.importorskip("onnx", reason="the onnx package is not installed: pip install onnx")
    from vergence_metric.testing.onnx_detectors import build_detector

    count = 0

    def build(layout: str, *args: Any, **options: Any) -> Path:
        nonlocal count
        count += 1
        return build_detector(tmp_path / f"{layout}_{count}.onnx", layout, *args, **options)

    return build
