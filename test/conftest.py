"""What graph and system tests share."""

from collections.abc import Iterator

import pytest

from vergence_common.domains import own_domain
from vergence_sim.renderer import RenderError
from vergence_sim.simulator import Simulator


@pytest.fixture(scope="session")
def opengl() -> None:
    """Skip where the simulator cannot render: no OpenGL library, no software one either."""
    try:
        Simulator().close()
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")


@pytest.fixture
def domain_id(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A DDS domain for this test alone, whatever else runs on this machine; child processes inherit it."""
    with own_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield domain
