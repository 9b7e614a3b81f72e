"""servo_node as a real node over a fake sysfs tree: topics and services in, pulse widths out."""

import math
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from vergence_common.stamps import to_stamp
from vergence_rig.parameters import ParameterError
from vergence_servo.drivers.protocol import ChannelError, DriverUnavailableError
from vergence_servo.ros import servo_node
from vergence_servo.ros.servo_node import ServoNode
from vergence_servo.testing.pigpio_daemon import PigpioDaemon

pytestmark = pytest.mark.graph

WAIT_S = 60.0
REPEAT_S = 0.05
CONFIG = Path(__file__).parents[2] / "config"
JOINTS = ["pan_left", "pan_right", "tilt"]


def make_chip(root: Path, channels: int = 4) -> Path:
    """Make a PWM chip whose channels are exported already."""
    chip = root / "pwmchip0"
    for number in range(channels):
        folder = chip / f"pwm{number}"
        folder.mkdir(parents=True)
        for name in ("duty_cycle", "period", "enable"):
            (folder / name).write_text("0\n")
    (chip / "npwm").write_text(f"{channels}\n")
    return chip


class Graph:
    """servo_node and a client on one executor."""

    def __init__(self, root: Path, pwm_channels: int = 4, **overrides: Any) -> None:
        self.chip = make_chip(root, pwm_channels)
        self.context = Context()
        rclpy.init(context=self.context)
        values = {
            "backend": "kernel_pwm",
            "servos": str(CONFIG / "servos.yaml"),
            "kernel_pwm.root": str(root),
            "pose_file": str(root / "pose.json"),
            "stagger_s": 0.0,
            "guardian": False,
        } | overrides
        parameters = [Parameter(name, value=value) for name, value in values.items()]
        self.client = Node("client", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.client)
        self.node: ServoNode | None = None
        self.node = ServoNode(context=self.context, parameter_overrides=parameters)
        self.executor.add_node(self.node)
        self.states: list[JointState] = []
        self.health: dict[str, DiagnosticStatus] = {}
        self.client.create_subscription(JointState, "joint_states", self.states.append, 10)
        self.client.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.joint_command = self.client.create_publisher(JointState, "joint_command", 10)
        self.until(lambda: self.joint_command.get_subscription_count() == 1)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.health |= {status.name.split(": ")[1]: status for status in message.status}

    def until(self, condition: Callable[[], bool], command: Callable[[], None] | None = None) -> None:
        """Spin until `condition` holds; meanwhile `command` is repeated, as a controller does.

        A command that is given once goes stale, or times out on its way, where this machine pauses.
        """
        done = Future(executor=self.executor)
        watch = self.client.create_timer(0.005, lambda: done.set_result(True) if condition() else None)
        repeat = self.client.create_timer(REPEAT_S, command) if command is not None else None
        self.executor.spin_until_future_complete(done, timeout_sec=WAIT_S)
        for timer in (watch, repeat):
            if timer is not None:
                self.client.destroy_timer(timer)
        assert done.done(), "the condition never held"

    def drive(self, **positions_rad: float) -> None:
        """Command until the pulses of these joints are where they should be."""

        def there() -> bool:
            pulses = [(self.duty_us(JOINTS.index(name)), us(angle)) for name, angle in positions_rad.items()]
            return all(pulse == pytest.approx(wanted, abs=0.03) for pulse, wanted in pulses)

        self.until(there, lambda: self.command(**positions_rad))

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service of the node."""
        client = self.client.create_client(kind, f"servo_node/{name}")
        assert client.wait_for_service(timeout_sec=WAIT_S)
        future = client.call_async(request)
        self.executor.spin_until_future_complete(future, timeout_sec=WAIT_S)
        assert future.done()
        return future.result()

    def command(self, stamp_s: float | None = None, **positions_rad: float) -> None:
        """Publish joint_command, stamped now by default."""
        message = JointState(name=list(positions_rad), position=list(positions_rad.values()))
        message.header.stamp = to_stamp(time.time() if stamp_s is None else stamp_s)
        self.joint_command.publish(message)

    def duty_us(self, channel: int) -> float:
        """The pulse in the kernel's file [us]; 0 if none."""
        texts = [(self.chip / f"pwm{channel}" / name).read_text().split() for name in ("duty_cycle", "enable")]
        return int(texts[0][0]) / 1000 if texts[0] and texts[1] == ["1"] else 0.0

    def value(self, status: str, key: str) -> str:
        """A figure from the diagnostics; "" until there is one."""
        values = self.health[status].values if status in self.health else []
        return next((pair.value for pair in values if pair.key == key), "")

    def level(self, status: str) -> bytes | None:
        """A level from the diagnostics; None until there is one."""
        return self.health[status].level if status in self.health else None

    def close(self) -> None:
        if self.node is not None:
            self.node.close()
            self.node.destroy_node()
        self.client.destroy_node()
        self.executor.shutdown()
        self.context.try_shutdown()


