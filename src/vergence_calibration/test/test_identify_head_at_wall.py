"""The whole identification of a head before a wall: servos with play, cameras with latency, faults of every kind."""

import heapq
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
import pytest
import yaml

from vergence_calibration.backed_up_file import replace as replace_file
from vergence_calibration.eye_turn import Image
from vergence_calibration.identification.axis_log import (
    EYES,
    AxisLog,
    EyeCamera,
    Frames,
    IdentifyError,
    IdentifyParameters,
    Move,
)
from vergence_calibration.identification.identification import Identification, identify
from vergence_calibration.identification.identified_rig import identified_rig, nodes_text, record, rig_text
from vergence_calibration.identification.pose import pose_with_room
from vergence_calibration.identification.seen_motion import shrunk, shrunk_camera
from vergence_gaze.control.controller import GazeController
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.testing.fake_head import FakeHead
from vergence_rig.camera import CameraModel
from vergence_rig.rig import JOINT_NAMES, CameraSpec, Rig, default_rig
from vergence_rig.rig_file import load_rig
from vergence_rig.servo import MG995, SG90, ServoPlant

DEG = math.pi / 180
CAMERA = CameraSpec(width_px=320, height_px=240, fx_px=270.0, fy_px=270.0, cx_px=159.5, cy_px=119.5)
QUICK = IdentifyParameters(steps=10, stairs=8, rest_s=0.3)


def wall(seed: int = 0) -> Image:
    random = np.random.default_rng(seed)
    picture = np.full((700, 800), 120, np.uint8)
    for _ in range(900):
        x, y, w, h = (int(v) for v in (*random.integers(0, 800, 2), *random.integers(5, 40, 2)))
        cv2.rectangle(picture, (x, y), (x + w, y + h), int(random.integers(20, 235)), -1)
    return cv2.GaussianBlur(picture, (0, 0), 0.8)


def sees(pan_rad: float, tilt_rad: float, picture: Image) -> Image:
    k = np.array([[270.0, 0, 159.5], [0, 270.0, 119.5], [0, 0, 1]])
    wide = np.array([[270.0, 0, 399.5], [0, 270.0, 349.5], [0, 0, 1]])
    pan = cv2.Rodrigues(np.array([0.0, -pan_rad, 0.0]))[0]
    tilt = cv2.Rodrigues(np.array([-tilt_rad, 0.0, 0.0]))[0]
    return cv2.warpPerspective(picture, k @ (tilt @ pan).T @ np.linalg.inv(wide), (320, 240))


@dataclass
class WallHead:
    """A head in lockstep. `wires` says which joint's command each servo really gets, and with which sign."""

    servo_latency_s: float = 0.05
    camera_latency_s: float = 0.04
    frame_s: float = 1 / 30
    stamps_late_s: tuple[float, float] = (0.0, 0.0)
    wires: dict[str, tuple[str, float]] = field(default_factory=lambda: {name: (name, 1.0) for name in JOINT_NAMES})
    eyes: dict[str, str] = field(default_factory=lambda: {eye: eye for eye in EYES})
    focal: CameraSpec = CAMERA
    calibrated: bool = True
    picture: Callable[[Image, float], Image] = lambda picture, now_s: picture
    blind: str = ""
    drift_rad_s: float = 0.0

    def __post_init__(self) -> None:
        specs = {"pan_left": SG90, "pan_right": SG90, "tilt": MG995}
        latency = {"command_latency_s": self.servo_latency_s}
        self.plants = {name: ServoPlant(spec.replaced(**latency)) for name, spec in specs.items()}
        self.models = {name: ServoPlant(spec.replaced(**latency)) for name, spec in specs.items()}
        self.texture, self.now_s = wall(), 0.0
        self.random = np.random.default_rng(2)
        self.events = [(0.0, "left"), (0.007, "right"), (0.003, "joints")]
        self.commanded: list[dict[str, float]] = []

    def cameras(self) -> dict[str, EyeCamera]:
        return {eye: EyeCamera(CameraModel(self.focal), self.calibrated) for eye in EYES}

    def _drive(self, joints_rad: dict[str, float]) -> None:
        self.commanded.append(joints_rad)
        for servo, (joint, sign) in self.wires.items():
            self.plants[servo].command(sign * joints_rad[joint], self.now_s)
        for joint, angle in joints_rad.items():
            self.models[joint].command(angle, self.now_s)

    def _run(self, until_s: float, joint: str, frames: dict[str, Frames], reports: list[tuple[float, float]]) -> None:
        while self.events[0][0] < until_s:
            due_s, kind = heapq.heappop(self.events)
            heapq.heappush(self.events, (due_s + (0.02 if kind == "joints" else self.frame_s), kind))
            true = {name: plant.step(due_s) for name, plant in self.plants.items()}
            self.models[joint].step(due_s)
            if kind == "joints":
                reports.append((due_s, self.models[joint].modelled_rad))
            elif kind != self.blind:
                eye = self.eyes[kind]
                view = sees(true[f"pan_{eye}"] + self.drift_rad_s * due_s, true["tilt"], self.texture)
                stamp_s = due_s + self.stamps_late_s[EYES.index(kind)]
                frames[kind].add(stamp_s, due_s + self.camera_latency_s, self.picture(view, due_s))
        self.now_s = until_s

    def record(self, joint: str, moves: Sequence[Move]) -> AxisLog:
        frames = {eye: Frames() for eye in EYES}
        reports: list[tuple[float, float]] = []
        amplitude_rad = max(abs(move.angle_rad) for move in moves)
        pose = pose_with_room(default_rig(), dict.fromkeys(JOINT_NAMES, 0.0), amplitude_rad)
        self._drive(pose)
        self._run(self.now_s + 0.3, joint, {eye: Frames() for eye in EYES}, [])
        self._run(self.now_s + 0.1, joint, frames, reports)
        commands = []
        for move in moves:
            commands.append((self.now_s, move.angle_rad))
            self._drive(pose | {joint: pose[joint] + move.angle_rad})
            self._run(self.now_s + move.rest_s + move.share * self.frame_s, joint, frames, reports)
        return AxisLog(joint, np.array(commands), np.array(reports), frames)


