"""XML files as data from strangers: no entities, no document types, no other files; every attribute that nobody read is named."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from .._lib.formats import Omission, open_file
from ..errors import ModelError
from ._accuracy import Accuracy

# Bytes of the largest XML file. Too small: robots of many thousand bodies are refused. Too large: building the tree of a file takes
# about ten times its size. Pinned by tests/io/test_hostile.py.
LARGEST_XML = 32 * 1024 * 1024
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_DECLARED = re.compile(r"<!(DOCTYPE|ENTITY)", re.I)
_REPEATED = 60  # characters of a text of the file in a message

__all__ = ["Node", "Source", "clipped", "parse"]


def clipped(text: str) -> str:
    """A text of the file, short enough for a message."""
    return text if len(text) <= _REPEATED else text[: _REPEATED - 3] + "..."


class Source:
    """A file that is being read: what was read of it, and what mbrs does not have."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.omissions: list[Omission] = []
        self.read: set[tuple[Any, str]] = set()
        self.accuracy = Accuracy()

    def omit(self, what: str, feature: str) -> None:
        """Note that something of the file is left out or changed."""
        self.omissions.append(Omission(clipped(what), feature))

    def ledger(self, root: Any) -> None:
        """Note the elements and attributes that were not read."""
        waiting = [(root, "the file")]
        while waiting:
            element, owner = waiting.pop()
            tag = _tag(element)
            if (element, "") not in self.read:
                # an element without a name of its own is a feature of the named one around it
                name = element.get("name")
                self.omit(f"{tag} {name!r}" if name and owner == "the file" else owner, f"<{tag}>")
                continue
            here = f"{tag} {element.get('name')!r}" if element.get("name") and element is not root else owner
            for key in element.attrib:
                if (element, key) not in self.read:
                    self.omit(here, f"{clipped(key)}=" if here != owner else f"<{tag} {clipped(key)}=>")
            waiting.extend((child, here) for child in reversed(element))


def _tag(element: Any) -> str:
    tag = str(element.tag)
    return clipped(tag.rpartition("}")[2] or tag)


class Node:
    """An element, with the attributes of its defaults; each access notes what was read.

    ``given`` maps an attribute to its text and the element that has it.
    """

    __slots__ = ("element", "given", "source")

    def __init__(self, source: Source, element: Any, defaults: Mapping[str, tuple[str, Any]] | None = None) -> None:
        self.source, self.element = source, element
        own = {key: (element.get(key), element) for key in element.attrib}
        self.given: dict[str, tuple[str, Any]] = {**(defaults or {}), **own}
        source.read.add((element, ""))

    @property
    def tag(self) -> str:
        """The element's name without its namespace."""
        return _tag(self.element)

    @property
    def what(self) -> str:
        """Its name in messages."""
        name = self.element.get("name")
        return f"{self.tag} {clipped(name)!r}" if name else f"<{self.tag}>"

    @property
    def where(self) -> str:
        """File, line and element, before the text of an error."""
        return f"{self.source.path.name}: line {self.element.sourceline}: {self.what}"

    def error(self, text: str, kind: type[ModelError] = ModelError) -> ModelError:
        """An error about this element."""
        return kind(f"{self.where} {text}")

    def omit(self, feature: str) -> None:
        """Note that a feature of this element is left out or changed."""
        self.source.omit(self.what, feature)

    def __contains__(self, key: str) -> bool:
        return key in self.given

    def text(self, key: str, default: str | None = None) -> str | None:
        """An attribute, or the default."""
        if key not in self.given:
            return default
        value, element = self.given[key]
        self.source.read.add((element, key))
        return value

    def required(self, key: str) -> str:
        """An attribute that must be there and not be empty."""
        value = self.text(key)
        if not value:
            raise self.error(f"lacks the attribute {key!r}")
        return value

    def numbers(self, key: str, count: int | Sequence[int], default: Sequence[float] | None = None) -> list[float]:
        """As many finite numbers as ``count`` says (or one of the counts)."""
        value = self.text(key)
        if value is None:
            if default is None:
                raise self.error(f"lacks the attribute {key!r}")
            return list(default)
        words = value.split()
        counts = (count,) if isinstance(count, int) else tuple(count)
        made = [float(w) for w in words[: max(counts) + 1] if len(w) < 400 and _NUMBER.fullmatch(w)]
        if len(made) != len(words) or len(words) not in counts or not all(math.isfinite(v) for v in made):
            many = " or ".join(str(c) for c in counts)
            raise self.error(f"needs {many} finite number{'s' * (counts != (1,))} in {key!r}, got {clipped(value)!r}")
        self.source.accuracy.note(key, words, made)
        return made

    def number(self, key: str, default: float | None = None) -> float:
        """One finite number."""
        return self.numbers(key, 1, None if default is None else (default,))[0]

    def word(self, key: str, known: Sequence[str], default: str | None = None) -> str:
        """One of the known words."""
        value = self.text(key, default)
        if value not in known:
            raise self.error(f"has {key!r} = {clipped(str(value))!r}; known are {', '.join(known)}")
        return str(value)

    def flag(self, key: str, default: bool) -> bool:
        """true or false."""
        return self.word(key, ("true", "false"), "true" if default else "false") == "true"

    def children(self, *tags: str) -> Iterator[Node]:
        """The elements of these names inside, in their order; all of them without names."""
        for child in self.element:
            if not tags or _tag(child) in tags:
                yield Node(self.source, child)

    def child(self, tag: str) -> Node | None:
        """The only element of this name inside, or None."""
        found = list(self.children(tag))
        if len(found) > 1:
            raise self.error(f"has {len(found)} elements <{tag}>; one is allowed")
        return found[0] if found else None


def parse(path: Path, root: str, title: str, source: Source | None = None) -> Node:
    """The root element of an XML file.

    Raises
    ------
    ModelError
        No such file, a large one, not XML, another root element, a document type (it could name entities and other files).
    """
    try:
        from lxml import etree
    except ImportError:
        raise ModelError(f"{title} needs lxml, which is not installed: pip install 'mbrs-dynamics[files]'") from None
    source = source or Source(path)
    name = path.name
    data = open_file(path, LARGEST_XML)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        raise ModelError(f"{name} is not UTF-8 text (byte {reason.start}), so it is not read as {title}") from None
    declared = _DECLARED.search(text)
    if declared:
        line = text.count("\n", 0, declared.start()) + 1
        raise ModelError(
            f"{name}: line {line}: <!{declared.group(1).upper()}> is not read: it can name other files and entities; remove it"
        )
    # libxml2 itself refuses trees deeper than 256 and texts above 10 MB; the encoding that a file declares is not believed
    parser = etree.XMLParser(
        encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True
    )
    try:
        element = etree.fromstring(text.encode(), parser)
    except etree.XMLSyntaxError as reason:
        raise ModelError(f"{name} is not XML: {clipped(str(reason.msg))}, line {reason.lineno}") from None
    except ValueError as reason:
        raise ModelError(f"{name} is not XML: {clipped(str(reason))}") from None
    if element is None or _tag(element) != root:
        found = "nothing" if element is None else f"<{_tag(element)}>"
        raise ModelError(f"{name} is not a file of {title}: its root element is {found}, not <{root}>")
    return Node(source, element)
