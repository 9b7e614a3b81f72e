"""What a launch file does when one of its nodes ends: a pure decision, and the text for the terminal."""

from dataclasses import dataclass

from vergence_rig.banner import banner

CLEAN_END, REFUSED = 0, 2
"""Exit statuses of every node: ended by request, and what it was given cannot be used."""
OPTIONAL = {
    "box_metric_node": "metric II and goals by class",
    "eye_rotation_node": "the visual encoder of the eyes' angles",
    "robot_state_publisher": "the head's frames on tf",
    "web_node": "its page",
}
"""The nodes without which a head still verges, and what it lacks then."""


@dataclass(frozen=True)
class Ending:
    """What follows from a node's end: a text for the terminal, and whether the whole launch ends."""

    text: str
    ends_launch: bool


def ending(executable: str, status: int, respawns: bool = False) -> Ending:
    """Return what follows from the end of a node with this exit status (negative: killed by that signal)."""
    if executable in OPTIONAL:
        text = banner(
            f"{executable} ended ({_status(status)}): the head runs on without {OPTIONAL[executable]}",
            "its own message is in the lines above",
        )
        return Ending(text, False)
    if respawns and status not in (CLEAN_END, REFUSED):
        return Ending(f"{executable} ended ({_status(status)}); it is started again", False)
    text = banner(
        f"{executable} ended ({_status(status)}): the head cannot work without it, and the launch ends",
        "its own message is in the lines above",
    )
    return Ending(text, True)


def _status(status: int) -> str:
    if status == CLEAN_END:
        return "by request"
    if status == REFUSED:
        return "it could not start"
    return f"killed by signal {-status}" if status < 0 else f"exit status {status}"
