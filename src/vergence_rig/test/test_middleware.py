"""The middleware that is asked for is looked up before rcl ends the process for its absence."""

from pathlib import Path

import pytest

from vergence_rig.middleware import installed_middlewares, middleware_problem


@pytest.fixture
def prefix(tmp_path: Path) -> str:
    folder = tmp_path / "share" / "ament_index" / "resource_index" / "rmw_typesupport"
    folder.mkdir(parents=True)
    for name in ("rmw_fastrtps_cpp", "rmw_cyclonedds_cpp", "rmw_implementation"):
        (folder / name).touch()
    return f"/absent:{tmp_path}"


@pytest.mark.parametrize("wanted", ["", "rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"])
def test_what_is_installed_or_left_to_ros_is_no_problem(prefix: str, wanted: str) -> None:
    assert installed_middlewares({"AMENT_PREFIX_PATH": prefix}) == ("rmw_cyclonedds_cpp", "rmw_fastrtps_cpp")
    assert middleware_problem({"AMENT_PREFIX_PATH": prefix, "RMW_IMPLEMENTATION": wanted}) == ""


@pytest.mark.parametrize("wanted", ["rmw_nosuch", "rmw_implementation", "cyclonedds"])
def test_what_is_absent_is_named_with_what_is_there(prefix: str, wanted: str) -> None:
    problem = middleware_problem({"AMENT_PREFIX_PATH": prefix, "RMW_IMPLEMENTATION": wanted})
    assert f"installed (rmw_cyclonedds_cpp, rmw_fastrtps_cpp): got '{wanted}'" in problem


def test_without_an_index_nothing_is_said() -> None:
    assert middleware_problem({"RMW_IMPLEMENTATION": "rmw_nosuch"}) == ""