def silent(text: str) -> None:
    pass


def found_by(head: WallHead, *axes: str, assumption: str = "stamps") -> Identification:
    return identify(head, axes or JOINT_NAMES, QUICK, assumption, silent)


def test_a_sound_head_is_identified_whole():
    head = WallHead(servo_latency_s=0.06, stamps_late_s=(0.0, 0.025))
    found = found_by(head)
    for joint in JOINT_NAMES:
        servo = found.latencies.servo_s[joint]
        assert servo.value_s == pytest.approx(0.06, abs=4 * servo.sigma_s)
        assert servo.sigma_s < 0.008
        late = found.latencies.joints_late_s[joint]
        assert late.value_s == pytest.approx(0.0, abs=4 * late.sigma_s)
    apart = found.latencies.eyes_apart_s
    assert apart.value_s == pytest.approx(-0.025, abs=4 * apart.sigma_s)
    assert found.latencies.exposure_to_arrival_s["right"].value_s == pytest.approx(0.04, abs=4 * apart.sigma_s)
    for gain in found.gains:
        assert gain.px_per_rad == pytest.approx(270.0, rel=0.03)
        assert gain.px_per_rad == pytest.approx(270.0, abs=4 * gain.px_per_rad_sigma)
    lost = {gain.joint: gain.loop.lost for gain in found.gains}
    assert lost["pan_left"] == pytest.approx(SG90.dead_band_rad + SG90.backlash_rad, abs=0.15 * DEG)
    rig = identified_rig(default_rig(), found)
    assert rig.joints.tilt.servo.command_latency_s == pytest.approx(0.06, abs=0.01)
    assert rig.pan_left.servo.dead_band_rad == SG90.dead_band_rad  # within the uncertainty: left alone
    assert rig.left_camera == default_rig().left_camera


CROSSED = {"pan_left": ("pan_right", 1.0), "pan_right": ("pan_left", 1.0), "tilt": ("tilt", 1.0)}


@pytest.mark.parametrize(
    ("head", "axes", "text"),
    [
        (WallHead(wires={n: (n, -1.0 if n == "pan_left" else 1.0) for n in JOINT_NAMES}), ("pan_left", "pan_right"),
         r"^pan_left turns the wrong way: .*`sign: -1` for pan_left in servos\.yaml"),
        (WallHead(wires={n: (n, -1.0 if n == "tilt" else 1.0) for n in JOINT_NAMES}), ("tilt",),
         r"^tilt turns the wrong way: .*`sign: -1` for tilt"),
        (WallHead(eyes={"left": "right", "right": "left"}), ("pan_left", "pan_right"),
         "^pan_left moves the right image .* exchange left_device and right_device"),
        (WallHead(wires=CROSSED), ("pan_left",), "^pan_left moves the right image .* the channels of"),
        (WallHead(wires={n: (n, 0.0 if n == "pan_right" else 1.0) for n in JOINT_NAMES}), ("pan_right",),
         "^pan_right does not move the images: .*powered"),
        (WallHead(picture=lambda picture, now_s: np.full_like(picture, 90)), ("tilt",),
         "^tilt, left eye: the image must have 25 or more features: got 0"),
        (WallHead(blind="right"), ("pan_left",), "^pan_left, right eye: 8 or more images .* got 0"),
        (WallHead(focal=replace(CAMERA, fx_px=400.0, fy_px=400.0)), ("pan_left",),
         r"^pan_left, left eye: px per radian commanded must be 300 to 500, .* got 2\d\d; .*calibrate_servos --visual"),
        (WallHead(), ("pan_left", "pan_left"), "^axes must be .* each once: got pan_left, pan_left"),
        (WallHead(), ("roll",), "^axes must be .*: got roll"),
    ],
)  # fmt: skip
def test_heads_that_are_wrong_are_refused_in_one_line(head: WallHead, axes: tuple[str, ...], text: str):
    with pytest.raises(IdentifyError, match=text) as refusal:
        found_by(head, *axes)
    assert len(str(refusal.value).splitlines()) == 1


