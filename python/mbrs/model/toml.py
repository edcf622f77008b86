"""Models as TOML files: what a user would type, one table for each object, expressions as strings. A file is data: reading it
imports nothing and calls nothing unless `functions` are asked for.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.files import write_atomic
from ..errors import DuplicateNameError, InertiaError, MbrsError, ModelError, NameNotFoundError
from .air_schema import HEADINGS
from .book import Book
from .describe import describe
from .expressions import Expression
from .grammar import GrammarError, parse
from .law_items import SavedCall, SavedFunction, SavedLaw
from .motions import TYPES, FunctionName, UserFunction, resolve
from .names import nearest, problem, shown
from .numbers import shape_of
from .schema import DRAWING_TOLERANCE, Kind
from .shapes import shape_of_table
from .toml_positions import Places
from .units import is_quantity

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_WIDTH = 100
_AXIS_WORD = re.compile(r"[+-]?[xyz]")
# Headings whose objects have types.
_TYPED = ("joint", "element", "load")
# Python reads no integer of more digits, since that takes a time of their square.
_DIGITS = re.compile(r"[0-9][0-9_]{4300,}")
_LONGEST = 500  # characters of a message
_REPEATED = 80  # characters of one text of the file in a message


def save(book: Book, path: str | Path) -> Path:
    """Write the model whole or not at all; returns the path."""
    return write_atomic(path, dumps(book).encode())


def load(path: str | Path, new: Callable[[str], Any], functions: bool = False) -> Any:
    """Read a model, which ``new(name)`` makes. A `ModelError` (or the subclass that the mistake has) gives file, line and column."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as reason:
        raise ModelError(f"cannot read {path}: {reason.strerror or reason}") from None
    except UnicodeDecodeError as reason:
        raise ModelError(f"{path} is not UTF-8 text (byte {reason.start}); a model is saved by m.save(path)") from None
    return loads(text, new, str(path), functions)


def dumps(book: Any) -> str:
    """The TOML text of a model."""
    head: dict[str, Any] = {"name": book.name}
    if book.gravity_item is not None:
        head["gravity"] = book.gravity_item.entries()
    if book.tolerance != DRAWING_TOLERANCE:  # the default; a file leaves it out
        head["tolerance"] = book.tolerance
    if book.units is not None:
        head["units"] = book.units
    lines: list[str] = []
    for heading, table in describe(book, head):
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
    if isinstance(value, UserFunction):
        return _string(value.name)
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


def loads(text: str, new: Callable[[str], Any], source: str = "<text>", functions: bool = False) -> Any:
    """A model from TOML text; ``source`` heads the messages of errors."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as reason:
        raise ModelError(_whole(source, _lower(str(reason)))) from None
    except RecursionError:
        raise ModelError(_whole(source, "arrays or tables are nested too deeply to be read")) from None
    except ValueError as reason:
        raise ModelError(_whole(source, _too_long(text) or str(reason))) from None
    return _Reader(data, text, source, functions).model(new)


def _too_long(text: str) -> str | None:
    """Message about an integer with too many digits, or None."""
    found = _DIGITS.search(text)
    if found is None:
        return None
    line, column = text.count("\n", 0, found.start()) + 1, found.start() - text.rfind("\n", 0, found.start())
    return (
        f"line {line}, column {column}: an integer of {len(found.group())} digits; write it as a number such as 1e300"
    )


def _whole(source: str, message: str) -> str:
    """A message of at most `_LONGEST` characters with the file before it."""
    name = source if len(source) <= 150 else "..." + source[-147:]
    room = _LONGEST - len(name) - 2
    if len(message) > room:
        half = (room - 5) // 2
        message = f"{message[:half]} ... {message[-half:]}"
    return f"{name}: {message}"


def _texts(data: Any) -> Iterator[str]:
    """All texts of a file, keys included."""
    stack = [data]
    while stack:
        one = stack.pop()
        if isinstance(one, str):
            yield one
        elif isinstance(one, dict):
            stack += [*one.keys(), *one.values()]
        elif isinstance(one, list):
            stack += one


def _lower(message: str) -> str:
    """tomllib's message with its "(at line 3, column 7)" as the other errors say it."""
    found = re.search(r" \(at (?:line (\d+), column (\d+)|end of document)\)", message)
    if found is None:
        return message
    place = f"line {found.group(1)}, column {found.group(2)}" if found.group(1) else "end of the file"
    return f"{place}: {message[: found.start()]}"


