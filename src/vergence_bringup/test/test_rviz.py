"""The RViz configurations show what the graph publishes, in frames that the URDF has."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml

from vergence_gaze.joints.frames import FRAMES
from vergence_rig.head_urdf import head_urdf
from vergence_rig.rig import default_rig

CONFIG = Path(__file__).resolve().parent.parent / "config"


@pytest.fixture(scope="module", params=["head.rviz", "graph.rviz"])
def shown(request):
    return yaml.safe_load((CONFIG / request.param).read_text(encoding="utf-8"))["Visualization Manager"]


@pytest.fixture(scope="module")
def links():
    return {link.attrib["name"] for link in ElementTree.fromstring(head_urdf(default_rig())).iter("link")}


def displays(shown, kind):
    return [one for one in shown["Displays"] if one["Class"] == f"rviz_default_plugins/{kind}"]


def test_it_shows_head_rays_fixation_point_and_both_images(shown):
    (head,), (rays,), (point, *_) = (displays(shown, kind) for kind in ("RobotModel", "MarkerArray", "PointStamped"))
    assert head["Description Topic"]["Value"] == "/robot_description"
    assert rays["Topic"]["Value"] == "/gaze/markers"
    assert point["Topic"]["Value"] == "/gaze/fixation_point"
    assert [one["Topic"]["Value"] for one in displays(shown, "Image")[:2]] == ["/left/image_raw", "/right/image_raw"]


def test_its_frames_and_those_of_requests_are_links_of_the_head(shown, links):
    (frames,) = displays(shown, "TF")
    named = {name for name in frames["Frames"] if name != "All Enabled"}
    named |= {shown["Global Options"]["Fixed Frame"], shown["Views"]["Current"]["Target Frame"]}
    assert named <= links
    assert set(FRAMES) <= links


def test_the_graph_s_has_both_overlays_and_the_targets_too():
    shown = yaml.safe_load((CONFIG / "graph.rviz").read_text(encoding="utf-8"))["Visualization Manager"]
    topics = {one["Topic"]["Value"] for kind in ("Image", "PointStamped") for one in displays(shown, kind)}
    assert {"/vergence/overlay", "/vergence/box_overlay", "/vergence/target_point", "/gaze/target"} <= topics
