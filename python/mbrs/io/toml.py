"""Models as TOML files: what a user would type, one table for each object, expressions as strings."""

from __future__ import annotations

import inspect
import json
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from ..attached_laws import SavedLaw
from ..errors import DuplicateNameError, InertiaError, MbrsError, ModelError, NameNotFoundError
from ..expressions import Expression
from ..files import write_atomic
from ..joints import KINDS
from ..model import Model
from ..motions import TYPES, resolve
from ..names import nearest, problem, shown
from ..values import shape_of
from .describe import describe
from .grammar import GrammarError, parse
from .locate import Places

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_WIDTH = 100
# Keys whose strings are text; in all others a string is an expression.
_TEXT = frozenset({"name", "type", "a", "b", "body", "frame", "joint", "first", "second", "nodes"})
_TEXT |= {"coordinate", "first_coordinate", "second_coordinate", "on"}
_AXIS_WORD = re.compile(r"[+-]?[xyz]")
_TYPES = {
    "joint": tuple(KINDS),
    "element": ("spring_damper", "bushing", "torsion"),
    "load": ("force", "torque", "modal_force"),
}
_TABLES = ("body", "joint", "drive", "coupler", "element", "load", "marker")


def save(model: Model, path: str | Path) -> Path:
    """Write the model; returns the path."""
    return write_atomic(path, dumps(model).encode())


def load(path: str | Path) -> Model:
    """Read a model. A `ModelError` (or the subclass that the mistake has) says file, line and column."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as reason:
        raise ModelError(f"cannot read {path}: {reason.strerror or reason}") from None
    except UnicodeDecodeError as reason:
        raise ModelError(f"{path} is not UTF-8 text (byte {reason.start}); a model is saved by m.save(path)") from None
    return loads(text, str(path))


def dumps(model: Model) -> str:
    """The TOML text of a model."""
    lines: list[str] = []
    for heading, table in describe(model):
        lines += ["", heading] if lines else [heading]
        lines += [f"{_key(key)} = {_value(value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _string(key)


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value: Any) -> str:
    if isinstance(value, Expression):
        return _string(str(value))
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    parts = [_value(v) for v in value]
    line = "[" + ", ".join(parts) + "]"
    if len(line) <= _WIDTH or not any(isinstance(v, (list, tuple, Mapping)) for v in value):
        return line
    return "[\n    " + ",\n    ".join(parts) + ",\n]"


def loads(text: str, source: str = "<text>") -> Model:
    """A model from TOML text; ``source`` heads the messages of errors."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as reason:
        raise ModelError(f"{source}: {_lower(str(reason))}") from None
    except RecursionError:
        raise ModelError(f"{source}: arrays or tables are nested too deeply to be read") from None
    return _Reader(data, text, source).model()


def _lower(message: str) -> str:
    """tomllib's message with its "(at line 3, column 7)" as the other errors say it."""
    found = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)", message)
    if found is None:
        return message
    place = f"line {found.group(1)}, column {found.group(2)}" if found.group(1) else "end of the file"
    return f"{place}: {message[: found.start()]}"


