"""The results as a rig that every node reads, and as a record of all values."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import yaml

from vergence_calibration.identification.axis_log import EYES, IdentifyError
from vergence_calibration.identification.identification import Identification
from vergence_calibration.identification.latencies import Estimate
from vergence_calibration.identification.wiring_faults import cross_talk
from vergence_rig.parameters import ParameterError
from vergence_rig.rig import CameraSpec, Joints, JointSpec, Rig
from vergence_rig.rig_file import rig_as_mapping, rig_from_mapping
from vergence_rig.yaml_file import read_yaml

_HEAD = "# Written by vergence identify; the old file is kept beside it. Keys: config/rig.yaml, docs/identify.md\n"
_NODES_HEAD = "# Written by vergence identify, for --params-file after the shipped ones: docs/identify.md\n"
_SIGNIFICANT = 3.0
_LEAST_LOST_RAD = math.radians(0.1)


def identified_rig(rig: Rig, found: Identification) -> Rig:
    """Return the rig with the measured latency, speed and lost motion of the identified axes.

    A speed too fast to measure, and a lost motion within its uncertainty (or 0.1 degree) of the rig's, stay. Dead
    band and backlash share the lost motion as they did. A camera that has no calibration gets its focal lengths from
    the pixels per radian, as far as its axes were moved. Raises IdentifyError for an impossible value.
    """
    try:
        joints = [_joint(name, joint, found) if name in found.timings else joint for name, joint in rig.joints.items()]
        cameras = {eye: _camera(eye, spec, found) for eye, spec in zip(EYES, (rig.left_camera, rig.right_camera))}  # noqa: B905
    except ParameterError as error:
        raise IdentifyError(f"the measured servo is not possible: {error}") from error
    return dataclasses.replace(rig, left_camera=cameras["left"], right_camera=cameras["right"], joints=Joints(*joints))


def _joint(name: str, joint: JointSpec, found: Identification) -> JointSpec:
    servo = joint.servo
    changes: dict[str, Any] = {"command_latency_s": round(max(found.latencies.servo_s[name].value_s, 0.0), 4)}
    speeds = [timing.speed_rad_s for timing in found.timings[name].seen.values() if timing.speed_known]
    if speeds:
        changes["speed_rad_s"] = round(sum(speeds) / len(speeds), 3)
    loops = [gain.loop for gain in found.gains_of(name)]
    lost_rad = sum(loop.lost for loop in loops) / len(loops)
    sigma_rad = max(loop.lost_sigma for loop in loops)
    known_rad = servo.dead_band_rad + servo.backlash_rad
    if abs(lost_rad - known_rad) > max(_SIGNIFICANT * sigma_rad, _LEAST_LOST_RAD):
        share = servo.dead_band_rad / known_rad if known_rad > 0 else 0.5
        changes["dead_band_rad"] = round(share * lost_rad, 5)
        changes["backlash_rad"] = round((1.0 - share) * lost_rad, 5)
    return dataclasses.replace(joint, servo=servo.replaced(**changes))


def _camera(eye: str, spec: CameraSpec, found: Identification) -> CameraSpec:
    if found.cameras[eye].calibrated:
        return spec
    changes = {
        "fy_px" if gain.joint == "tilt" else "fx_px": round(gain.px_per_rad, 1)
        for gain in found.gains
        if gain.eye == eye
    }
    return spec.replaced(**changes)


def rig_text(rig: Rig, found: Mapping[str, Any], when: str) -> str:
    """Return rig.yaml for an identified rig, with the record of what was found. `when` is the time in words."""
    document = rig_as_mapping(rig) | {"identified": {**found, "at": when}}
    assert rig_from_mapping(document) == rig  # the file reads back as the same rig
    return _HEAD + yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)


def nodes_text(document: dict[str, Any]) -> str:
    """Return a ROS parameter file."""
    return _NODES_HEAD + yaml.safe_dump(document, sort_keys=False, default_flow_style=False)


def recorded(path: str) -> dict[str, Any]:
    """Return the record that a rig file has of an earlier identification; empty for none, or for no path."""
    document = read_yaml(path) if path else {}
    found = document.get("identified") if isinstance(document, Mapping) else None
    return dict(found) if isinstance(found, Mapping) else {}


def record(found: Identification) -> dict[str, Any]:
    """Return every value with its standard deviation, as plain values; null where it was not measured."""
    latencies = found.latencies
    axes: dict[str, Any] = {}
    for joint, response in found.responses.items():
        axes[joint] = {"sign": 1, "cross_talk": round(cross_talk(response), 4)}
        for gain in found.gains_of(joint):
            axes[joint][f"{gain.eye}_eye"] = {
                "px_per_rad": round(gain.px_per_rad, 1),
                "px_per_rad_sigma": round(gain.px_per_rad_sigma, 1),
                "focal_length_px": round(gain.fx_px, 1),
                "lost_motion_rad": round(gain.loop.lost, 5),
                "lost_motion_sigma_rad": round(gain.loop.lost_sigma, 5),
                "seen_after_s": round(found.timings[joint].seen[gain.eye].onset_s, 4),
                "seen_after_sigma_s": round(found.timings[joint].seen[gain.eye].onset_sigma_s, 4),
                "speed_rad_s": _speed(found, joint, gain.eye),
            }
        axes[joint] |= _estimate("command_latency", latencies.servo_s[joint])
        axes[joint] |= _estimate("joint_states_late", latencies.joints_late_s[joint])
        axes[joint]["latency_varies_s"] = round(max(t.jitter_s for t in found.timings[joint].seen.values()), 4)
    eyes = {
        eye: {
            "calibrated": found.cameras[eye].calibrated,
            "frame_interval_s": round(found.arrivals[eye].interval_s, 4),
            "stamp_to_arrival_s": round(found.arrivals[eye].median_s, 4),
            "stamp_to_arrival_95_percent_s": round(found.arrivals[eye].late_s, 4),
            **_estimate("stamp_late", latencies.stamp_late_s[eye]),
            **_estimate("exposure_to_arrival", latencies.exposure_to_arrival_s[eye]),
        }
        for eye in EYES
    }
    return {
        "assumption": latencies.assumption,
        **_estimate("command_to_arrival", latencies.loop_s),
        **_estimate("left_stamps_later_than_right", latencies.eyes_apart_s),
        "axes": axes,
        "eyes": eyes,
    }


def _speed(found: Identification, joint: str, eye: str) -> float | None:
    timing = found.timings[joint].seen[eye]
    return round(timing.speed_rad_s, 2) if timing.speed_known else None


def _estimate(name: str, estimate: Estimate) -> dict[str, float | None]:
    return {f"{name}_s": _number(estimate.value_s), f"{name}_sigma_s": _number(estimate.sigma_s)}


def _number(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
