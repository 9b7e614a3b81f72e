"""Recordings: what is written is read again, measured alike, and refused where it is no recording."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence import Head
from vergence.bags.reader import HeadBag
from vergence.bags.replay import PairFigures, changed_verdicts, changes, read_figures, replayed, write_figures
from vergence.bags.topics import LATCHED, TOPICS
from vergence.bags.writer import BagError, BagWriter
from vergence.body import JointAngles, Picture
from vergence.testing.wall_body import WallBody
from vergence_metric.measurement.parameters import pair_measurement_parameters
from vergence_rig.rig import default_rig

SHIPPED = pair_measurement_parameters({})


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bags") / "wall"
    with Head(WallBody()) as head:
        head.record(path)
        head.run(0.4)
    return path


def test_what_was_seen_is_in_the_bag(recording: Path) -> None:
    with HeadBag(recording) as bag:
        events = list(bag.events())
        left, right = bag.cameras()
        counts = bag.counts
    pictures = [event for _, event in events if isinstance(event, Picture)]
    joints = [event for _, event in events if isinstance(event, JointAngles)]
    assert len(pictures) == counts["left/image_raw/compressed"] + counts["right/image_raw/compressed"] > 16
    assert len(joints) == counts["joint_states"] == 20
    body = WallBody()
    assert left is not None
    assert right is not None
    assert left.equals(body.cameras[0])
    assert right.equals(body.cameras[1])
    again = body.view(pictures[0].side).astype(float)
    assert np.abs(again - pictures[0].pixels).mean() < 4.0  # JPEG and noise
    arrivals_ns = [arrival_ns for arrival_ns, _ in events]
    assert arrivals_ns == sorted(arrivals_ns)


def test_the_layout_is_rosbag2s(recording: Path) -> None:
    assert sorted(path.name for path in recording.iterdir()) == ["metadata.yaml", "wall.mcap"]
    assert (recording / "wall.mcap").read_bytes()[:8] == b"\x89MCAP0\r\n"
    from vergence_rig.yaml_file import read_yaml

    about = read_yaml(recording / "metadata.yaml")["rosbag2_bagfile_information"]
    assert about["storage_identifier"] == "mcap"
    assert about["relative_file_paths"] == ["wall.mcap"]
    for topic in about["topics_with_message_count"]:
        described = topic["topic_metadata"]
        assert described["serialization_format"] == "cdr"
        assert described["type_description_hash"].startswith("RIHS01_")
        assert TOPICS[described["name"].lstrip("/")] == described["type"]


def test_the_same_parameters_give_the_same_figures_and_others_others(recording: Path) -> None:
    with HeadBag(recording) as bag:
        first = list(replayed(bag, default_rig(), SHIPPED))
        again = list(replayed(bag, default_rig(), SHIPPED))
        blurred = list(replayed(bag, default_rig(), pair_measurement_parameters({"edges.blur_sigma_px": 3.0})))
    assert first == again
    assert len(first) > 8
    assert all(row.before == row.after for row in changes(first, again))
    assert changed_verdicts(first, again) == []
    assert any(row.before != row.after for row in changes(first, blurred))
    assert first[-1].disparity_px == pytest.approx(12.0, abs=0.2)


finite = st.floats(allow_nan=True, allow_infinity=False, width=64)


@given(
    values=st.lists(finite, min_size=2, max_size=2),
    disparity_px=finite,
    verged=st.none() | st.booleans(),
    stamp_ns=st.integers(0, 2**62),
)
def test_figures_survive_their_file(
    tmp_path_factory: pytest.TempPathFactory,
    values: list[float],
    disparity_px: float,
    verged: bool | None,
    stamp_ns: int,
) -> None:
    path = tmp_path_factory.mktemp("figures") / "run.jsonl"
    one = PairFigures(stamp_ns, (50, 100), tuple(values), tuple(values), tuple(values), verged, disparity_px, 0.1, None)
    write_figures(path, [one])
    (again,) = read_figures(path)
    assert repr(again) == repr(one)  # NaN is no number that equals itself


def test_pairs_without_a_figure_count_for_nothing() -> None:
    before = [PairFigures(i, (50,), (2.0,), (4.0,), (0.5,), False, 3.0, 0.1, True) for i in range(4)]
    after = [replace(one, left_to_right_px=(math.nan if one.stamp_ns else 1.0,), verged=True) for one in before]
    rows = {row.name: row for row in changes(before, after)}
    there = rows["50 px, left to right"]
    assert (there.before, there.after, there.pairs) == (2.0, 1.0, 1)
    assert (rows["verged"].before, rows["verged"].after) == (0.0, 1.0)
    assert changed_verdicts(before, after) == [0, 1, 2, 3]
    with pytest.raises(BagError, match="pairs in common"):
        changes(before, [replace(one, stamp_ns=one.stamp_ns + 100) for one in after])


def test_what_is_no_recording_is_refused(tmp_path: Path, recording: Path) -> None:
    with pytest.raises(BagError, match="does not exist"):
        HeadBag(tmp_path / "none")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match="cannot be read"):
        HeadBag(tmp_path / "empty")
    with pytest.raises(BagError, match="must not exist"):
        BagWriter(recording)
    with pytest.raises(BagError, match="must have the pictures of one head"):
        HeadBag(recording, namespace="other")
    with BagWriter(tmp_path / "joints") as writer:
        writer.add("/joint_states", TOPICS["joint_states"])
    with pytest.raises(BagError, match="must have the pictures of one head"):
        HeadBag(tmp_path / "joints")
    (tmp_path / "figures").write_text("no JSON\n")
    with pytest.raises(BagError, match="vergence replay --out"):
        read_figures(tmp_path / "figures")


def test_of_two_heads_in_one_bag_the_namespace_chooses(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "two") as writer:
        for head in ("/a", "/b"):
            for side in ("left", "right"):
                topic = f"{head}/{side}/image_raw/compressed"
                writer.add(topic, TOPICS["left/image_raw/compressed"])
    with pytest.raises(BagError, match="namespace of one of its heads"):
        HeadBag(tmp_path / "two")
    with HeadBag(tmp_path / "two", "b") as bag:
        assert set(bag.counts) == {"left/image_raw/compressed", "right/image_raw/compressed"}


def test_damaged_pictures_and_joints_are_left_out(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bad") as writer:
        types = writer.types()
        stamp = types["builtin_interfaces/msg/Time"](1, 0)
        header = types["std_msgs/msg/Header"](stamp, "")
        for side in ("left", "right"):
            writer.add(f"/{side}/image_raw/compressed", TOPICS["left/image_raw/compressed"])
            image = types["sensor_msgs/msg/CompressedImage"](header, "jpeg", np.frombuffer(b"no JPEG", np.uint8))
            writer.write(f"/{side}/image_raw/compressed", 1_000_000_000, image)
        writer.add("/joint_states", TOPICS["joint_states"])
        none = np.empty(0)
        state = types["sensor_msgs/msg/JointState"](header, ["tilt"], np.array([0.1]), none, none)
        writer.write("/joint_states", 1_000_000_000, state)
    with HeadBag(tmp_path / "bad") as bag:
        assert list(bag.events()) == []


def test_latched_topics_are_topics() -> None:
    assert set(TOPICS) >= LATCHED
