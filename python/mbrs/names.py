"""Names and the errors about them: one wording for everything a user may have mistyped."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable

from .errors import DuplicateNameError, MbrsError, ModelError, NameNotFoundError

GROUND = "ground"
_FORBIDDEN = frozenset(".[]")
# Comparing with every name of a model of 1e5 bodies would take seconds, so large sets are narrowed first.
_LARGE = 2000


def problem(address: str, text: str, error: type[MbrsError] = ModelError) -> MbrsError:
    """An error about one number or object; keeps its address so that a file reader can point at the line."""
    made = error(f"{address} {text}")
    made.__dict__["address"] = address
    return made


def check_name(kind: str, name: object, taken: Collection[str]) -> str:
    """The name if a new object may have it, else the error that says why not."""
    if not isinstance(name, str):
        raise ModelError(f"the name of a {kind} must be a string, got {name!r} ({type(name).__name__})")
    if not name:
        raise ModelError(f"the name of a {kind} must not be empty")
    if not _FORBIDDEN.isdisjoint(name):
        raise ModelError(f"the name {name!r} of a {kind} must not contain '.', '[' or ']', which addresses use")
    if name == GROUND or name in taken:
        raise DuplicateNameError(f"the name {name!r} of a {kind} is already taken in this model; choose another")
    return name


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


def not_found(what: str, name: str, known: Iterable[str]) -> NameNotFoundError:
    """``what`` is "no body", "no field of joint 'A'" and the like; the message proposes the nearest known name."""
    pool = list(known)
    guess = nearest(name, pool)
    if guess is not None:
        hint = f"; did you mean {guess!r}?"
    elif not pool:
        hint = "; there are none"
    elif len(pool) <= 12:
        hint = "; known: " + ", ".join(repr(other) for other in pool)
    else:
        hint = ""
    return NameNotFoundError(f"{what} is called {name!r}{hint}")