@pytest.fixture
def make_graph(tmp_path: Path, domain_id: int) -> Iterator[Callable[..., Graph]]:
    made: list[Graph] = []

    def make(**overrides: Any) -> Graph:
        made.append(Graph(tmp_path, **overrides))
        return made[-1]

    yield make
    for graph in made:
        graph.close()


def us(angle_rad: float) -> float:
    """The pulse of an SG90 as shipped [us]."""
    return 1500 + math.degrees(angle_rad) / 0.09


def test_joint_command_by_name_reaches_the_pulses_and_joint_states(make_graph: Callable[..., Graph]):
    graph = make_graph()
    assert [graph.duty_us(channel) for channel in range(3)] == [0.0] * 3
    graph.drive(tilt=-0.2, pan_left=0.3)
    assert graph.duty_us(1) == 0.0
    graph.until(lambda: bool(graph.states) and graph.states[-1].position[0] == pytest.approx(0.3, abs=1e-3))
    assert graph.states[-1].name == JOINTS


def test_a_second_node_on_the_same_channels_is_refused_and_the_first_goes_on(
    make_graph: Callable[..., Graph], tmp_path: Path
):
    graph = make_graph()
    graph.drive(pan_left=0.3)
    given = {"backend": "kernel_pwm", "kernel_pwm.root": str(tmp_path), "guardian": False, "joints": ["pan_left"]}
    given["servos"], given["park_rad"] = str(CONFIG / "servos.yaml"), [0.0]
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    with pytest.raises(DriverUnavailableError, match=rf"channel 0 of .* must have one owner: .* {os.getpid()} "):
        ServoNode(context=graph.context, parameter_overrides=overrides)
    graph.drive(pan_left=-0.3)


def test_commands_in_the_order_of_the_joints(make_graph: Callable[..., Graph]):
    graph = make_graph(joints=["tilt", "pan_right"], park_rad=[0.0, 0.0])
    publisher = graph.client.create_publisher(Float64MultiArray, "servo_node/commands", 10)
    graph.until(lambda: publisher.get_subscription_count() == 1)
    graph.until(
        lambda: [graph.duty_us(i) for i in (2, 1)] == pytest.approx([us(0.1), us(0.2)], abs=0.03),
        lambda: publisher.publish(Float64MultiArray(data=[0.1, 0.2])),
    )
    publisher.publish(Float64MultiArray(data=[0.1, 0.2, 0.3]))
    graph.until(lambda: graph.value("commands", "refused ~/commands") == "1")


def test_a_trajectory_is_interpolated(make_graph: Callable[..., Graph]):
    graph = make_graph(command_timeout_s=0.1)
    publisher = graph.client.create_publisher(JointTrajectory, "joint_trajectory", 10)
    graph.until(lambda: publisher.get_subscription_count() == 1)

    def publish(seconds: int) -> None:
        point = JointTrajectoryPoint(positions=[0.5], time_from_start=Duration(sec=seconds))
        publisher.publish(JointTrajectory(joint_names=["pan_left"], points=[point]))

    # As slow as may be, far longer than command_timeout_s: whenever this test looks, the servo is on its way.
    publish(60)
    seen: list[float] = []

    def on_its_way() -> bool:
        pulse_us = graph.duty_us(0)
        if pulse_us > us(0.0) and pulse_us not in seen:
            seen.append(pulse_us)
        return len(seen) >= 10

    graph.until(on_its_way)
    assert seen == sorted(seen)
    assert seen[-1] < us(0.5)
    graph.until(lambda: graph.duty_us(0) == pytest.approx(us(0.5), abs=0.03), lambda: publish(0))


@pytest.mark.parametrize(
    ("command", "text"),
    [
        ({"neck": 0.1}, "got 'neck'"),
        ({"tilt": math.nan}, "nan"),
        ({"tilt": 0.1, "stamp_s": 1.0}, "s old"),
        ({"tilt": 0.1, "stamp_s": 2.1e9}, "ahead"),
    ],
)
def test_refused_commands_move_nothing_and_say_why(
    make_graph: Callable[..., Graph], command: dict[str, float], text: str
):
    graph = make_graph()
    graph.until(
        lambda: text in graph.value("commands", "last refusal") and graph.level("commands") == DiagnosticStatus.WARN,
        lambda: graph.command(**command),
    )
    assert graph.duty_us(2) == 0.0


def test_silence_holds_then_releases_then_a_fresh_command_resumes(make_graph: Callable[..., Graph]):
    graph = make_graph(command_timeout_s=0.1, release_timeout_s=0.5)
    graph.drive(pan_left=0.2)
    graph.until(lambda: graph.duty_us(0) == 0)
    graph.drive(pan_left=0.1)


