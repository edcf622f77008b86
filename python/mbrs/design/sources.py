"""Text of a function of outputs and of what it uses of its module: a sweep goes on only with the function that began it."""

from __future__ import annotations

import ast
import hashlib
import inspect
import re
import sys
import textwrap
import types
from collections.abc import Callable
from typing import Any

from ..errors import ModelError

# "module:name" as a value of TOML
_NAMED = re.compile(r'"([A-Za-z_][\w.]*:[A-Za-z_][\w.]*)"')
_PLAIN = (bool, int, float, complex, str, bytes, type(None))


def describe(function: Callable[..., Any]) -> dict[str, Any]:
    """Name and source of a function of a module, and of what it uses of the same module; comments and layout do not count.

    Raises
    ------
    ModelError
        A lambda, or a function within another: what such a one does depends on values that a file cannot hold.
    """
    named = getattr(function, "describe", None)
    if named is not None:
        return dict(named())
    if not isinstance(function, types.FunctionType):
        raise ModelError(
            f"outputs= must be a function of a module or one of mb.outputs, it is a {type(function).__name__}"
        )
    if function.__closure__ or "<" in function.__qualname__:
        raise ModelError(
            f"a sweep with store= needs a function of a module, and {function.__qualname__!r} is made within another; "
            "define it at the top of a file"
        )
    parts: dict[str, str] = {}
    _collect(function, parts)
    return {"function": f"{function.__module__}:{function.__qualname__}", "source": parts}


def model_functions(text: str) -> str:
    """Comments for the TOML text of a model: the source of each function that it names, as far as its module is loaded."""
    found: dict[str, str] = {}
    for name in sorted(set(_NAMED.findall(text))):
        module, _, path = name.partition(":")
        value: Any = sys.modules.get(module)
        for part in path.split("."):
            value = getattr(value, part, None)
        if isinstance(value, types.FunctionType):
            parts: dict[str, str] = {}
            _collect(value, parts)
            found[name] = _stable(parts)
    return "".join(f"# {name}: {source}\n" for name, source in found.items())


def digest(description: Any) -> str:
    """SHA-256 of a description."""
    return hashlib.sha256(_stable(description).encode()).hexdigest()


def _stable(value: Any) -> str:
    import json

    return json.dumps(value, sort_keys=True)


def _collect(function: types.FunctionType, parts: dict[str, str]) -> None:
    parts[function.__qualname__] = _source(function)
    for name in _names(function.__code__):
        value = function.__globals__.get(name)
        if name in parts:
            continue
        if isinstance(value, types.FunctionType) and value.__module__ == function.__module__:
            _collect(value, parts)
        elif name in function.__globals__ and _is_plain(value):
            parts[name] = repr(value)


def _is_plain(value: Any) -> bool:
    return isinstance(value, _PLAIN) or (isinstance(value, tuple) and all(isinstance(one, _PLAIN) for one in value))


def _names(code: types.CodeType) -> list[str]:
    """Global names that code uses, that of functions within it included."""
    found = dict.fromkeys(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            found.update(dict.fromkeys(_names(constant)))
    return list(found)


def _source(function: types.FunctionType) -> str:
    """The source without comments and layout; the compiled code where there is no source (a string that was executed)."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        return _compiled(function.__code__)
    return ast.unparse(tree)


def _compiled(code: types.CodeType) -> str:
    constants = [_compiled(c) if isinstance(c, types.CodeType) else repr(c) for c in code.co_consts]
    return f"{hashlib.sha256(code.co_code).hexdigest()} {constants} {code.co_names} {code.co_varnames}"
