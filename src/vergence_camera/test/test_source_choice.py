"""What a text chooses, and the parameters around it."""

from pathlib import Path

import pytest
import yaml

from vergence_camera.devices import SystemTree
from vergence_camera.errors import ChoiceError, FileMissingError
from vergence_camera.parameters import CameraParameters
from vergence_camera.source_choice import Kind, SourceOptions, kind_of, make_source
from vergence_camera.sources.decoded_stream import DecodedStreamSource
from vergence_camera.sources.http_mjpeg import HttpMjpegSource
from vergence_camera.sources.replay import Replay
from vergence_camera.v4l2.capture import V4l2Source
from vergence_rig.parameters import ParameterError

YAML = Path(__file__).resolve().parents[3] / "config" / "camera_node.yaml"


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("/dev/video0", Kind.DEVICE),
        ("/dev/v4l/by-id/usb-046d_C525-video-index0", Kind.DEVICE),
        ("usb-046d_C525-video-index0", Kind.DEVICE),
        ("0", Kind.DEVICE),
        ("serial:123456789", Kind.DEVICE),
        ("200901010001", Kind.DEVICE),
        ("HD Webcam C525", Kind.DEVICE),
        ("clip.avi", Kind.RECORDING),
        ("recordings/left", Kind.RECORDING),
        ("file:///data/clip.mp4", Kind.RECORDING),
        ("http://10.0.0.5:8080/?action=stream", Kind.HTTP_JPEG),
        ("https://user:secret@host/video.mjpg", Kind.HTTP_JPEG),
        ("http://host/clip.mp4", Kind.DECODED_STREAM),
        ("rtsp://host:554/stream1", Kind.DECODED_STREAM),
    ],
)
def test_kinds(text: str, kind: Kind) -> None:
    assert kind_of(text) is kind


@pytest.mark.parametrize("text", ["", "   ", "ftp://host/clip.avi", "htp://host/"])
def test_texts_that_name_nothing(text: str) -> None:
    with pytest.raises(ChoiceError, match="device must be"):
        kind_of(text)


def test_sources(mjpeg_avi: Path, tmp_path: Path) -> None:
    options = SourceOptions()
    assert isinstance(make_source(str(mjpeg_avi), options), Replay)
    assert isinstance(make_source(mjpeg_avi.as_uri(), options), Replay)
    assert isinstance(make_source("http://host/", options), HttpMjpegSource)
    assert isinstance(make_source("rtsp://host/", options), DecodedStreamSource)
    tree = SystemTree(tmp_path, tmp_path)
    assert isinstance(make_source("0", options, tree=tree), V4l2Source)
    with pytest.raises(FileMissingError):
        make_source("/none/clip.avi", options)


def test_passwords_are_not_shown() -> None:
    for url in ("rtsp://user:secret@host/x", "http://user:secret@host/x"):
        assert make_source(url, SourceOptions()).identity == url.replace("user:secret@", "")


def test_the_yaml_shows_the_defaults() -> None:
    shown = yaml.safe_load(YAML.read_text())["/**"]["ros__parameters"]
    defaults = {spec.name: spec.default for spec in CameraParameters.specs() if not spec.required}
    assert shown == defaults
    assert "# device:" in YAML.read_text()


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"device": ""}, "got ''"),
        ({"device": "ftp://x"}, "got 'ftp://x'"),
        ({"pixel_format": "H264"}, "one of 'MJPG'"),
        ({"width_px": -1}, "from 0 to 8192"),
        ({"first_retry_s": 9.0}, "at least first_retry_s"),
        ({"lock": "follow"}, "partner"),
        ({"lock": "yes"}, "'off', 'hold', 'follow'"),
        ({"max_age_s": 0.0}, "from 0.001"),
    ],
)
def test_wrong_parameters_are_named(changes: dict[str, object], text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        CameraParameters.from_mapping({"device": "0", **changes})
    assert text in str(caught.value)


def test_a_camera_must_be_given() -> None:
    with pytest.raises(ParameterError, match="device"):
        CameraParameters.from_mapping({})