class _Reader:
    def __init__(self, data: dict[str, Any], text: str, source: str, functions: bool) -> None:
        self.data, self.text, self.source, self.functions = data, text, source, functions

    @cached_property
    def places(self) -> Places:
        """Found only when there is a mistake to report."""
        return Places(self.text)

    def model(self, new: Callable[[str], Any]) -> Any:
        self._known("", 0, self.data, ("model", "parameters", *HEADINGS))
        head = self._table("model")
        self._known("model", 0, head, ("name", "gravity", "tolerance", "units"))
        model = self._guarded("model", 0, lambda: new(head.get("name", "model")), "name")
        if head.get("units", "SI") != "SI":
            raise self._at("model", 0, "units", ModelError(f"units must be 'SI', got {shown(head['units'])}"))
        model.units = head.get("units")
        for name, value in self._table("parameters").items():
            self._guarded("parameters", 0, lambda n=name, v=value: _add_parameter(model, n, v), name)  # type: ignore[misc]
        for key in ("gravity", "tolerance"):
            if key in head:
                value = self._guarded("model", 0, lambda k=key: _numbers(model, head[k]), key)  # type: ignore[misc]
                self._guarded("model", 0, lambda k=key, v=value: setattr(model, k, v), key)  # type: ignore[misc]
        for heading in HEADINGS:
            entries = self.data.get(heading, [])
            if not isinstance(entries, list) or any(not isinstance(e, dict) for e in entries):
                raise self._at(
                    heading, 0, "", ModelError(f"write [[{heading}]] with two brackets: there may be several")
                )
            for number, entry in enumerate(entries):
                self._add(model, heading, number, entry)
        return model

    def _table(self, name: str) -> dict[str, Any]:
        table = self.data.get(name, {})
        if not isinstance(table, dict):
            raise self._at(name, 0, "", ModelError(f"{name} must be a table [{name}]"))
        return table

    def _add(self, model: Any, heading: str, number: int, entry: dict[str, Any]) -> None:
        given = dict(entry)
        kind = self._kind(heading, number, given)
        self._known(heading, number, given, kind.known)
        missing = [n for n in kind.required if n not in given]
        if missing:
            raise self._at(
                heading, number, "", ModelError(f"{heading} {shown(given.get('name', ''))} lacks {', '.join(missing)}")
            )
        made = {key: self._decoded(model, kind, number, key, value) for key, value in given.items()}
        self._guarded(heading, number, lambda: getattr(model, kind.type)(**made))

    def _kind(self, heading: str, number: int, given: dict[str, Any]) -> Kind:
        types = HEADINGS[heading]
        if heading not in _TYPED:
            return types["flexible_body" if heading == "body" and "modal_body" in given else heading]
        type_ = given.pop("type", None)
        if isinstance(type_, str) and type_ in types:
            return types[type_]
        guess = nearest(type_, types) if isinstance(type_, str) else None
        hint = f"did you mean {guess!r}?" if guess else "known: " + ", ".join(types)
        reason = NameNotFoundError(f"no type of {heading} is called {shown(type_)}; {hint}")
        raise self._at(heading, number, "type", reason)

    def _known(self, table: str, number: int, given: Mapping[str, Any], known: Sequence[str]) -> None:
        for key in given:
            if key not in known:
                guess = nearest(key, known)
                hint = f"did you mean {guess!r}?" if guess else "known: " + ", ".join(known)
                where = f"[{table}]" if table else "a model file"
                key_table = (key, 0, "") if not table else (table, number, key)
                raise self._at(*key_table, NameNotFoundError(f"{where} has no entry {shown(key)}; {hint}"))

    def _decoded(self, model: Any, kind: Kind, number: int, key: str, value: Any) -> Any:
        form = kind.form(key)
        if form in ("text", "data") or (form == "direction" and isinstance(value, str) and _AXIS_WORD.fullmatch(value)):
            return value
        read: Callable[[Any, Any], Any] = _numbers
        if form in ("motion", "load"):
            read = self._motions
        elif form == "law":
            read = self._laws
        elif form == "function":
            read = self._function
        elif form in ("modal body", "shape", "wind"):
            read = {"modal body": _modal_body, "shape": _shape, "wind": _wind}[form]
        return self._guarded(kind.heading, number, lambda: read(model, value), key)

    def _motions(self, model: Any, value: Any) -> Any:
        """Motions {type, numbers}, functions "module:name", numbers and expressions."""
        if isinstance(value, list):
            return [self._motions(model, v) for v in value]
        if isinstance(value, str) and ":" in value:
            return resolve(value) if self.functions else FunctionName(value)
        return _motion(model, value) if isinstance(value, dict) else _numbers(model, value)

    def _laws(self, model: Any, value: Any) -> Any:
        """Laws {type, code, values}, {type, program, values} and {type, function, derivatives}, alone, in lists or by coordinate."""
        if isinstance(value, list):
            return [self._laws(model, law) for law in value]
        if not isinstance(value, dict):
            raise problem("law", f"must be a table {{ type, code, values }}, got {shown(value)}")
        if not value.keys() & {"code", "program", "function"}:
            return {name: self._laws(model, law) for name, law in value.items()}
        if "function" in value:
            names = [str(value.get(key, "")) for key in ("function", "derivatives")]
            return SavedCall(*(self._motions(model, name) for name in names))
        values = _numbers(model, value.get("values", []))
        if len(shape_of(values)) > 1 or not isinstance(values, list):
            raise problem("law", f"has values that are not a list of numbers: {shown(values)}")
        if "program" not in value:
            return SavedLaw(str(value.get("type", "law")), value["code"], values)
        if not isinstance(value["program"], list):
            raise problem("law", f"has a program that is not a list of lines: {shown(value['program'])}")
        return SavedFunction(value["program"], values)

    def _function(self, model: Any, value: Any) -> Any:
        """A function as the text of its program, {type, program, values}, or by its name."""
        return self._laws(model, value) if isinstance(value, dict) else self._motions(model, value)

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
        return kind(_whole(self.source, f"line {line}, column {column}: {self._clipped(str(reason))}"))

    def _clipped(self, message: str) -> str:
        """A message in which no text of the file is longer than a name should be."""
        for text in sorted({t for t in _texts(self.data) if len(t) > _REPEATED}, key=len, reverse=True):
            message = message.replace(text, text[: _REPEATED - 3] + "...")
        return re.sub(rf"\S{{{_REPEATED},}}", lambda m: m.group()[: _REPEATED - 3] + "...", message)


