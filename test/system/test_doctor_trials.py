"""`vergence doctor` tries what nodes need: what is broken fails with its reason, whatever the settings say."""

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from vergence_bringup.commands.doctor_trials import rig_files, shared_memory
from vergence_bringup.node_table import HOSTS, NODES
from vergence_rig import face_model
from vergence_rig.finding import Finding

pytestmark = pytest.mark.system

DOCTOR = [sys.executable, "-m", "vergence_bringup.command_line", "doctor", "--no-render"]
TIMEOUT_S = 150.0


def _doctor(*before: str, **environment: str) -> tuple[int, dict[str, str]]:
    """Return the status of the doctor, and its failures by name."""
    kept = {name: value for name, value in os.environ.items() if name not in ("ROS_HOME", "ROS_LOG_DIR")}
    result = subprocess.run(
        [*before, *DOCTOR], capture_output=True, text=True, timeout=TIMEOUT_S, env=kept | environment
    )
    assert "Traceback" not in result.stdout + result.stderr
    failed = [line[6:].partition(": ") for line in result.stdout.splitlines() if line.startswith("FAIL")]
    return result.returncode, {name: text for name, _, text in failed}


def _isolated(*options: str) -> list[str]:
    """Return a prefix that runs a command in namespaces of its own."""
    prefix = ["unshare", *options]
    if shutil.which("unshare") is None or subprocess.run([*prefix, "true"], capture_output=True).returncode:
        pytest.skip("this user may not make namespaces (unshare)")
    return prefix


def test_a_sound_machine_passes_every_trial(domain_id: int) -> None:
    result = subprocess.run(DOCTOR, capture_output=True, text=True, timeout=TIMEOUT_S)
    passed = {line[6:].partition(": ")[0] for line in result.stdout.splitlines() if line.startswith("ok")}
    assert {"ROS context", "ROS node", "image by the middleware", "shared memory segment", "folder of logs"} <= passed
    count = len(NODES) + len(HOSTS)
    assert f"nodes: {count} of {count} are built" in result.stdout


@pytest.mark.parametrize(
    ("environment", "name", "words"),
    [
        ({"ROS_DOMAIN_ID": "233"}, "ROS context", "ROS_DOMAIN_ID must be a whole number from 0 to 232: got '233'"),
        ({"HOME": "/proc/none"}, "folder of logs", "/proc/none/.ros/log"),
        ({"RMW_IMPLEMENTATION": "rmw_nosuch"}, "middleware", "must be a middleware that is installed"),
    ],
)
def test_an_environment_in_which_nothing_runs_is_found(
    environment: dict[str, str], name: str, words: str, domain_id: int
) -> None:
    status, failed = _doctor(**environment)
    assert status == 1
    assert words in failed[name]


def test_without_a_loopback_interface_no_image_arrives(domain_id: int) -> None:
    status, failed = _doctor(*_isolated("--net"))
    assert status == 1
    assert "no image of 921600 bytes arrived from another process" in failed["image by the middleware"]


def test_read_only_shared_memory_is_found(domain_id: int) -> None:
    prefix = [
        *_isolated("--mount"),
        "sh",
        "-c",
        'mount -o remount,ro,bind /dev/shm 2>/dev/null || exit 9; exec "$@"',
        "sh",
    ]
    if subprocess.run([*prefix, "true"], capture_output=True).returncode:
        pytest.skip("/dev/shm cannot be mounted anew here")
    status, failed = _doctor(*prefix)
    assert status == 1
    assert "Read-only file system" in failed["shared memory segment"]


def test_what_cannot_be_written_is_one_finding() -> None:
    (finding,) = shared_memory(Path("/proc/none"))
    assert not finding.ok
    assert finding.needed


@pytest.mark.parametrize(
    ("rig", "servos", "model", "words"),
    [
        ("absent.yaml", "", "", "absent.yaml"),
        ("", "absent.yaml", "", "absent.yaml"),
        ("", "servos.yaml", "", "backend 'kernel_pwm'"),
        ("", "", "absent.onnx", "absent.onnx"),
    ],
)
def test_what_a_rig_names_is_opened(
    rig: str, servos: str, model: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "servos.yaml").write_text("servos: {tilt: {channel: 0}}\n")
    failed = [finding for finding in rig_files(rig, servos, "kernel_pwm", model) if not finding.ok and finding.needed]
    assert len(failed) == 1
    assert words in failed[0].message


def faces(model: str) -> Finding:
    """What is found of faces with a model."""
    (finding,) = (one for one in rig_files("", "", "kernel_pwm", model) if one.name == "faces")
    assert not finding.needed
    return finding


def test_a_missing_detector_of_faces_is_named(tmp_path: Path) -> None:
    for model, words in (("", "the shipped detector detects none"), (str(tmp_path / "gone.onnx"), "No such file")):
        finding = faces(model)
        assert not finding.ok
        assert words in finding.message
        assert "face_detection_yunet_2023mar.onnx" in finding.message
        assert "SHA-256 8f2383e4dd3cfbb4" in finding.remedy


def test_a_detector_of_faces_is_known_by_its_class_and_the_zoo_s_file_by_its_sum(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onnx", reason="the onnx package is not installed: pip install onnx")
    from vergence_metric.testing.onnx_detectors import build_detector

    other = str(build_detector(tmp_path / "person.onnx", "yolov8", classes=80))
    assert not faces(other).ok
    built = build_detector(tmp_path / "yunet.onnx", "yunet")
    assert "detects faces; it is not face_detection_yunet_2023mar.onnx" in faces(str(built)).message
    monkeypatch.setattr(face_model, "FACE_MODEL_SHA256", hashlib.sha256(built.read_bytes()).hexdigest())
    assert "is YuNet of the OpenCV Zoo" in faces(str(built)).message
