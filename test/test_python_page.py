"""docs/python.md: its first program runs and prints what the page says, on the simulated head."""

import contextlib
import io
import re
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "python.md"


def test_the_ten_lines_verge_a_simulated_head() -> None:
    blocks = re.findall(r"```(\w*)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (_, program), (_, promised) = blocks[:2]
    assert len(program.strip().splitlines()) <= 10
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(program, str(PAGE), "exec"), {})
    # Renderers differ in the last digits.
    without = [re.sub(r"[+-]?\d+\.\d+", "N", text).strip() for text in (printed.getvalue(), promised)]
    assert without[0] == without[1]
    after = float(re.findall(r"disparity ([+-]\d+\.\d+)", printed.getvalue())[-1])
    assert abs(after) < 2.0
