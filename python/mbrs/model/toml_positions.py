"""Line and column of a table or key in a TOML text, for error messages."""

from __future__ import annotations

import re

_HEADER = re.compile(r"\s*\[\[?\s*([^\]]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"\s*((?:[A-Za-z0-9_-]+|\"(?:[^\"\\]|\\.)*\"|'[^']*'))\s*=")


class Places:
    """Lines and columns (from 1) of the tables and keys of a file, found without a full parse."""

    def __init__(self, text: str) -> None:
        self._found: dict[tuple[str, int, str], tuple[int, int]] = {}
        table, count = "", {"": 0}
        depth = 0
        for number, line in enumerate(text.splitlines(), 1):
            if depth == 0:
                header = _HEADER.match(line)
                if header and "=" not in header.group(1):
                    table = header.group(1).strip("\"'")
                    count[table] = count.get(table, -1) + 1
                    self._found[table, count[table], ""] = (number, 1 + len(line) - len(line.lstrip()))
                    continue
                key = _KEY.match(line)
                if key:
                    name = key.group(1)
                    name = name[1:-1] if name[0] in "\"'" else name
                    self._found[table, count[table], name] = (number, 1 + key.start(1))
            depth += _opened(line)

    def of(self, table: str, number: int, key: str = "") -> tuple[int, int]:
        """(line, column) of a key, else of its table, else of the file's start."""
        return self._found.get((table, number, key)) or self._found.get((table, number, "")) or (1, 1)


def _opened(line: str) -> int:
    """Brackets left open by a line, those in strings and comments not counted."""
    bare = re.sub(r"\"(?:[^\"\\]|\\.)*\"|'[^']*'", "", line).partition("#")[0]
    return bare.count("[") - bare.count("]")
