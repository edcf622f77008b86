"""Studies as files: a TOML file that names a model, designs and outputs, for ``mbrs sweep study.toml``.

A file is data: its paths stay in its folder, and it names a Python function only where the caller allows that.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._lib.checks import choice, shown
from ..errors import ModelError
from ..model.motions import resolve
from . import outputs as _outputs
from . import sampling, uncertainty
from .gaussian import normal
from .sweep import sweep
from .table import Designs

# Bytes of a study file that are read; a larger one is not a study.
LARGEST_FILE = 10_000_000
_TOP = frozenset({"model", "store", "executor", "time_limit", "chunk", "designs", "outputs"})
_DESIGNS: Mapping[str, frozenset[str]] = {
    "latin_hypercube": frozenset({"n", "seed"}),
    "sobol": frozenset({"n", "seed", "scramble"}),
    "halton": frozenset({"n", "seed", "scramble"}),
    "saltelli": frozenset({"n", "seed"}),
    "full_factorial": frozenset({"levels", "values"}),
    "normal": frozenset({"n", "seed", "mean", "sd", "correlation", "bounds"}),
    "from_table": frozenset({"file"}),
}
_ANALYSES: Mapping[str, frozenset[str]] = {
    "modes": frozenset({"n", "sensitivities", "at"}),
    "frf": frozenset({"inputs", "outputs", "frequency", "kind", "sensitivities", "at"}),
    "equilibrium": frozenset({"sensitivities"}),
}


@dataclass(frozen=True)
class Study:
    """Contents of a study file; ``model`` and ``store`` are paths."""

    model: Path
    store: Path
    designs: Designs
    outputs: Any
    options: Mapping[str, Any]
    functions: bool

    def run(self, **changes: Any) -> Any:
        """`mb.sweep` of the study; ``changes`` go before what the file says."""
        from ..model.model import Model

        options = {"store": self.store, **self.options, **changes}
        return sweep(Model.load(self.model, self.functions), self.designs, self.outputs, **options)


def read(path: str | Path, functions: bool = False) -> Study:
    """The study of a file.

    Parameters
    ----------
    path
        Of the TOML file.
    functions
        True: outputs and the model may name Python functions, "module:function", whose modules are imported.

    Raises
    ------
    ModelError
        What is wrong, with the file and the key.
    """
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ModelError(f"{path} has more than {LARGEST_FILE} bytes, which no study has")
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as reason:
        raise ModelError(f"cannot read {path}: {reason.strerror or reason}") from None
    except (ValueError, RecursionError) as reason:
        raise ModelError(f"{path}: {str(reason)[:400]}") from None
    try:
        return _study(path, data, functions)
    except ModelError as reason:
        raise ModelError(f"{path}: {reason}") from None
    except TypeError as reason:
        raise ModelError(f"{path}: a value has the wrong type ({reason})") from None


def _study(path: Path, data: Mapping[str, Any], functions: bool) -> Study:
    _known("the study", data, _TOP)
    for key in ("model", "designs", "outputs"):
        if key not in data:
            raise ModelError(f"the study has no {key!r}")
    model = _inside(path, "model", data["model"])
    store = _inside(path, "store", data.get("store", f"{path.stem}-runs"))
    options = {key: data[key] for key in ("executor", "time_limit", "chunk") if key in data}
    if not isinstance(options.get("executor", 1), int):
        raise ModelError(f"'executor' must be a number of threads, it is {shown(options['executor'])}")
    return Study(
        model, store, _designs(path, _table("designs", data)), _analysis(_table("outputs", data), functions), options,
        functions,
    )  # fmt: skip


def _table(name: str, data: Mapping[str, Any]) -> dict[str, Any]:
    found = data.get(name, {})
    if not isinstance(found, Mapping):
        raise ModelError(f"{name!r} must be a table, [{name}], it is {shown(found)}")
    return dict(found)


def _known(what: str, data: Mapping[str, Any], known: frozenset[str]) -> None:
    unknown = sorted(set(data) - known)
    if unknown:
        raise ModelError(f"{what} has the unknown key {unknown[0]!r}; known are {', '.join(sorted(known))}")


def _inside(path: Path, key: str, given: Any) -> Path:
    """A path within the folder of the study."""
    if not isinstance(given, str) or not given:
        raise ModelError(f"{key!r} must be a path, it is {shown(given)}")
    folder = path.parent.resolve()
    found = (folder / given).resolve()
    if not found.is_relative_to(folder) or found == folder:
        raise ModelError(f"the path {given!r} of {key!r} leads out of the folder of the study")
    return found


def _designs(path: Path, data: dict[str, Any]) -> Designs:
    method = choice("method of [designs]", data.pop("method", "latin_hypercube"), tuple(_DESIGNS))
    units = _table("units", data)
    data.pop("units", None)
    if method not in ("from_table", "normal"):
        ranges = {name: _range(name, given) for name, given in _table("ranges", data).items()}
        data.pop("ranges", None)
        _known(f"[designs] of {method}", data, _DESIGNS[method])
        if method == "full_factorial":
            ranges |= _table("values", data)
            data.pop("values", None)
            return sampling.full_factorial(ranges, **data, units=units)
        source = uncertainty if method == "saltelli" else sampling
        return getattr(source, method)(ranges, **_counted(method, data), units=units)
    _known(f"[designs] of {method}", data, _DESIGNS[method])
    if method == "from_table":
        return sampling.from_table(_inside(path, "file", data.get("file")), units=units)
    bounds = {name: _range(name, given) for name, given in _table("bounds", data).items()} or None
    mean, sd = _table("mean", data), _table("sd", data)
    rest: dict[str, Any] = {key: data[key] for key in ("n", "seed", "correlation") if key in data}
    return normal(mean, sd, **_counted(method, rest), bounds=bounds, units=units)


def _counted(method: str, data: dict[str, Any]) -> dict[str, Any]:
    if "n" not in data:
        raise ModelError(f"[designs] of {method} has no 'n', the number of designs")
    return data


def _range(name: str, given: Any) -> tuple[Any, ...]:
    if not isinstance(given, list) or len(given) != 2:
        raise ModelError(f"the range of {name!r} must be [low, high], it is {shown(given)}")
    return tuple(given)


def _analysis(data: dict[str, Any], functions: bool) -> Any:
    if "function" in data:
        _known("[outputs]", data, frozenset({"function"}))
        return _function(data["function"], functions)
    name = choice("analysis of [outputs]", data.pop("analysis", None), tuple(_ANALYSES))
    _known(f"[outputs] of {name}", data, _ANALYSES[name])
    return getattr(_outputs, name)(**data)


def _function(given: Any, functions: bool) -> Any:
    if not isinstance(given, str) or given.count(":") != 1:
        raise ModelError(f"'function' must read 'module:function', it is {shown(given)}")
    if not functions:
        raise ModelError(
            f"the study names the Python function {given!r}; allow that with --functions if you trust the file"
        )
    return resolve(given)
