"""The graph of a simulated head, in a room or before photographs, as processes: every node but the visual encoder."""

from pathlib import Path

from vergence_bringup.node_table import PHOTOGRAPHED, SIMULATED, graph
from vergence_bringup.ros.processes import NodeCommand

# Simulator, nodes and recorder share two cores: at higher rates images arrive late, which is worse than fewer images.
FRAME_RATE_HZ = 20.0
BOX_RATE_HZ = 8.0
LEFT_OUT = ("eye_rotation_node",)
"""Only the stated distance needs the visual encoder. It takes half a core, and on two cores the other nodes starve."""
SOURCES = {SIMULATED: "sim_node", PHOTOGRAPHED: "photo_node"}
"""What stands for cameras, servos and world, by the kind of head."""


def simulated_head(rig: Path, head: str = SIMULATED, /, **world: object) -> dict[str, NodeCommand]:
    """Return the command of each node of a head but those left out, by executable, with its shipped YAML.

    `rig` is the path of rig.yaml; `world` are parameters of sim_node, or of photo_node for a PHOTOGRAPHED `head`.
    """
    changes: dict[str, dict[str, object]] = {
        SOURCES[head]: {"camera.frame_rate_hz": FRAME_RATE_HZ, **world},
        "box_metric_node": {"rate_hz": BOX_RATE_HZ},
    }
    return {
        executable: NodeCommand.of(executable, {"rig": str(rig), **changes.get(executable, {})})
        for executable in graph(head)
        if executable not in LEFT_OUT
    }
