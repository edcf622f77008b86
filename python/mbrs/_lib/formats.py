"""File formats by their endings. A reader or writer registers itself; models, results and matrices ask here and import none of them.

A format is one module of `mbrs.io`, which the package finds by its place in that folder: a new one needs a new file and nothing else.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ..errors import ModelError, OmissionWarning
from . import checks
from .warning import warn_user

__all__ = ["Format", "Omission", "find", "known", "load_with", "open_file", "register", "warn_of_omissions"]

Holds = Literal["model", "result", "matrices"]

# Bytes of the largest file that is read, unless a format says otherwise. Too small: models with many bodies are refused. Too large:
# a file that was made to fill the memory does. Pinned by tests/io/test_hostile.py.
LARGEST_FILE = 256 * 1024 * 1024
# Names of one kind that a message lists; `OmissionWarning.omissions` has all.
_LISTED = 6
_LONGEST_NAME = 60


class Format(NamedTuple):
    """A kind of file by its ending, with its reader and writer.

    Attributes
    ----------
    ending
        With its dot, lower case: ".urdf".
    holds
        What such a file is: a "model", a "result" or "matrices".
    title
        The name of the format.
    read
        ``read(path, **options)``, or None where such files are only written.
    write
        ``write(thing, path)`` returns the path; None where such files are only read.
    largest
        Bytes of the largest file that is read.
    """

    ending: str
    holds: Holds
    title: str
    read: Callable[..., Any] | None = None
    write: Callable[[Any, Path], Path] | None = None
    largest: int = LARGEST_FILE


class Omission(NamedTuple):
    """Something that a file or a model has and the other side has not.

    Attributes
    ----------
    object
        Its name, such as "joint 'shoulder'".
    feature
        What was left out, such as "limit", or what was done instead.
    """

    object: str
    feature: str

    def __str__(self) -> str:
        return f"{self.feature} of {self.object}"


_FORMATS: dict[tuple[str, str], Format] = {}
_SOURCES: list[Callable[[], None]] = []
_LOADING = threading.RLock()


def load_with(source: Callable[[], None]) -> None:
    """Have ``source`` called once, before the first question about formats; it imports the modules that register them."""
    _SOURCES.append(source)


def register(new: Format) -> None:
    """Make a format known; an ending has one meaning for each thing that files hold."""
    key = (new.holds, new.ending)
    if key in _FORMATS:
        raise ValueError(f"the ending {new.ending!r} of a {new.holds} belongs to {_FORMATS[key].title} already")
    _FORMATS[key] = new


def known(holds: Holds, action: Literal["read", "write"]) -> tuple[str, ...]:
    """The endings that can be read or written."""
    _load()
    return tuple(sorted(e for (h, e), f in _FORMATS.items() if h == holds and getattr(f, action) is not None))


def find(path: str | Path, holds: Holds, action: Literal["read", "write"]) -> Format:
    """The format of a file; a `ModelError` lists the known endings."""
    _load()
    path = checks.path("path", path)
    name, ending = path.name, path.suffix.lower()
    found = _FORMATS.get((holds, ending))
    if found is not None and getattr(found, action) is not None:
        return found
    verb = "load" if action == "read" else "save"
    what = "is not known" if found is None else f"({found.title}) is only {'written' if action == 'read' else 'read'}"
    raise ModelError(
        f"cannot {verb} {_short(name)!r}: the ending {_short(ending)!r} of a {holds} {what}; known are {', '.join(known(holds, action))}"
    )


def open_file(path: str | Path, largest: int = LARGEST_FILE) -> bytes:
    """The bytes of a file that is neither absent nor larger than ``largest``; raises `ModelError`."""
    path = Path(path)
    try:
        if not path.is_file():
            raise ModelError(f"cannot read {path}: " + ("it is not a file" if path.exists() else "it does not exist"))
        with path.open("rb") as file:
            data = file.read(largest + 1)
    except OSError as reason:
        raise ModelError(f"cannot read {path}: {reason.strerror or reason}") from None
    except ValueError as reason:  # a name with a null byte
        raise ModelError(f"cannot read a file of this name: {reason}") from None
    if len(data) > largest:
        raise ModelError(
            f"{path.name} is larger than {largest // 1024**2} MiB, the largest file of its kind that is read"
        )
    return data


def warn_of_omissions(name: str, omissions: list[Omission]) -> None:
    """One `OmissionWarning` for a file, that names each object; nothing where nothing was left out."""
    if not omissions:
        return
    objects: dict[str, list[str]] = {}
    for one in omissions:
        objects.setdefault(one.feature, []).append(one.object)
    parts = []
    for feature, names in objects.items():
        distinct = list(dict.fromkeys(names))
        more = f" and {len(distinct) - _LISTED} more" if len(distinct) > _LISTED else ""
        parts.append(f"{feature}: {', '.join(_short(n) for n in distinct[:_LISTED])}{more}")
    text = f"{_short(name)}: left out or changed: " + "; ".join(parts)
    warn_user(OmissionWarning(text, tuple(omissions)))


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST_NAME else text[: _LONGEST_NAME - 3] + "..."


def _load() -> None:
    """Let the sources register their formats; other threads wait until all are known."""
    with _LOADING:
        while _SOURCES:
            _SOURCES[-1]()
            _SOURCES.pop()