def test_its_time_outs_go_on_where_simulated_time_stands(make_graph: Callable[..., Graph]):
    graph = make_graph(use_sim_time=True, command_timeout_s=0.1, release_timeout_s=0.5)
    graph.until(lambda: graph.duty_us(0) > 0, lambda: graph.command(stamp_s=0.0, pan_left=0.2))
    graph.until(lambda: graph.duty_us(0) == 0)
    assert graph.states


def test_enable_park_and_release(make_graph: Callable[..., Graph]):
    graph = make_graph(enabled=False, park_rad=[0.1, 0.1, 0.1], park_speed_rad_s=20.0)
    assert not graph.call(Trigger, "park", Trigger.Request()).success
    assert graph.call(SetBool, "enable", SetBool.Request(data=True)).success
    assert graph.call(Trigger, "park", Trigger.Request()).success
    graph.until(lambda: all(graph.duty_us(i) == pytest.approx(us(0.1), abs=0.03) for i in range(3)))
    assert graph.call(Trigger, "release", Trigger.Request()).success
    assert [graph.duty_us(i) for i in range(3)] == [0.0] * 3


def test_the_real_resolution_is_published_to_late_joiners(make_graph: Callable[..., Graph]):
    graph = make_graph()
    seen: list[JointState] = []
    latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
    graph.client.create_subscription(JointState, "servo_node/resolution", seen.append, latched)
    graph.until(lambda: len(seen) == 1)
    assert math.degrees(seen[0].position[0]) == pytest.approx(0.02 * 0.09)


def test_a_failing_channel_is_reported_and_recovers(make_graph: Callable[..., Graph], tmp_path: Path):
    graph = make_graph(**{"retry.first_s": 0.05, "retry.longest_s": 0.1})
    graph.drive(pan_left=0.2, tilt=0.2)
    (graph.chip / "pwm0").rename(tmp_path / "gone")
    graph.until(
        lambda: graph.level("servos") == DiagnosticStatus.ERROR,
        lambda: graph.command(pan_left=0.1, tilt=-0.1),
    )
    assert "pan_left" in graph.health["servos"].message
    assert "No such file" in graph.health["pan_left"].message
    assert graph.health["tilt"].level == DiagnosticStatus.OK
    graph.until(
        lambda: graph.duty_us(2) == pytest.approx(us(-0.1), abs=0.03), lambda: graph.command(pan_left=0.1, tilt=-0.1)
    )
    (tmp_path / "gone").rename(graph.chip / "pwm0")
    graph.drive(pan_left=0.1, tilt=0.1)


def test_two_commanders_are_reported(make_graph: Callable[..., Graph]):
    graph = make_graph()
    graph.until(lambda: graph.level("commands") == DiagnosticStatus.OK)
    rival = Node("rival", context=graph.context)
    rival.create_publisher(JointState, "joint_command", 10)
    graph.until(lambda: graph.level("commands") == DiagnosticStatus.ERROR)
    assert "/rival on joint_command" in graph.health["commands"].message
    rival.destroy_node()
    graph.until(lambda: graph.level("commands") == DiagnosticStatus.OK)


def test_starting_at_the_last_pose(make_graph: Callable[..., Graph], tmp_path: Path):
    (tmp_path / "pose.json").write_text('{"pan_left": 0.25, "tilt": 0.1, "nose": 3}')
    graph = make_graph(start="last_pose")
    graph.until(lambda: graph.duty_us(0) == pytest.approx(us(0.25), abs=0.03))


def test_time_outs_change_while_running(make_graph: Callable[..., Graph]):
    graph = make_graph(release_timeout_s=1000.0)
    graph.drive(pan_left=0.2)
    assert graph.node is not None
    result = graph.node.set_parameters_atomically(
        [Parameter("release_timeout_s", value=0.2), Parameter("command_timeout_s", value=0.1)]
    )
    assert result.successful
    graph.until(lambda: graph.duty_us(0) == 0)
    assert not graph.node.set_parameters_atomically([Parameter("backend", value="fake")]).successful


def test_servo_node_needs_no_opencv():
    code = "import sys, vergence_servo.ros.servo_node; sys.exit('cv2' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_renamed_parameter_is_named(make_graph: Callable[..., Graph]):
    with pytest.raises(ParameterError, match=r"'retry_first_s' was renamed: set 'retry\.first_s' \(in s\)"):
        make_graph(retry_first_s=1.0)


