"""What `vergence doctor` tries instead of reading settings: the middleware, memory, folders, and the files of a rig."""

import errno
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from vergence_bringup.machine import build_hint
from vergence_rig.face_model import (
    FACE_CLASS,
    FACE_HINT,
    FACE_MODEL,
    FACE_MODEL_BYTES,
    FACE_MODEL_SHA256,
    is_face_model,
)
from vergence_rig.finding import Finding
from vergence_rig.middleware import middleware_problem
from vergence_rig.printed import printed_line

if TYPE_CHECKING:
    from vergence_metric.boxes.detector import Detector

SHM = Path("/dev/shm")
SEGMENT_BYTES = 16 << 20
"""Size of a shared-memory segment of the shipped profile."""

_TRIAL = "vergence_bringup.ros.middleware_trial"
_STEPS = (
    ("context", "ROS context", "fix what the message names: environment variables, HOME, the folder of the logs"),
    ("node", "ROS node", "fix what the message names"),
    (
        "image",
        "image by the middleware",
        "ip link set lo up; room in /dev/shm; the shipped Fast DDS profile; a firewall that lets UDP of this host pass",
    ),
)
_TIMEOUT_S = 40.0


def middleware() -> Iterable[Finding]:
    """Yield a finding for each step of the trial; those after a failure are not reached."""
    problem = middleware_problem()
    if problem:
        yield Finding("middleware", False, problem, "unset RMW_IMPLEMENTATION, or install that middleware")
        return
    try:
        result = subprocess.run(
            [sys.executable, "-m", _TRIAL], capture_output=True, text=True, timeout=_TIMEOUT_S, errors="replace"
        )
        done, said = result.stdout.split(), result.stderr.strip().splitlines()
    except subprocess.TimeoutExpired as error:
        done = (error.stdout or b"").decode(errors="replace").split()
        said = [f"not done within {_TIMEOUT_S:g} s"]
    except OSError as error:
        done, said = [], [str(error)]
    texts = {"context": "made", "node": "made", "image": "one of 921600 bytes went from process to process"}
    for step, name, remedy in _STEPS:
        if step in done:
            yield Finding(name, True, texts[step])
            continue
        last = next((line for line in reversed(said) if line.strip()), "no reason was given")
        yield Finding(name, False, printed_line(last), remedy)
        return


def shared_memory(folder: Path = SHM) -> Iterable[Finding]:
    """Yield whether a segment as large as one of the shipped profile can be written."""
    name = "shared memory segment"
    remedy = "mount -o remount,rw,size=512M /dev/shm (in a container: --shm-size=512m)"
    reason = _write_trial(folder, SEGMENT_BYTES)
    text = f"{SEGMENT_BYTES >> 20} MiB were written to {folder}" if not reason else f"{folder}: {reason}"
    yield Finding(name, not reason, text, remedy)


def folders() -> Iterable[Finding]:
    """Yield whether logs and what nodes keep can be written."""
    home = os.environ.get("ROS_HOME") or str(Path(os.environ.get("HOME") or "/") / ".ros")
    logs = os.environ.get("ROS_LOG_DIR") or str(Path(home) / "log")
    for name, folder in (("logs", logs), ("poses and calibrations", home)):
        reason = _write_trial(Path(folder), 1)
        remedy = "set HOME, ROS_HOME or ROS_LOG_DIR to a folder of this user's"
        yield Finding(f"folder of {name}", not reason, f"{folder}: {reason or 'can be written'}", remedy)


def _write_trial(folder: Path, size: int) -> str:
    """Return why a file of a size cannot be written in a folder, which is made where it is missing; "" if it can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            os.posix_fallocate(file.fileno(), 0, size)
            file.write(b"x")
            file.flush()
    except OSError as error:
        return error.strerror or os.strerror(error.errno or errno.EIO)
    return ""


def rig_files(rig: str, servos: str, backend: str, model: str) -> Iterable[Finding]:
    """Yield whether what a rig names can be opened: its file, its servos and their drivers, its detector.

    Empty for what is built in, which is not opened but for the rig's file.
    """
    yield _opened("rig", rig or "built in", lambda: _load_rig(rig))
    if servos:
        yield _opened("servos", servos, lambda: _open_servos(servos, backend))
    if model:
        yield _opened("detector's model", model, lambda: _load_model(model))
    yield _faces(model)


def _faces(model: str) -> Finding:
    """Return whether a goal for a face can be met: whether the detector, "" for the shipped one, has that class."""
    where = f"{FACE_MODEL}: {FACE_MODEL_BYTES} bytes, MIT licence, SHA-256 {FACE_MODEL_SHA256}; then --model FILE"
    try:
        if model and is_face_model(model):
            return Finding("faces", True, f"{model} is YuNet of the OpenCV Zoo", needed=False)
        found = bool(model) and FACE_CLASS in _detector(model).class_names
    except (ModuleNotFoundError, ValueError, OSError) as error:
        return Finding("faces", False, f"{FACE_HINT}: {printed_line(error)}", where, needed=False)
    if found:
        text = f"{model} detects faces; it is not {FACE_MODEL}, whose SHA-256 is {FACE_MODEL_SHA256}"
        return Finding("faces", True, text, needed=False)
    which = model or "the shipped detector"
    return Finding(
        "faces", False, f"{which} detects none, and a goal for a face fails: {FACE_HINT}", where, needed=False
    )


def _opened(name: str, what: str, opened: Callable[[], str]) -> Finding:
    try:
        text = opened()
    except ModuleNotFoundError as error:
        return Finding(name, False, f"{what}: {error.name} is not installed here", build_hint(), needed=False)
    except (ValueError, OSError) as error:
        return Finding(name, False, printed_line(error), "correct the file, or what it names")
    return Finding(name, True, f"{what}: {text}")


def _load_rig(rig: str) -> str:
    from vergence_rig.rig_file import load_rig

    return f"baseline {load_rig(rig).baseline_m * 1e3:.1f} mm"


def _open_servos(path: str, backend: str) -> str:
    from vergence_rig.rig import JOINT_NAMES
    from vergence_servo.calibration import load_servos
    from vergence_servo.driver_set import DriverSet, backends_of

    servos = load_servos(path)
    joints = [joint for joint in JOINT_NAMES if joint in servos] or list(servos)
    chosen = backends_of(servos, joints, backend)
    drivers = DriverSet(chosen, lambda entry: {}, {joint: servos[joint].channel for joint in joints})
    try:
        return f"opened {drivers.description()}"
    finally:
        drivers.close()


def _load_model(path: str) -> str:
    return _detector(path).describe()


def _detector(path: str) -> "Detector":
    from vergence_metric.boxes.detector import Detector
    from vergence_metric.boxes.parameters import DetectorParameters

    return Detector(DetectorParameters(model=path))
