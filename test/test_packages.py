"""Each package can be released alone: it is whole, names what it imports, and colcon runs its tests."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted((ROOT / "src").glob("vergence*"))
PYTHON_PACKAGES = [path for path in PACKAGES if (path / "setup.py").is_file()]
ROSDEP_KEYS = {
    "aiohttp": "python3-aiohttp",
    "cv2": "python3-opencv",
    "hypothesis": "python3-hypothesis",
    "numpy": "python3-numpy",
    "pytest": "python3-pytest",
    "yaml": "python3-yaml",
}
NOT_IN_APT = {"OpenGL", "mujoco", "onnx", "onnxruntime", "rosbags"}
"""pip packages: rosdep's keys of these fail where pip refuses to install into the system (PEP 668), so no package names
them; the nodes that need one say how to install it."""
OF_ONE_DRIVER = {"adafruit_pca9685", "board", "busio", "lgpio", "pigpio"}
"""Imported only where the servos of that driver are."""
IF_INSTALLED = {"control_msgs", "skimage"}
"""Imported only where it is installed, and not needed."""
LAUNCHED = {path.name for path in PACKAGES} | {"robot_state_publisher"}
"""What vergence_bringup starts, whether it imports it or not."""

each_package = pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
each_python_package = pytest.mark.parametrize("package", PYTHON_PACKAGES, ids=lambda path: path.name)


def python_files(*folders: Path) -> list[Path]:
    return [path for folder in folders for path in sorted(folder.rglob("*.py"))]


def imports(files: list[Path]) -> Iterator[str]:
    """Yield the top-level modules that files import, the standard library's left out."""
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names = [node.module]
            yield from {name.split(".")[0] for name in names} - sys.stdlib_module_names


def needs(files: list[Path], package: str) -> set[str]:
    modules = set(imports(files)) - {package} - NOT_IN_APT - OF_ONE_DRIVER - IF_INSTALLED
    return {ROSDEP_KEYS.get(module, module) for module in modules}


def manifest(package: Path) -> ElementTree.Element:
    return ElementTree.parse(package / "package.xml").getroot()


def declared(package: Path, *kinds: str) -> set[str]:
    return {element.text or "" for kind in kinds for element in manifest(package).findall(kind)}


def setup_arguments(package: Path) -> dict[str, ast.expr]:
    calls = [node for node in ast.walk(ast.parse((package / "setup.py").read_text())) if isinstance(node, ast.Call)]
    call = next(node for node in calls if isinstance(node.func, ast.Name) and node.func.id == "setup")
    return {keyword.arg or "": keyword.value for keyword in call.keywords}


@each_package
def test_no_link_leads_out_of_a_package(package: Path) -> None:
    links = [path for path in package.rglob("*") if path.is_symlink()]
    assert [str(link) for link in links if package not in link.resolve().parents] == []


@each_package
def test_licence_and_changelog(package: Path) -> None:
    assert (package / "LICENSE").read_text() == (ROOT / "LICENSE").read_text()
    reader = pytest.importorskip("catkin_pkg.changelog")
    text = (package / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert f"Changelog for package {package.name}\n" in text
    # What a release does to it: the next version's heading is its number and its date.
    released = text.replace("Forthcoming\n-----------", "9.9.9 (2026-01-01)\n------------------")
    changelog = reader.populate_changelog_from_rst(reader.Changelog(), released)
    assert changelog.get_content_of_version("9.9.9")


@each_package
def test_package_xml_is_valid(package: Path) -> None:
    warnings: list[str] = []
    described = pytest.importorskip("catkin_pkg.package").parse_package(str(package), warnings=warnings)
    described.validate(warnings=warnings)
    assert warnings == []
    assert described.name == package.name


@each_python_package
def test_setup_py_says_what_package_xml_says(package: Path) -> None:
    arguments = setup_arguments(package)
    said = {name: value.value for name, value in arguments.items() if isinstance(value, ast.Constant)}
    root = manifest(package)
    (maintainer,) = root.findall("maintainer")
    for name in ("name", "version", "description", "license"):
        assert said[name] == root.findtext(name)
    assert (said["maintainer"], said["maintainer_email"]) == (maintainer.text, maintainer.get("email"))
    assert {"LICENSE", "CHANGELOG.rst", "package.xml"} <= set(
        ast.literal_eval(ast.unparse(arguments["data_files"]).split(f"'share/{package.name}', ")[1].split(")")[0])
    )


@each_python_package
def test_colcon_runs_its_tests_with_pytest(package: Path) -> None:
    assert "pytest" in ast.literal_eval(setup_arguments(package)["extras_require"])["test"]
    assert {"python3-pytest", "python3-pytest-timeout"} <= declared(package, "test_depend")


@each_python_package
def test_package_xml_names_what_is_imported(package: Path) -> None:
    run = declared(package, "depend", "exec_depend")
    imported = needs(python_files(package / package.name, package / "launch"), package.name)
    assert imported - run == set()
    assert run - imported - (LAUNCHED if package.name == "vergence_bringup" else set()) == set()
    tested = needs(python_files(package / "test"), package.name)
    assert tested - run - declared(package, "test_depend") == set()


@each_package
def test_rosdep_needs_no_pip(package: Path) -> None:
    """A key that rosdep gives to pip fails on Ubuntu 24.04, and with it all of `rosdep install`."""
    kinds = ("depend", "build_depend", "buildtool_depend", "exec_depend", "test_depend", "build_export_depend")
    assert {key for key in declared(package, *kinds) if key.endswith("-pip")} == set()


@each_python_package
def test_every_folder_of_modules_is_installed(package: Path) -> None:
    folders = {path.parent for path in python_files(package / package.name)}
    assert [str(folder) for folder in folders if not (folder / "__init__.py").is_file()] == []
