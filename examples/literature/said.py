"""Tables and figures that the scripts of this folder share: what a text says beside what mbrs computes."""

from __future__ import annotations

import sys
import tempfile
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any


def told(rows: Iterable[tuple[str, str, str, str]]) -> None:
    """Print rows of (item, the text says, ours, why not comparable; empty where it is)."""
    for item, *parts in rows:
        print(item)
        for name, part in zip(("the text says", "ours", "not comparable"), parts, strict=True):
            if part:
                print(textwrap.fill(part, 96, initial_indent=f"  {name:16}", subsequent_indent=" " * 18))


def folder() -> Path:
    """The folder for pictures: the first argument of a script, else a new folder."""
    return Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))


def save(figure: Any, where: Path | str, name: str) -> None:
    """Write a figure and tell its name."""
    path = Path(where) / name
    figure.savefig(path, dpi=110, bbox_inches="tight")
    print(f"picture: {path.name}")
