"""Write docs/parameters.md from the parameter classes of every executable; a test holds the page equal to them."""

from pathlib import Path

from vergence_bringup.node_table import NODES, parameter_groups
from vergence_rig.parameters import ParameterSpec

PAGE = Path(__file__).resolve().parent.parent / "docs" / "parameters.md"

_HEAD = """# Parameters

Every executable's parameters, made from the code by `python tools/write_parameter_reference.py`. The shipped
`config/<executable>.yaml` holds the same defaults. *fixed* ones are read once at the start; the others may be changed
while the node runs, and a request is applied as a whole or not at all. A former name ends the node with a message that
names the new one.
"""


def page() -> str:
    """Return the page's text."""
    parts = [_HEAD]
    for executable, entry in NODES.items():
        parts.append(f"## {entry.package} {executable}\n")
        parts.append("| parameter | default | allowed | what |\n|---|---|---|---|")
        for prefix, group in parameter_groups(executable):
            parts += [_row(prefix, spec) for spec in group.specs()]
        parts.append("")
    return "\n".join(parts)


def _row(prefix: str, spec: ParameterSpec) -> str:
    default = "**required**" if spec.required else f"`{_yaml(spec.default)}`"
    fixed = " *fixed*" if spec.read_only else ""
    former = f"; formerly `{spec.formerly}`" if spec.formerly else ""
    cells = (f"`{prefix}{spec.name}`", default, spec.allowed, spec.description + fixed + former)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _yaml(value: object) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_yaml(element) for element in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else f"{value!r}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
