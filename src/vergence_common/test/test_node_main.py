"""A process whose context is shut down while its executor registers callbacks ends with status 0, its node closed.

rclpy's signal handler shuts the context down on a thread of its own, so a signal may come at that moment. Here a
waitable does it, when the executor asks it for what it waits for.
"""

import subprocess
import sys

LIMIT_S = 60.0
PROGRAM = """
import sys

import rclpy
from rclpy.node import Node
from rclpy.waitable import NumberOfEntities, Waitable
from rclpy.callback_groups import ReentrantCallbackGroup

from vergence_common.node_main import run_nodes


class Late(Waitable):
    def get_num_entities(self):
        rclpy.shutdown()
        return NumberOfEntities()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

    is_ready = take_data = execute = add_to_wait_set = lambda self, *_: None


class Head(Node):
    def __init__(self):
        super().__init__("head")
        self.add_waitable(Late(ReentrantCallbackGroup()))

    def close(self):
        print("closed")


sys.exit(run_nodes([Head], []))
"""


def test_a_shutdown_while_callbacks_are_registered_is_a_clean_end() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert (done.returncode, done.stdout) == (0, "closed\n"), done.stderr