class _Reader:
    def __init__(self, data: dict[str, Any], text: str, source: str) -> None:
        self.data, self.text, self.source = data, text, source

    @cached_property
    def places(self) -> Places:
        """Found only when there is a mistake to report."""
        return Places(self.text)

    def model(self) -> Model:
        self._known("", 0, self.data, ("model", "parameters", *_TABLES))
        head = self._table("model")
        self._known("model", 0, head, ("name", "gravity"))
        model = self._guarded("model", 0, lambda: Model(head.get("name", "model")))
        parameters = self._table("parameters")
        for name, value in parameters.items():
            self._guarded("parameters", 0, lambda n=name, v=value: model.parameter(n, v), name)  # type: ignore[misc]
        if "gravity" in head:
            value = self._decoded(model, "model", 0, "gravity", head["gravity"])
            self._guarded("model", 0, lambda: setattr(model, "gravity", value), "gravity")
        for kind in _TABLES:
            entries = self.data.get(kind, [])
            if not isinstance(entries, list) or any(not isinstance(e, dict) for e in entries):
                raise self._at(kind, 0, "", ModelError(f"write [[{kind}]] with two brackets: there may be several"))
            for number, entry in enumerate(entries):
                self._add(model, kind, number, entry)
        return model

    def _table(self, name: str) -> dict[str, Any]:
        table = self.data.get(name, {})
        if not isinstance(table, dict):
            raise self._at(name, 0, "", ModelError(f"{name} must be a table [{name}]"))
        return table

    def _add(self, model: Model, kind: str, number: int, entry: dict[str, Any]) -> None:
        given = dict(entry)
        method = kind
        if kind in _TYPES:
            method = given.pop("type", None)
            if method not in _TYPES[kind]:
                guess = nearest(method, _TYPES[kind]) if isinstance(method, str) else None
                hint = f"did you mean {guess!r}?" if guess else "known: " + ", ".join(_TYPES[kind])
                raise self._at(
                    kind, number, "type", NameNotFoundError(f"no type of {kind} is called {method!r}; {hint}")
                )
        if kind == "body" and "modal_body" in given:
            method = "flexible_body"
        function = getattr(model, method)
        known, required = _arguments(method)
        self._known(kind, number, given, known)
        missing = [n for n in required if n not in given]
        if missing:
            raise self._at(kind, number, "", ModelError(f"{kind} {given.get('name', '')!r} lacks {', '.join(missing)}"))
        made = {key: self._decoded(model, kind, number, key, value) for key, value in given.items()}
        self._guarded(kind, number, lambda: function(**made))

    def _known(self, table: str, number: int, given: Mapping[str, Any], known: Sequence[str]) -> None:
        for key in given:
            if key not in known:
                guess = nearest(key, known)
                hint = f"did you mean {guess!r}?" if guess else "known: " + ", ".join(known)
                where = f"[{table}]" if table else "a model file"
                key_table = (key, 0, "") if not table else (table, number, key)
                raise self._at(*key_table, NameNotFoundError(f"{where} has no entry {key!r}; {hint}"))

    def _decoded(self, model: Model, table: str, number: int, key: str, value: Any) -> Any:
        if key in _TEXT or (key in ("axis", "axis2") and isinstance(value, str) and _AXIS_WORD.fullmatch(value)):
            return value
        if key == "modal_body":
            return self._guarded(table, number, lambda: _modal_body(value), key)
        if key == "motion" or (table == "load" and key == "value"):
            return self._guarded(table, number, lambda: _motions(model, value), key)
        if key == "law":
            return self._guarded(table, number, lambda: _laws(model, value), key)
        return self._guarded(table, number, lambda: _numbers(model, value), key)

    def _guarded(self, table: str, number: int, action: Callable[[], Any], key: str = "") -> Any:
        try:
            return action()
        except MbrsError as reason:
            field = key or _field_of(reason)
            raise self._at(table, number, field, reason) from None

    def _at(self, table: str, number: int, key: str, reason: MbrsError) -> MbrsError:
        line, column = self.places.of(table, number, key)
        kinds = (DuplicateNameError, InertiaError, NameNotFoundError)
        kind = next((k for k in kinds if isinstance(reason, k)), ModelError)
        return kind(f"{self.source}: line {line}, column {column}: {reason}")


@lru_cache
def _arguments(method: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of all arguments of a method of the model, and of those that must be given."""
    signature = inspect.signature(getattr(Model, method)).parameters
    known = tuple(name for name in signature if name != "self")
    return known, tuple(name for name in known if signature[name].default is inspect.Parameter.empty)


def _field_of(reason: MbrsError) -> str:
    address = getattr(reason, "address", "")
    field = address.rpartition(".")[2] if "." in address else ""
    return field.removesuffix("_a").removesuffix("_b") if field.startswith("at_") else field


def _numbers(model: Model, value: Any) -> Any:
    """Strings become expressions, everything else stays."""
    if isinstance(value, str):
        return parse(value, model.space)
    if isinstance(value, list):
        return [_numbers(model, v) for v in value]
    return value


def _motions(model: Model, value: Any) -> Any:
    """Motions {type, numbers}, functions "module:name", numbers and expressions."""
    if isinstance(value, list):
        return [_motions(model, v) for v in value]
    if isinstance(value, str) and ":" in value:
        return resolve(value)
    if not isinstance(value, dict):
        return _numbers(model, value)
    given = dict(value)
    name = given.pop("type", None)
    if name not in TYPES:
        raise problem("motion", f"has no type {name!r}; known: {', '.join(TYPES)}", NameNotFoundError)
    kind = given.pop("kind", None)
    made = {k: _numbers(model, v) for k, v in given.items()}
    try:
        return TYPES[name](**made, **({} if kind is None else {"kind": kind}))
    except TypeError:
        raise problem("motion", f"of type {name} cannot have the entries {', '.join(value)}") from None


def _modal_body(value: Any) -> Any:
    """The integrals of a flexible body, a table of numbers and lists."""
    from ..flexible import ModalBody

    if not isinstance(value, dict):
        raise problem("modal_body", f"must be a table of the arguments of mb.flexible.ModalBody, got {shown(value)}")
    try:
        return ModalBody(**value)
    except TypeError:
        raise problem("modal_body", f"cannot be made of the entries {', '.join(value)}") from None


def _laws(model: Model, value: Any) -> Any:
    if isinstance(value, dict) and "code" in value:
        values = _numbers(model, value.get("values", []))
        if len(shape_of(values)) > 1 or not isinstance(values, list):
            raise problem("law", f"has values that are no list of numbers: {values!r}")
        return SavedLaw(str(value.get("type", "law")), value["code"], values)
    if isinstance(value, dict):
        return {name: _laws(model, law) for name, law in value.items()}
    if isinstance(value, list):
        return [_laws(model, law) for law in value]
    raise problem("law", f"must be a table {{ type, code, values }}, got {value!r}")


__all__ = ["GrammarError", "dumps", "load", "loads", "save"]
