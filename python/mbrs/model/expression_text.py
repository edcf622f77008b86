"""Nodes of a program as text, in the grammar that reads back to the same graph."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from .operations import FUNCTIONS, OPS, Op


def node_text(node: tuple[Any, Any], written: Sequence[tuple[str, int]]) -> tuple[str, int]:
    """Text of one node, of which the children are written already, and how tightly its outermost operation binds."""
    name, arg = node
    if name is None:
        return number_text(arg), 3 if math.copysign(1.0, arg) < 0 else 6
    if isinstance(name, int):
        return symbol_text(arg), 6
    return _joined(OPS[name], [written[a] for a in arg])


def expression_texts(nodes: Sequence[tuple[Any, Any]], roots: Sequence[int]) -> tuple[list[str], list[str]]:
    """Lines "a0 = ..." for the operations that are used more than once, and the texts of the roots."""
    uses = [0] * len(nodes)
    for name, arg in nodes:
        for a in arg if isinstance(name, str) else ():
            uses[a] += 1
    lines: list[str] = []
    written: list[tuple[str, int]] = []
    for i, node in enumerate(nodes):
        made = node_text(node, written)
        if isinstance(node[0], str) and uses[i] > 1:
            lines.append(f"a{len(lines)} = {made[0]}")
            made = (f"a{len(lines) - 1}", 6)
        written.append(made)
    return lines, [written[root][0] for root in roots]


def _joined(op: Op, parts: list[tuple[str, int]]) -> tuple[str, int]:
    if not op.symbol:
        return f"{op.name}({', '.join(text for text, _ in parts)})", 6
    if len(parts) == 1:
        text, level = parts[0]
        # Python reads -2 as a negative number, so the minus of a number keeps its own parentheses.
        return f"-{text}" if level >= 4 and not text[0].isdigit() else f"-({text})", op.precedence
    (left, level_left), (right, level_right) = parts
    # Equal precedence: all operators but ** group to the left.
    strict_left = op.name == "power"
    if level_left < op.precedence + strict_left:
        left = f"({left})"
    if level_right < op.precedence + (not strict_left):
        right = f"({right})"
    gap = " " if op.precedence == 1 else ""
    return f"{left}{gap}{op.symbol}{gap}{right}", op.precedence


def number_text(value: float) -> str:
    """The shortest text that reads back to the same double."""
    text = repr(float(value))
    return text[:-2] if text.endswith(".0") and text != "-0.0" else text


def symbol_text(label: str) -> str:
    """A parameter's label as text of an expression: quoted if it is not a plain identifier."""
    name, bracket, index = label.partition("[")
    plain = name.isascii() and name.isidentifier() and name not in FUNCTIONS and not _is_keyword(name)
    return (name if plain else repr(name)) + bracket + index


def _is_keyword(name: str) -> bool:
    import keyword

    return keyword.iskeyword(name)
