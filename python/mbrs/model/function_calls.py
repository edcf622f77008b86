"""Functions of Python that the core calls for forces and slopes: the slow path of `mb.FunctionLaw`."""

from __future__ import annotations

from typing import Any

import numpy as np

from .._lib.checks import UNFIT
from .motions import FunctionName, UserFunction, name_of, resolve
from .names import problem, shown


class FunctionCall:
    """``function(t, u, v)`` and ``derivatives(t, u, v)`` on ``m`` coordinates, checked; numbers in the place of arrays for m = 1."""

    def __init__(self, function: Any, derivatives: Any, m: int, where: str) -> None:
        self.function, self.derivatives, self.m, self.where = function, derivatives, m, where

    def check_callable(self) -> None:
        """Raise where only the names of the functions are known."""
        for function in (self.function, self.derivatives):
            if isinstance(function, FunctionName):
                raise function.not_imported(self.where)

    def try_now(self) -> None:
        """Call both once, so that a mistake in them is seen early."""
        if not isinstance(self.function, FunctionName):
            self(0.0, [0.0] * self.m, [0.0] * self.m)

    def __call__(self, t: float, u: list[float], v: list[float]) -> list[float]:
        """Forces (m,), dF_du (m, m) and dF_dv (m, m) as one list."""
        self.check_callable()
        given = (u[0], v[0]) if self.m == 1 else (np.array(u), np.array(v))
        force = self._checked("function", self._result("function", self.function, t, *given), (self.m,))
        slopes = self._result("derivatives", self.derivatives, t, *given)
        if not isinstance(slopes, tuple | list) or len(slopes) != 2:
            raise problem(self.where, f"has derivatives that must return (dF_du, dF_dv), got {shown(slopes)}")
        square = [self._checked("derivatives", s, (self.m, self.m)) for s in slopes]
        return [*force, *square[0], *square[1]]

    def _result(self, what: str, function: Any, t: float, *motion: Any) -> Any:
        try:
            return function(t, *motion)
        except BaseException as raised:
            raised.add_note(f"raised by the {what} of {self.where} at t = {t:.9g} s")
            raise

    def _checked(self, what: str, value: Any, shape: tuple[int, ...]) -> list[float]:
        try:
            made = np.asarray(value, dtype=float)
        except UNFIT:
            raise problem(self.where, f"has {what} that returned {shown(value)}, not numbers") from None
        size = int(np.prod(shape))
        if made.size != size:
            raise problem(
                self.where, f"has {what} that must return numbers of the shape {shape}, got the shape {made.shape}"
            )
        if not np.all(np.isfinite(made)):
            raise problem(self.where, f"has {what} that returned {shown(value)}; it must be finite")
        return [float(x) for x in made.ravel()]

    def described(self) -> dict[str, UserFunction]:
        """The functions as a file and a table want them."""
        parts = {"function": self.function, "derivatives": self.derivatives}
        return {key: UserFunction(f, self.where, "t, u, v") for key, f in parts.items()}

    def __reduce__(self) -> tuple[Any, ...]:
        if isinstance(self.function, FunctionName):
            return FunctionCall, (self.function, self.derivatives, self.m, self.where)
        names = [name_of(f, self.where) for f in (self.function, self.derivatives)]
        return _restored, (*names, self.m, self.where)

    def __deepcopy__(self, memo: Any) -> FunctionCall:
        return self


def _restored(function: str, derivatives: str, m: int, where: str) -> FunctionCall:
    return FunctionCall(resolve(function), resolve(derivatives), m, where)
