"""The public names for type checkers (python/mbrs/__init__.pyi) and for readers (docs/api.md).

``python tests/public_names.py`` writes both.
"""

from __future__ import annotations

import inspect
from pathlib import Path

import mbrs
from mbrs._lib.names import PUBLIC

PACKAGE = Path(mbrs.__file__).parent
STUB, PAGE = PACKAGE / "__init__.pyi", PACKAGE.parents[1] / "docs" / "api.md"
TITLES = {
    "errors": "Errors and warnings",
    "results": "Every result",
    "model": "Models",
    "system": "Compiled models",
    "linear": "Linear analyses",
    "aero": "Blades in the wind",
    "motion": "Motion in time",
    "nonlinear": "Nonlinear vibration",
    "gradients": "Gradients of motions",
    "design": "Design",
    "studies": "Studies",
    "solvers": "Solvers",
    "io": "Files",
}


def stub() -> str:
    """Every name imported from its module."""
    lines = ['"""The public names for type checkers; written by tests/public_names.py."""', ""]
    homes: dict[str, list[str]] = {}
    for name, home in PUBLIC.items():
        homes.setdefault(home, []).append(name)
    for name, home in mbrs._MODULES.items():
        folder, _, leaf = home.rpartition(".")
        lines.append(f"from .{folder} import {leaf} as {name}")
    for home, names in homes.items():
        lines += [f"from .{home} import {name} as {name}" for name in names]
    return "\n".join([*lines[:2], *sorted(lines[2:]), "", "__all__: list[str]", ""])


def page() -> str:
    """Names with the first sentence of their docstrings."""
    lines = ["# Public names", "", "`import mbrs as mb`; each name is imported when it is first used.", ""]
    for folder, title in TITLES.items():
        named = sorted((n for n, home in PUBLIC.items() if home.split(".")[0] == folder), key=str.casefold)
        lines += [f"## {title}", "", "| name | |", "|---|---|"]
        lines += [f"| `mb.{name}` | {_sentence(getattr(mbrs, name))} |" for name in named]
        lines.append("")
    modules = ", ".join(f"`mb.{name}`" for name in sorted(mbrs._MODULES))
    return "\n".join([*lines, f"Modules: {modules}.", ""])


def _sentence(thing: object) -> str:
    """The first paragraph of a docstring on one line, up to its first full stop."""
    text = " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())
    return text.split(". ")[0].rstrip(".").replace("|", "\\|")


if __name__ == "__main__":
    STUB.write_text(stub(), encoding="utf-8")
    PAGE.write_text(page(), encoding="utf-8")
