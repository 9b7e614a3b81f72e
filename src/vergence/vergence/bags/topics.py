"""What a recording of a head holds: its topics, relative to the head's namespace, with their types."""

from types import MappingProxyType

_SENSOR, _OWN = "sensor_msgs/msg/", "vergence_msgs/msg/"

SIDES = ("left", "right")

TOPICS = MappingProxyType(
    {
        **{f"{side}/image_raw/compressed": _SENSOR + "CompressedImage" for side in SIDES},
        **{f"{side}/camera_info": _SENSOR + "CameraInfo" for side in SIDES},
        "joint_states": _SENSOR + "JointState",
        "joint_command": _SENSOR + "JointState",
        "vergence/edge": _OWN + "EdgeVergence",
        "vergence/error": _OWN + "VergenceError",
        "vergence/track": _OWN + "TargetTrack",
        "vergence/track_request": _OWN + "TrackRequest",
        "vergence/box": _OWN + "BoxVergence",
        "vergence/eye_rotation": _OWN + "EyeRotation",
        "gaze/state": _OWN + "GazeState",
        "gaze/goal": _OWN + "GazeGoal",
        "gaze/target": "geometry_msgs/msg/PointStamped",
        "gaze/fixation_point": "geometry_msgs/msg/PointStamped",
    }
)

LATCHED = frozenset({"gaze/goal"})
"""Published once and kept for those that subscribe later (transient local)."""
