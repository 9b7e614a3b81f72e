"""The outcome of a calibration as text and as files."""

from pathlib import Path
from typing import Any

from vergence_camera.calibration.solve import Intrinsics, StereoPose
from vergence_camera.calibration.views import Coverage
from vergence_camera.camera_info import save_calibration, write_yaml

_SOUND_RMS_PX = 0.5
_SOUND_SIGMA = 0.005


def intrinsics_text(eye: str, found: Intrinsics, coverage: Coverage) -> str:
    """Return one camera's figures, its coverage map, and what would make them better."""
    fx, fy, cx, cy = found.matrix[0, 0], found.matrix[1, 1], found.matrix[0, 2], found.matrix[1, 2]
    lines = [
        f"{eye}: {len(found.view_rms_px)} views, RMS {found.rms_px:.3f} px",
        f"   focal length  {fx:.2f} ± {found.focal_sigma_px[0]:.2f}, {fy:.2f} ± {found.focal_sigma_px[1]:.2f} px",
        f"   centre        {cx:.2f} ± {found.centre_sigma_px[0]:.2f}, {cy:.2f} ± {found.centre_sigma_px[1]:.2f} px",
        f"   distortion    {' '.join(f'{value:.4f}' for value in found.distortion)}",
        f"   coverage      {coverage.fraction:.0%} of the picture",
        *(f"      {line}" for line in coverage.drawing().splitlines()),
    ]
    advice = coverage.advice()
    if found.rms_px > _SOUND_RMS_PX:
        advice.append("the error is large: is the board flat, still and in focus, and its size right?")
    if max(found.focal_sigma_px) > _SOUND_SIGMA * fx:
        advice.append("the focal length is uncertain: take more views")
    return "\n".join([*lines, *(f"   better: {text}" for text in advice)])


def pose_text(pose: StereoPose) -> str:
    """Return the pair's figures."""
    x, y, z = (1e3 * value for value in pose.translation_m)
    return (
        f"pair: {len(pose.view_rms_px)} views, RMS {pose.rms_px:.3f} px, baseline {1e3 * pose.baseline_m:.2f} mm "
        f"(right camera against left: {x:.2f}, {y:.2f}, {z:.2f} mm)"
    )


def write_results(
    directory: Path, cameras: dict[str, Intrinsics], pose: StereoPose | None, board: dict[str, Any]
) -> list[Path]:
    """Write left.yaml, right.yaml (camera_info form) and stereo.yaml, as far as there are results; return the paths.

    Raises:
        OSError: the directory cannot be made or written.
    """
    written = []
    for eye, found in cameras.items():
        path = directory / f"{eye}.yaml"
        save_calibration(found.calibration(eye), path)
        written.append(path)
    if pose is not None:
        path = directory / "stereo.yaml"
        write_yaml(stereo_document(cameras, pose, board), path)
        written.append(path)
    return written


def stereo_document(cameras: dict[str, Intrinsics], pose: StereoPose, board: dict[str, Any]) -> dict[str, Any]:
    """Return stereo.yaml: a point's optical coordinates obey x_right = rotation x_left + translation."""
    return {
        "rotation": {"rows": 3, "cols": 3, "data": [float(value) for value in pose.rotation.ravel()]},
        "translation": {"rows": 3, "cols": 1, "data": [float(value) for value in pose.translation_m]},
        "translation_unit": "m",
        "baseline_m": pose.baseline_m,
        "rms_px": pose.rms_px,
        "left_rms_px": cameras["left"].rms_px,
        "right_rms_px": cameras["right"].rms_px,
        "views": len(pose.view_rms_px),
        "board": board,
    }