def curtain(share: float) -> Callable[[Image, float], Image]:
    """Something textured that covers this share of the view and swings to and fro."""
    cloth = wall(7)

    def pictured(picture: Image, now_s: float) -> Image:
        covered = picture.copy()
        width = int(share * picture.shape[1])
        x = 200 + round(25 * math.sin(4.1 * now_s))
        covered[:, :width] = cloth[100 : 100 + picture.shape[0], x : x + width]
        return covered

    return pictured


def test_a_thing_that_moves_in_view_is_ridden_out_while_small_and_refused_when_large():
    gains = found_by(WallHead(picture=curtain(0.2)), "pan_left").gains
    assert gains[0].px_per_rad == pytest.approx(270.0, rel=0.04)
    with pytest.raises(IdentifyError, match=r"something moves in view"):
        found_by(WallHead(picture=curtain(0.6)), "pan_left")


def test_an_uncalibrated_cameras_focal_length_is_measured():
    guess = replace(CAMERA, fx_px=330.0, fy_px=330.0)
    found = found_by(WallHead(focal=guess, calibrated=False), "pan_left", "tilt")
    rig = identified_rig(replace(default_rig(), left_camera=guess), found)
    assert rig.left_camera.fx_px == pytest.approx(270.0, rel=0.04)
    assert rig.left_camera.fy_px == pytest.approx(270.0, rel=0.04)
    assert rig.right_camera.fx_px == default_rig().right_camera.fx_px  # pan_right was not moved


def test_no_command_leaves_the_limits():
    head = WallHead()
    found_by(head, "pan_left")
    for commanded in head.commanded:
        assert commanded["pan_right"] - commanded["pan_left"] >= 0
        assert all(abs(angle) < 7 * DEG for angle in commanded.values())


def test_large_pictures_are_made_small_and_keep_their_angles():
    camera = CameraModel(CameraSpec())
    small = shrunk(np.zeros((480, 640, 3), np.uint8))
    assert small.shape == (240, 320)
    model = shrunk_camera(camera, small)
    # the middle of a block of 2x2 px lies half a pixel beyond the first one's
    assert model.angles([[10.0, 20.0]]) == pytest.approx(camera.angles([[20.5, 40.5]]))
    with pytest.raises(IdentifyError, match="aspect ratio 320:180: camera_info is for 640x480"):
        shrunk_camera(camera, np.zeros((180, 320), np.uint8))


# ---- the controller with what was written


def ramp(time_s: float) -> np.ndarray:
    azimuth = math.radians(-10.0 + 20.0 * max(time_s - 1.0, 0.0))
    return 0.7 * np.array([math.cos(azimuth), math.sin(azimuth), 0.0])


def pursuit_error_deg(rig: Rig, true_latency_s: float) -> float:
    """Return how far the eyes are behind a target at 20 degrees/s, with a controller that uses this rig."""
    slow = replace(SG90, command_latency_s=true_latency_s, dead_band_rad=0.0, backlash_rad=0.0, pulse_step_rad=0.0)
    head = FakeHead(default_rig().with_servos(slow), ramp)
    controller = GazeController(rig, gaze_parameters())
    arrived, errors, ticks = [], [], 0
    while head.time_s < 2.4:
        arrived += head.advance()
        ticks += 1
        if ticks % 3:
            continue
        if ticks == 30:
            x, y = head.project(head.target(head.time_s), True)
            controller.look_at(Goal(GoalKind.PIXEL, left_xy=(x, y)), head.time_s)
        command = controller.step(head.time_s, arrived)
        arrived = []
        head.execute(command)
        errors.append(abs(math.degrees(head.true_errors_rad()[0])))
    return float(np.median(errors[-60:]))


def test_the_file_is_read_back_and_the_controller_looks_further_ahead_with_it(tmp_path):
    found = found_by(WallHead(servo_latency_s=0.1))
    path = tmp_path / "rig.yaml"
    path.write_text("baseline_m: 0.07\n")
    rig = identified_rig(load_rig(path), found)
    kept = replace_file(path, rig_text(rig, record(found), "now"))
    assert kept is not None
    assert kept.read_text() == "baseline_m: 0.07\n"
    again = load_rig(path)
    assert again == rig
    assert again.baseline_m == 0.07
    document = yaml.safe_load(path.read_text())["identified"]
    assert document["axes"]["tilt"]["sign"] == 1
    assert document["axes"]["pan_left"]["left_eye"]["px_per_rad"] == pytest.approx(270, rel=0.03)
    assert document["command_to_arrival_s"] == pytest.approx(0.14, abs=0.015)
    assert nodes_text({"/servo_node": {"ros__parameters": {"command_latency_s": 0.1}}}).startswith("#")
    before_deg, after_deg = (pursuit_error_deg(rig, 0.1) for rig in (load_rig(kept), again))
    assert before_deg > 1.2  # 20 degrees/s for the 85 ms of unmodelled latency
    assert after_deg < 0.5 * before_deg
