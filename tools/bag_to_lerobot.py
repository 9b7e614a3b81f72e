"""Turn recordings into a LeRobot data set: each an episode of both eyes' pictures, joint angles and commanded angles.

python tools/bag_to_lerobot.py FOLDER TASK BAG [BAG ...]    needs lerobot, in an environment with vergence and rosbags
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from lerobot.datasets.lerobot_dataset import LeRobotDataset

from vergence.bags.reader import HeadBag
from vergence.bags.topics import SIDES
from vergence.body import JointAngles, Picture, Pixels
from vergence_rig.rig import JOINT_NAMES

RATE_HZ = 30


def main(arguments: Sequence[str]) -> None:
    """Write the data set FOLDER."""
    folder, task, *bags = arguments
    data: Any = None
    for path in bags:
        for frame in frames(Path(path)):
            if data is None:
                data = LeRobotDataset.create(
                    f"local/{Path(folder).name}", RATE_HZ, features(frame), root=folder, robot_type="vergence"
                )
            data.add_frame({**frame, "task": task})
        data.save_episode()
    data.finalize()


def frames(path: Path) -> Iterator[dict[str, Any]]:
    """Yield a frame for every pair of a recording: the newest joint angles and command when its second picture came."""
    pictures, state = dict[str, Pixels](), None
    with HeadBag(path) as bag:
        commands = [
            (arrival_ns, np.array([dict(zip(one.name, one.position, strict=True))[name] for name in JOINT_NAMES]))
            for arrival_ns, one in bag.messages("joint_command")
        ]
        for arrival_ns, event in bag.events():
            if isinstance(event, JointAngles):
                state = event.angles_rad
            elif isinstance(event, Picture):
                pictures[SIDES[event.side]] = np.asarray(cv2.cvtColor(event.pixels, cv2.COLOR_BGR2RGB), np.uint8)
            if len(pictures) < len(SIDES) or state is None:
                continue
            while len(commands) > 1 and commands[1][0] <= arrival_ns:
                commands.pop(0)
            action = commands[0][1] if commands and commands[0][0] <= arrival_ns else state
            frame: dict[str, Any] = {f"observation.images.{eye}": picture for eye, picture in pictures.items()}
            yield {**frame, "observation.state": np.float32(state), "action": np.float32(action)}
            pictures = {}


def features(frame: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the description of such a frame."""
    return {
        name: {"dtype": "video", "shape": value.shape, "names": ["height", "width", "channels"]}
        if value.ndim == 3
        else {"dtype": "float32", "shape": value.shape, "names": list(JOINT_NAMES)}
        for name, value in frame.items()
    }


if __name__ == "__main__":
    main(sys.argv[1:])
