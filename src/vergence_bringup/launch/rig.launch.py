"""A real head on one machine: two cameras, the metrics, the controller and the servos.

ros2 launch vergence_bringup rig.launch.py left_device:=/dev/v4l/by-id/... right_device:=/dev/v4l/by-id/...
    servos:=/home/me/servos.yaml [backend:=pca9685] [web:=true]
Without servos the servos are simulated and nothing moves. With the servos on another machine use laptop.launch.py here
and pi.launch.py there. detector:=true model:=/path/to/your.onnx adds metric II. composed:=true runs all nodes in one
process.
"""

from collections.abc import Mapping
from typing import Any

from launch import LaunchDescription
from launch.actions import LogInfo

from vergence_bringup.launching.servo_choice import chosen_backend, fakes_banner, problems
from vergence_bringup.ros.launch_actions import config_folder, described, frames, head, host, node
from vergence_rig.head_bodies import EYES, OPTICAL_FRAMES

Settings = dict[str, tuple[str, dict[str, str]]]
"""By the name that head_node gives a node: its executable and its parameters beyond its files."""


def camera(eye: str, values: Mapping[str, str]) -> dict[str, str]:
    # One exposure and white balance for both eyes: see docs/cameras.md.
    lock = {"left": "hold", "right": "follow"}[eye] if values["lock"] == "true" else "off"
    namespace = values["namespace"].strip("/")
    partner = f"/{namespace}/left/camera_node".replace("//", "/") if eye == "right" else ""
    return {
        "rig": values["rig"],
        "device": values[f"{eye}_device"],
        "camera_info_url": values[f"{eye}_camera_info_url"],
        "frame_id": OPTICAL_FRAMES[eye],
        "lock": lock,
        "partner": partner,
    }


def files(executable: str, values: Mapping[str, str]) -> list[str]:
    # The second file is the result of vergence identify.
    return [str(config_folder() / f"{executable}.yaml")] + [values["identified"]] * (values["identified"] != "")


def settings(values: Mapping[str, str]) -> Settings:
    found: Settings = {f"{eye}_camera": ("camera_node", camera(eye, values)) for eye in EYES}
    chosen = {"edge_metric_node": {}, "gaze_controller_node": {}}
    if values["attend"] == "true":
        chosen["gaze_controller_node"] = {"start": "attend"}
    if values["detector"] == "true":
        chosen["box_metric_node"] = {"detector.model": values["model"]}
    if values["encoder"] == "true":
        chosen["eye_rotation_node"] = {}
    if values["servo_node"] == "true":
        chosen["servo_node"] = {"backend": chosen_backend(values), "servos": values["servos"]}
    return found | {name: (name, {"rig": values["rig"], **parameters}) for name, parameters in chosen.items()}


def separate(name: str, executable: str, parameters: Mapping[str, str], values: Mapping[str, str]) -> Any:
    # camera_node publishes image_raw and camera_info relative to its namespace: left/... and right/...
    placed = {"name": executable, "namespace": name.removesuffix("_camera")} if executable == "camera_node" else {}
    return node(executable, *files(executable, values), parameters=parameters, **placed)


def composed(nodes: Settings, values: Mapping[str, str]) -> Any:
    arguments = ["--nodes", ",".join(nodes)]
    for name, (executable, parameters) in nodes.items():
        for file in files(executable, values):
            arguments += ["--params", f"{name}={file}"]
        for parameter, value in parameters.items():
            # Quoted: otherwise 0 would be a number and off false.
            arguments += ["--set", f"{name}:{parameter}:='{value}'"]
    return host("head_node", arguments)


def build(values: Mapping[str, str]) -> list[Any]:
    found = settings(values)
    if values["composed"] == "true":
        nodes = [composed(found, values)]
    else:
        nodes = [separate(name, *of_node, values) for name, of_node in found.items()]
    fakes = fakes_banner(values) if values["servo_node"] == "true" else ""
    if values["web"] == "true":
        nodes.append(node("web_node", parameters={"rig": values["rig"], "address": values["web_address"]}))
    return [*([LogInfo(msg=fakes)] if fakes else []), *head(values, *frames(values), *nodes)]


def generate_launch_description() -> LaunchDescription:
    return described("rig.launch.py", build, lambda values: problems(values) if values["servo_node"] == "true" else [])
