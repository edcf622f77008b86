"""Errors of the core as errors of mbrs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from .. import _core
from ..errors import (
    AssemblyError,
    ConvergenceError,
    MbrsError,
    ModelError,
    NotDifferentiableError,
    RouteError,
    SingularError,
)

_CLASSES: dict[type[Exception], type[MbrsError]] = {
    _core.CoreModelError: ModelError,
    _core.CoreRouteError: RouteError,
    _core.CoreAssemblyError: AssemblyError,
    _core.CoreSingularError: SingularError,
    _core.CoreNotDifferentiableError: NotDifferentiableError,
    _core.CoreConvergenceError: ConvergenceError,
}


def require_memory(size: float, what: str, remedy: str) -> None:
    """RouteError with both sizes and the remedy where ``what``, which needs ``size`` bytes, does not fit into memory."""
    with core_errors():
        _core.require_memory(float(size), what, remedy)


@contextmanager
def core_errors() -> Iterator[None]:
    """Translate exceptions of the Rust core to `mbrs.errors`."""
    try:
        yield
    except _core.CoreError as problem:
        known = _CLASSES.get(type(problem), MbrsError)
        raise known(str(problem.args[0]) if problem.args else str(problem)) from None
