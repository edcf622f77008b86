"""Annotations of whatever users call: functions, constructors, methods and properties of the public names."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from types import FunctionType, ModuleType
from typing import get_overloads

import mbrs as mb
from mbrs._lib.names import PUBLIC
from mbrs.results import Result


def public() -> Iterator[object]:
    """Public functions and classes, those of the public modules included."""
    yield from (getattr(mb, name) for name in PUBLIC)
    for name in (*mb._MODULES, "design"):
        module = getattr(mb, name)
        if isinstance(module, ModuleType) and name not in ("reference", "view", "report"):
            for one in getattr(module, "__all__", [n for n in dir(module) if not n.startswith("_")]):
                yield getattr(module, one)


def functions() -> Iterator[FunctionType]:
    """Every function behind a public name once; of one with overloads, these."""
    seen: set[object] = set()
    for thing in public():
        if not (getattr(thing, "__module__", None) or "").startswith("mbrs."):
            continue
        for one in _members(thing) if inspect.isclass(thing) else [thing]:
            if isinstance(one, FunctionType) and one not in seen and one.__name__ != "<lambda>":
                seen.add(one)
                yield from get_overloads(one) or [one]


def _members(cls: type) -> Iterator[object]:
    """Methods and properties that a class has of its own; the constructors of results are the package's."""
    for name, member in vars(cls).items():
        if name.startswith("_") and (name != "__init__" or issubclass(cls, Result)):
            continue
        if isinstance(member, property):
            yield member.fget
        else:
            yield getattr(member, "__func__", member)


def untyped(function: FunctionType) -> Iterator[str]:
    """Arguments, and the result, that are not annotated, or by `Any` alone or beside other types."""
    signature = inspect.signature(function)
    named = [(p.name, p.annotation) for p in signature.parameters.values() if p.name not in ("self", "cls")]
    if function.__name__ != "__init__":
        named.append(("return", signature.return_annotation))
    for name, annotation in named:
        if annotation is inspect.Signature.empty or "Any" in alternatives(annotation):
            yield name


def alternatives(annotation: object) -> list[str]:
    """The types of a union."""
    if not isinstance(annotation, str):
        return [getattr(annotation, "__name__", str(annotation))]
    node = ast.parse(annotation, mode="eval").body
    parts = []
    while isinstance(node, ast.BinOp):
        parts.append(ast.unparse(node.right))
        node = node.left
    return [*parts, ast.unparse(node)]