@pytest.mark.parametrize(
    ("overrides", "kind", "text"),
    [
        ({"backend": "gpiozero"}, DriverUnavailableError, "11 positions"),
        ({"backend": "kernel_pwm", "servos": ""}, ParameterError, "servos"),
        ({"joints": ["neck"], "park_rad": [0.0]}, ValueError, "'neck' has no servo"),
        ({"joints": ["tilt"]}, ParameterError, "park_rad"),
        ({"speed": 1.0}, ParameterError, "there is no parameter 'speed'"),
        ({"kernel_pwm.chip": 7}, DriverUnavailableError, "must be one of 0"),
    ],
)
def test_configurations_that_cannot_be_end_the_node(
    make_graph: Callable[..., Graph], overrides: dict[str, Any], kind: type[Exception], text: str
):
    with pytest.raises(kind, match=text):
        make_graph(**overrides)


def test_a_pi_4_drives_the_pans_by_kernel_pwm_and_the_tilt_by_another_backend(
    make_graph: Callable[..., Graph], tmp_path: Path
):
    """Two PWM channels for three servos: each joint's command goes to the backend that servos.yaml names for it."""
    daemon = PigpioDaemon()
    path = tmp_path / "servos.yaml"
    servos = {name: {"channel": JOINTS.index(name), "model": "sg90"} for name in JOINTS}
    servos["tilt"] |= {"channel": 17, "backend": "pigpio"}
    path.write_text(yaml.safe_dump({"servos": servos}))
    try:
        graph = make_graph(pwm_channels=2, servos=str(path), **{"pigpio.port": daemon.port})
        both = {"pan_left": 0.3, "pan_right": -0.3, "tilt": 0.2}
        graph.until(lambda: daemon.pulses.get(17) == 1625, lambda: graph.command(**both))
        graph.drive(pan_left=0.3, pan_right=-0.3)
        # The limits of a joint are the same on every backend: 45 degrees.
        graph.until(lambda: daemon.pulses[17] == 2000, lambda: graph.command(tilt=3.0))
        assert graph.node is not None
        assert [driver.resolution_us for driver in graph.node._drivers.by_joint.values()] == [0.02, 0.02, 5]
        graph.until(lambda: graph.value("servos", "backend") == "kernel_pwm: pan_left, pan_right; pigpio: tilt")
        graph.call(Trigger, "release", Trigger.Request())
        assert [graph.duty_us(0), graph.duty_us(1), daemon.pulses[17]] == [0.0, 0.0, 0]
        graph.drive(pan_left=0.1)
        graph.until(lambda: daemon.pulses[17] > 0, lambda: graph.command(tilt=0.1))
        graph.node.close()
        assert [graph.duty_us(0), graph.duty_us(1), daemon.pulses[17]] == [0.0, 0.0, 0]
    finally:
        daemon.close()


def test_a_third_servo_on_two_channels_is_refused_with_the_way_out(make_graph: Callable[..., Graph]):
    with pytest.raises(ChannelError, match=r"channel must be 0 to 1: got 2.*another backend in servos\.yaml"):
        make_graph(pwm_channels=2)


@pytest.fixture
def resting_soon(make_graph: Callable[..., Graph], monkeypatch: pytest.MonkeyPatch) -> tuple[Graph, ServoNode]:
    """A graph whose servo_node lowers its rates as soon as nothing moves, and that node."""
    monkeypatch.setattr(servo_node, "_RESTING_AFTER_S", 0.0)
    graph = make_graph()
    assert graph.node is not None
    return graph, graph.node


def test_joint_states_come_less_often_while_nothing_moves_and_the_pose_before_a_motion_at_once(
    resting_soon: tuple[Graph, ServoNode],
) -> None:
    graph, node = resting_soon
    graph.until(lambda: not node._updates.fast and not node._reports.fast)
    graph.states.clear()
    graph.command(pan_left=0.3)
    graph.until(lambda: node._updates.fast)
    assert node._reports.fast
    graph.until(lambda: bool(graph.states))
    assert graph.states[-1].position[0] < 0.3
    graph.drive(pan_left=0.3)
    graph.until(lambda: graph.states[-1].position[0] == pytest.approx(0.3, abs=1e-3))
    graph.until(lambda: not node._updates.fast and not node._reports.fast)


def test_a_command_that_is_repeated_keeps_servos_at_rest(
    resting_soon: tuple[Graph, ServoNode],
) -> None:
    graph, node = resting_soon

    def repeat() -> None:
        graph.command(pan_left=0.3)

    graph.until(lambda: bool(graph.states) and graph.states[-1].position[0] == pytest.approx(0.3, abs=1e-3), repeat)
    graph.until(lambda: not node._reports.fast, repeat)
    accepted, rates = node._counts.accepted["joint_command"], list[bool]()

    def repeated() -> bool:
        rates.append(node._reports.fast)
        return node._counts.accepted["joint_command"] > accepted + 3

    graph.until(repeated, repeat)
    assert not any(rates)
    assert graph.states[-1].velocity[0] == 0.0
