"""A real head on one machine: two cameras, the metrics, the controller and the servos.

ros2 launch vergence_bringup rig.launch.py left_device:=/dev/v4l/by-id/... right_device:=/dev/v4l/by-id/...
    servos:=/home/me/servos.yaml [backend:=pca9685]
Without servos the servos are simulated and nothing moves. With the servos on another machine use laptop.launch.py here
and pi.launch.py there. detector:=true model:=/path/to/your.onnx adds metric II.
"""

from collections.abc import Mapping
from typing import Any

from launch import LaunchDescription
from launch.actions import LogInfo

from vergence_bringup.launching.servo_choice import chosen_backend, fakes_banner, problems
from vergence_bringup.ros.launch_actions import config_folder, described, frames, head, node


def camera(eye: str, values: Mapping[str, str]) -> Any:
    # camera_node publishes image_raw and camera_info relative to its namespace: left/... and right/...
    # One exposure and white balance for both eyes: see docs/cameras.md.
    lock = {"left": "hold", "right": "follow"}[eye] if values["lock"] == "true" else "off"
    namespace = values["namespace"].strip("/")
    partner = f"/{namespace}/left/camera_node".replace("//", "/") if eye == "right" else ""
    return node(
        "camera_node",
        *files("camera_node", values),
        name="camera_node",
        namespace=eye,
        parameters={
            "rig": values["rig"],
            "device": values[f"{eye}_device"],
            "camera_info_url": values[f"{eye}_camera_info_url"],
            "frame_id": f"{eye}_camera_optical_frame",
            "lock": lock,
            "partner": partner,
        },
    )


def files(executable: str, values: Mapping[str, str]) -> list[str]:
    # The second file is the result of vergence identify.
    return [str(config_folder() / f"{executable}.yaml")] + [values["identified"]] * (values["identified"] != "")


def build(values: Mapping[str, str]) -> list[Any]:
    def seeing(executable: str, **parameters: str) -> Any:
        return node(executable, *files(executable, values), parameters={"rig": values["rig"], **parameters})

    nodes = [*frames(values), camera("left", values), camera("right", values)]
    nodes += [seeing("edge_metric_node"), seeing("gaze_controller_node")]
    if values["detector"] == "true":
        nodes.append(seeing("box_metric_node", **{"detector.model": values["model"]}))
    if values["encoder"] == "true":
        nodes.append(seeing("eye_rotation_node"))
    if values["servo_node"] == "false":
        return head(values, *nodes)
    nodes.append(seeing("servo_node", backend=chosen_backend(values), servos=values["servos"]))
    fakes = fakes_banner(values)
    return [*([LogInfo(msg=fakes)] if fakes else []), *head(values, *nodes)]


def generate_launch_description() -> LaunchDescription:
    return described("rig.launch.py", build, lambda values: problems(values) if values["servo_node"] == "true" else [])
