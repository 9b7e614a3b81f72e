"""Parameters of web_node: where it listens, who may use it, and how much it sends."""

from dataclasses import dataclass

from vergence_rig.parameters import Groups, Parameters, parameter


@dataclass(frozen=True)
class WebNodeParameters(Parameters):
    """The page's address, its access, and its rates."""

    rig: str = parameter("", "path of rig.yaml; empty for the built-in rig", read_only=True)
    address: str = parameter(
        "127.0.0.1",
        "address to listen on: 127.0.0.1 for this machine alone, 0.0.0.0 for every network, or one of this machine's; "
        "other machines need a token",
        read_only=True,
    )
    port: int = parameter(
        8470, "port of the page; 0 for any free one, which the log names", minimum=0, maximum=65535, read_only=True
    )
    token_file: str = parameter(
        "",
        "path of a file with the token of the page, one line of at least 16 characters; empty: a new token at every "
        "start where other machines can reach the page, and none on 127.0.0.1",
        read_only=True,
    )
    image_transport: str = parameter(
        "auto",
        "`compressed` passes the JPEGs of image_raw/compressed on, `raw` encodes image_raw; auto: compressed where it "
        "has a publisher",
        choices=("auto", "compressed", "raw"),
        read_only=True,
    )
    image_rate_hz: float = parameter(
        15.0, "largest rate of both eyes' images sent to a page; others are left out", unit="Hz", minimum=1, maximum=60
    )
    state_rate_hz: float = parameter(
        10.0, "largest rate of states, measurements and chart samples sent to a page", unit="Hz", minimum=1, maximum=30
    )
    jpeg_quality: int = parameter(
        80, "quality of the JPEGs that are encoded here, from raw images and of the edges", minimum=10, maximum=100
    )
    max_viewers: int = parameter(8, "largest number of pages that are open at a time", minimum=1, maximum=100)
    requests_per_s: float = parameter(
        20.0, "largest rate of a page's requests; others are refused, except stop", unit="1/s", minimum=1, maximum=1000
    )


GROUPS: Groups = (("", WebNodeParameters),)
"""Every parameter group of web_node."""
