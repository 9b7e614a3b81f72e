"""The whole graph of a simulated head as processes, for the demo and the benchmarks."""

from pathlib import Path

from vergence_bringup.node_table import SIMULATED, graph
from vergence_bringup.ros.processes import NodeCommand

# Simulator, nodes and recorder share two cores: at higher rates images arrive late, which is worse than fewer images.
FRAME_RATE_HZ = 20.0
BOX_RATE_HZ = 8.0


def simulated_head(rig: Path, **sim: object) -> dict[str, NodeCommand]:
    """Return the command of every node of a simulated head, by executable, each with its shipped YAML.

    `rig` is the path of rig.yaml; `sim` are parameters of sim_node.
    """
    changes: dict[str, dict[str, object]] = {
        "sim_node": {"camera.frame_rate_hz": FRAME_RATE_HZ, **sim},
        "box_metric_node": {"rate_hz": BOX_RATE_HZ},
    }
    return {
        executable: NodeCommand.of(executable, {"rig": str(rig), **changes.get(executable, {})})
        for executable in graph(SIMULATED)
    }
