"""The graph of a simulated head, in a room or before photographs, as processes, in simulated or in real time."""

from pathlib import Path

from vergence_bringup.node_table import PHOTOGRAPHED, SIMULATED, graph
from vergence_bringup.ros.processes import NodeCommand

# In real time simulator, nodes and recorder share two cores: at higher rates images arrive late, which is worse than
# fewer images. In simulated time a run takes as long as its pairs.
FRAME_RATE_HZ = 20.0
BOX_RATE_HZ = 8.0
SIMULATED_BOX_RATE_HZ = 10.0
"""Every second pair: simulated time knows which, and waits for those."""
LEFT_OUT_IN_REAL_TIME = ("eye_rotation_node",)
"""Only the stated distance needs the visual encoder. It takes half a core, and on two cores the other nodes starve."""
SOURCES = {SIMULATED: "sim_node", PHOTOGRAPHED: "photo_node"}
"""What stands for cameras, servos and world, by the kind of head."""


def simulated_head(
    rig: Path, head: str = SIMULATED, /, *, simulated_time: bool = False, **world: object
) -> dict[str, NodeCommand]:
    """Return the command of each node of a head, by executable, with its shipped YAML.

    `rig` is the path of rig.yaml; `world` are parameters of sim_node, or of photo_node for a PHOTOGRAPHED `head`. In
    simulated time that node owns /clock, which stands until sim/run_until lets it go on; in real time some nodes are
    left out.
    """
    box_rate_hz = SIMULATED_BOX_RATE_HZ if simulated_time else BOX_RATE_HZ
    changes: dict[str, dict[str, object]] = {
        SOURCES[head]: {"camera.frame_rate_hz": FRAME_RATE_HZ, "clock.stepped": simulated_time, **world},
        "box_metric_node": {"rate_hz": box_rate_hz},
    }
    shared = {"rig": str(rig), "use_sim_time": simulated_time}
    return {
        executable: NodeCommand.of(executable, {**shared, **changes.get(executable, {})})
        for executable in graph(head)
        if simulated_time or executable not in LEFT_OUT_IN_REAL_TIME
    }