def _add_parameter(model: Any, name: str, value: Any) -> None:
    if not isinstance(value, dict):
        model.parameter(name, value)
        return
    if "value" not in value or not value.keys() <= {"value", "unit"}:
        raise problem(name, f"must be a number, an array or {{ value, unit }}, got {shown(value)}")
    model.parameter(name, **value)


def _field_of(reason: MbrsError) -> str:
    address = getattr(reason, "address", "")
    field = address.partition(".")[2].partition(".")[0].partition("[")[0]
    return field.removesuffix("_a").removesuffix("_b") if field.startswith("at_") else field


def _numbers(model: Any, value: Any) -> Any:
    """Strings become expressions, everything else stays, also numbers with a unit."""
    if isinstance(value, str):
        return value if is_quantity(value) else parse(value, model.space)
    if isinstance(value, list):
        return [_numbers(model, v) for v in value]
    return value


def _motion(model: Any, value: dict[str, Any]) -> Any:
    given = dict(value)
    name = given.pop("type", None)
    if not isinstance(name, str) or name not in TYPES:
        raise problem("motion", f"has no type {shown(name)}; known: {', '.join(TYPES)}", NameNotFoundError)
    kind = given.pop("kind", None)
    made = {k: _numbers(model, v) for k, v in given.items()}
    try:
        return TYPES[name](**made, **({} if kind is None else {"kind": kind}))
    except TypeError:
        raise problem("motion", f"of type {name} cannot have the entries {shown(list(value))}") from None


def _modal_body(model: Any, value: Any) -> Any:
    """The integrals of a flexible body, a table of numbers and lists."""
    from ..flexible import ModalBody

    if not isinstance(value, dict):
        raise problem("modal_body", f"must be a table of the arguments of mb.flexible.ModalBody, got {shown(value)}")
    try:
        driven = {k: np.array(_numbers(model, v), dtype=object) for k, v in value.get("driven", {}).items()}
        return ModalBody(**{**value, "driven": driven})
    except TypeError:
        raise problem("modal_body", f"cannot be made of the entries {shown(list(value))}") from None


def _wind(model: Any, value: Any) -> Any:
    """A table of the arguments of mb.aero.wind; words are axes."""
    if not isinstance(value, dict):
        raise problem("wind", f"must be a table of the arguments of mb.aero.wind, got {shown(value)}")
    return {key: v if _is_axis(v) else _numbers(model, v) for key, v in value.items()}


def _is_axis(value: Any) -> bool:
    return isinstance(value, str) and _AXIS_WORD.fullmatch(value) is not None


def _shape(model: Any, value: Any) -> Any:
    if isinstance(value, list):
        return [_shape(model, one) for one in value]
    return shape_of_table(value, lambda entry: _numbers(model, entry))


__all__ = ["GrammarError", "dumps", "load", "loads", "save"]
