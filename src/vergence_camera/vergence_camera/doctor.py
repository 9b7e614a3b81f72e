"""The cameras' part of `vergence doctor`: what is plugged in, whether it streams, and whether it makes a pair."""

import itertools
import statistics
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from vergence_camera.control_port import ControlPort
from vergence_camera.devices import ListedDevice, SystemTree, list_devices
from vergence_camera.errors import CameraError, CorruptFrameError, DeviceBusyError
from vergence_camera.frame import Clock, Frame, ModeRequest
from vergence_camera.pair import EyeCamera, SkewMeter, faults_of_pair
from vergence_camera.v4l2.capture import V4l2Source
from vergence_camera.v4l2.faults import camera_error
from vergence_camera.v4l2.kernel import Kernel, LinuxKernel
from vergence_rig.finding import Finding

_TRIAL_MODE = ModeRequest("MJPG", 640, 480, 30.0)
_HIGH_SPEED_MBPS = 480.0


@dataclass
class _Trial:
    """What one camera did while all of them streamed."""

    stamps_ns: list[int] = field(default_factory=list)
    corrupt: int = 0
    controls: dict[str, object] = field(default_factory=dict)
    error: CameraError | None = None

    @property
    def length_s(self) -> float:
        return (self.stamps_ns[-1] - self.stamps_ns[0]) * 1e-9 if self.stamps_ns else 0.0

    @property
    def rate_hz(self) -> float:
        steps = [after - before for before, after in itertools.pairwise(self.stamps_ns)]
        return 1e9 / statistics.median(steps) if steps else float("nan")


def check(
    *,
    kernel: Kernel | None = None,
    tree: SystemTree | None = None,
    trial_s: float = 1.5,
    timeout_s: float = 3.0,
    max_skew_s: float = 0.02,
) -> list[Finding]:
    """Look at every camera, let all of them stream together for `trial_s`, and compare each two.

    Args:
        kernel, tree: replace the machine's own in tests.
        trial_s: length of the trial by the frames' own times; 0 leaves it out.
        timeout_s: the trial of a camera that gives fewer frames ends after this time.
        max_skew_s: largest time between two frames that are paired.
    """
    kernel = kernel or LinuxKernel()
    listed = list_devices(kernel, tree)
    if not listed:
        return [Finding("cameras", False, "no camera is plugged in", "plug two in; recordings and URLs work without")]
    findings = [Finding("cameras", True, "; ".join(str(entry.device) for entry in listed))]
    for entry in listed:
        findings += _check_device(entry)
    usable = [entry for entry in listed if not entry.trouble]
    if trial_s > 0.0 and usable:
        trials = _stream_together(kernel, usable, trial_s, timeout_s)
        for entry, trial in zip(usable, trials, strict=True):
            findings.append(_check_trial(entry, trial))
        for one, other in itertools.combinations(range(len(usable)), 2):
            pair = (usable[one], usable[other])
            findings.append(_check_pair(pair, (trials[one], trials[other]), max_skew_s))
    return findings


def _check_device(entry: ListedDevice) -> list[Finding]:
    device, name = entry.device, f"camera {entry.device.path}"
    if entry.error is not None:
        is_ours = isinstance(entry.error, CameraError)
        error = entry.error if is_ours else camera_error(entry.error, "opening it", device.path)
        return [Finding(name, False, str(error), "see there")]
    findings = []
    formats = {size.pixel_format for size in entry.sizes}
    if "MJPG" not in formats:
        has = ", ".join(sorted(formats)) or "no listed format"
        findings.append(
            Finding(name, False, f"no MJPG, only {has}", "set pixel_format: YUYV; it needs ten times the bandwidth")
        )
    if device.speed_mbps and float(device.speed_mbps) < _HIGH_SPEED_MBPS:
        text = f"runs at {device.speed_mbps} Mbit/s, USB 1"
        findings.append(Finding(name, False, text, "use another port, cable or hub"))
    if not device.by_id:
        text = "no by-id name: its number changes with the order of plugging in"
        findings.append(Finding(name, False, text, "choose it by its by-path name or by port:" + device.usb_port))
    return findings


def _check_trial(entry: ListedDevice, trial: _Trial) -> Finding:
    name = f"stream {entry.device.path}"
    if isinstance(trial.error, DeviceBusyError):
        return Finding(name, True, f"{trial.error} (trial skipped; see /diagnostics of its node)")
    if trial.error is not None:
        return Finding(name, False, str(trial.error), "see there")
    if len(trial.stamps_ns) < 2:
        return Finding(name, False, f"{len(trial.stamps_ns)} frames received", "plug it in again, without a hub")
    text = f"{_TRIAL_MODE}: {trial.rate_hz:.1f} Hz, {len(trial.stamps_ns)} frames, {trial.corrupt} damaged"
    slow = trial.rate_hz < 0.9 * _TRIAL_MODE.rate_hz
    return Finding(name, not slow and not trial.corrupt, text, "more light, or a fixed exposure; a better cable")


def _check_pair(pair: Sequence[ListedDevice], trials: Sequence[_Trial], max_skew_s: float) -> Finding:
    eyes = [
        EyeCamera(entry.device.path, entry.device.controller, trial.rate_hz, trial.controls)
        for entry, trial in zip(pair, trials, strict=True)
    ]
    meter = SkewMeter()
    for stamp_ns in trials[0].stamps_ns:
        meter.add_own(stamp_ns)
    for stamp_ns in trials[1].stamps_ns:
        meter.add_other(stamp_ns)
    faults = faults_of_pair(eyes[0], eyes[1], meter.skew_s(), max_skew_s)
    name = f"pair {eyes[0].name}, {eyes[1].name}"
    if faults:
        return Finding(name, False, "; ".join(fault.partition(": ")[0] for fault in faults), _remedies(faults))
    return Finding(name, True, f"{abs(meter.skew_s()) * 1e3:.1f} ms apart, own controllers, same rate and exposure")


def _remedies(faults: Sequence[str]) -> str:
    return "; ".join(fault.partition(": ")[2] for fault in faults)


def _stream_together(kernel: Kernel, entries: Sequence[ListedDevice], trial_s: float, timeout_s: float) -> list[_Trial]:
    trials = [_Trial() for _ in entries]
    ready = threading.Barrier(len(entries))
    limits = (trial_s, timeout_s)
    threads = [
        threading.Thread(target=_stream, args=(kernel, entry.device.path, trial, ready, *limits), daemon=True)
        for entry, trial in zip(entries, trials, strict=True)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return trials


def _stream(
    kernel: Kernel, path: str, trial: _Trial, ready: threading.Barrier, trial_s: float, timeout_s: float
) -> None:
    port = ControlPort()
    source = V4l2Source(kernel, lambda: path, path, _TRIAL_MODE, user=port)
    try:
        try:
            source.open()
        except CameraError as error:
            trial.error = error
        ready.wait()
        if trial.error is not None:
            return
        until_s = time.monotonic() + timeout_s
        while trial.length_s < trial_s and time.monotonic() < until_s:
            try:
                frame = source.read(0.1)
            except CorruptFrameError:
                trial.corrupt += 1
                continue
            if frame is not None:
                trial.stamps_ns.append(_monotonic_ns(frame))
        values = port.values()
        trial.controls = {name: values[name] for name in port.locked_names() if name in values}
    except CameraError as error:
        trial.error = error
    finally:
        source.close()


def _monotonic_ns(frame: Frame) -> int:
    if frame.clock is Clock.MONOTONIC:
        return frame.time_ns
    return time.monotonic_ns() - (frame.clock.now_ns() - frame.time_ns)
