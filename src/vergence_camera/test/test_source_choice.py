"""What a text chooses, and the parameters around it."""

from pathlib import Path

import pytest
import yaml

from vergence_camera import source_choice
from vergence_camera.devices import SystemTree
from vergence_camera.errors import ChoiceError, FileMissingError
from vergence_camera.frame import ModeRequest
from vergence_camera.parameters import GROUPS, CameraParameters, RetryParameters
from vergence_camera.source_choice import SourceOptions, check_choice, make_source, register_url_scheme
from vergence_camera.sources.decoded_stream import DecodedStreamSource
from vergence_camera.sources.http_mjpeg import HttpMjpegSource
from vergence_camera.sources.recordings import FolderRecording
from vergence_camera.sources.replay import Replay
from vergence_camera.v4l2.capture import V4l2Source
from vergence_rig.parameters import ParameterError

YAML = Path(__file__).resolve().parents[3] / "config" / "camera_node.yaml"


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("/dev/video0", V4l2Source),
        ("/dev/v4l/by-id/usb-046d_C525-video-index0", V4l2Source),
        ("usb-046d_C525-video-index0", V4l2Source),
        ("0", V4l2Source),
        ("serial:123456789", V4l2Source),
        ("200901010001", V4l2Source),
        ("HD Webcam C525", V4l2Source),
        ("clip.avi", Replay),
        ("recordings/left", Replay),
        ("file:///data/clip.mp4", Replay),
        ("http://10.0.0.5:8080/?action=stream", HttpMjpegSource),
        ("https://user:secret@host/video.mjpg", HttpMjpegSource),
        ("http://host/clip.mp4", DecodedStreamSource),
        ("rtsp://host:554/stream1", DecodedStreamSource),
    ],
)
def test_kinds(text: str, kind: type, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    opened: list[Path] = []

    def open_recording(path: Path) -> FolderRecording:
        opened.append(path)
        return FolderRecording(path)

    monkeypatch.setattr(source_choice, "open_recording", open_recording)
    assert isinstance(make_source(text, SourceOptions(), tree=SystemTree(tmp_path, tmp_path)), kind)
    assert bool(opened) is (kind is Replay)


def test_another_url_scheme_can_be_registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source_choice, "_URL_BUILDERS", dict(source_choice._URL_BUILDERS))
    with pytest.raises(ParameterError, match="'device' must be"):
        CameraParameters(device="mine://left")
    source = DecodedStreamSource("mine://left", ModeRequest(), open_timeout_s=1.0, stall_timeout_s=1.0)
    register_url_scheme("mine", lambda url, options: source)
    assert CameraParameters(device="mine://left").device == "mine://left"
    assert make_source("mine://left", SourceOptions()) is source
    with pytest.raises(ChoiceError, match=r"srt, mine\)"):
        check_choice("yours://left")
    with pytest.raises(ValueError, match="must be new"):
        register_url_scheme("rtsp", lambda url, options: source)


@pytest.mark.parametrize("text", ["", "   ", "ftp://host/clip.avi", "htp://host/"])
def test_texts_that_name_nothing(text: str) -> None:
    with pytest.raises(ChoiceError, match="device must be"):
        check_choice(text)


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
    groups = {
        prefix: {spec.name: spec.default for spec in group.specs() if not spec.required} for prefix, group in GROUPS
    }
    defaults = groups.pop("") | {prefix.rstrip("."): values for prefix, values in groups.items()}
    assert shown == defaults
    assert "# device:" in YAML.read_text()


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"device": ""}, "got ''"),
        ({"device": "ftp://x"}, "got 'ftp://x'"),
        ({"pixel_format": "H264"}, "one of 'MJPG'"),
        ({"width_px": -1}, "from 0 to 8192"),
        ({"lock": "follow"}, "partner"),
        ({"lock": "yes"}, "'off', 'hold', 'follow'"),
        ({"max_age_s": 0.0}, "from 0.001"),
    ],
)
def test_wrong_parameters_are_named(changes: dict[str, object], text: str) -> None:
    with pytest.raises(ParameterError) as caught:
        CameraParameters.from_mapping({"device": "0", **changes})
    assert text in str(caught.value)


def test_the_longest_wait_is_no_shorter_than_the_first() -> None:
    with pytest.raises(ParameterError, match="at least first_s"):
        RetryParameters(first_s=9.0)


def test_a_camera_must_be_given() -> None:
    with pytest.raises(ParameterError, match="device"):
        CameraParameters.from_mapping({})
