"""Set-up in a folder whose path cannot work is refused at once, before anything is made."""

import shutil
import subprocess
from pathlib import Path

import pytest

BOOTSTRAP = Path(__file__).resolve().parents[1] / "tools" / "bootstrap.sh"


@pytest.mark.parametrize("name", ["with space", "größe", "日本", "a:b", "a'b", "a$b", "line\nbreak"])
def test_a_path_that_cannot_work_is_refused_at_once(name: str, tmp_path: Path) -> None:
    tools = tmp_path / name / "tools"
    tools.mkdir(parents=True)
    shutil.copy(BOOTSTRAP, tools)
    result = subprocess.run(
        ["bash", str(tools / "bootstrap.sh"), "run"], capture_output=True, text=True, timeout=60, errors="replace"
    )
    assert result.returncode == 1
    assert "the path of this folder must have only ASCII letters" in result.stderr
    assert sorted(path.name for path in (tmp_path / name).iterdir()) == ["tools"]
