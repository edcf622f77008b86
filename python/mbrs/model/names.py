"""Names and the errors about them: one wording for everything a user may have mistyped."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Sequence
from typing import Any

from .._lib.checks import shown
from ..errors import DuplicateNameError, MbrsError, ModelError, NameNotFoundError

GROUND = "ground"
_FORBIDDEN = frozenset(".[]")
# Comparing with every name of a model of 1e5 bodies would take seconds, so large sets are narrowed first.
_LARGE = 2000
__all__ = ["GROUND", "check_name", "index", "located", "nearest", "not_found", "problem", "shown"]


def problem(address: str, text: str, error: type[MbrsError] = ModelError) -> MbrsError:
    """An error about one number or object; its message starts with the address, cut where a name is long."""
    return located(error(f"{_brief(address)} {text}"), address)


def _brief(text: str) -> str:
    """A text whose middle is left out where it is long."""
    return text if len(text) <= 120 else f"{text[:60]}...{text[-40:]}"


def located(error: MbrsError, address: str) -> MbrsError:
    """The error, with the address it is about kept on it, so that a file reader can point at the line."""
    error.__dict__["address"] = address
    return error


def check_name(kind: str, name: object, taken: Collection[str]) -> str:
    """The name if a new object may have it, else the error that says why not."""
    if isinstance(name, str) and name and name not in taken and name != GROUND and _FORBIDDEN.isdisjoint(name):
        return name
    error: type[ModelError] = ModelError
    if not isinstance(name, str):
        text = f"the name of a {kind} must be a string, got {shown(name)} ({type(name).__name__})"
    elif not name:
        text = f"the name of a {kind} must not be empty"
    elif not _FORBIDDEN.isdisjoint(name):
        text = f"the name {shown(name)} of a {kind} must not contain '.', '[' or ']', which addresses use"
    else:
        text, error = (
            f"the name {shown(name)} of a {kind} is already taken in this model; choose another",
            DuplicateNameError,
        )
    raise located(error(text), f"{name}.name")


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name most like this one, or None."""
    pool = list(known)
    if len(pool) > _LARGE:
        pool = [other for other in pool if other[:1] == name[:1] and abs(len(other) - len(name)) <= 2]
    by_fold = {other.casefold(): other for other in pool}
    if name.casefold() in by_fold:
        return by_fold[name.casefold()]
    found = difflib.get_close_matches(name, pool, n=1, cutoff=0.5)
    return found[0] if found else None


def index(what: str, one: Any, known: Sequence[str]) -> int:
    """Place of a name, or of the name of a handle, among known ones; ``what`` as for `not_found`."""
    name = getattr(one, "name", one)
    for i, other in enumerate(known):
        if other == name:
            return i
    raise not_found(what, name if isinstance(name, str) else str(name), known)


def not_found(what: str, name: str, known: Iterable[str]) -> NameNotFoundError:
    """``what`` is "no body", "no field of joint 'A'" and the like; the message proposes the nearest known name."""
    pool = list(known)
    guess = nearest(name, pool)
    if guess is not None:
        hint = f"; did you mean {shown(guess)}?"
    elif not pool:
        hint = "; there are none"
    elif len(pool) <= 12:
        hint = "; known: " + ", ".join(shown(other, 30) for other in pool)
    else:
        hint = ""
    return NameNotFoundError(f"{_brief(what)} is called {shown(name)}{hint}")
