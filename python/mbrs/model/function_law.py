"""A law that is a Python function, traced into a program of the core or called for its values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import is_list, shown
from ..errors import ModelError
from .expressions import Program
from .law import Law
from .law_numbers import directions, number
from .tracing import trace

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike


class FunctionLaw(Law):
    """A law given as a Python function of time, displacements and rates: force = f(t, u, v).

    As ``law=`` of a joint or an element it resists, as all laws do. On one coordinate u, v and the force are numbers; on m coordinates
    (all of a bushing, or those named: ``law={("y", "z"): mb.FunctionLaw(f)}``) they are arrays (m,), and the slopes dF_i/du_j and
    dF_i/dv_j need not be symmetric.

    The function is called once with symbols; the program that comes out runs in the core with exact first and second derivatives, in
    every analysis. Parameters of the model that it uses stay parameters. It may use arithmetic, NumPy's functions, ``np.where``,
    ``np.maximum``, ``np.minimum``, comparisons, ``&``, ``|`` and ``~``, but neither ``if`` on a symbol nor `math`. At a kink the slope
    is that of one side; at zero the slopes of sqrt, cbrt and hypot count as zero.

    Parameters
    ----------
    function
        ``function(t, u, v)``; t in s. Harmonic balance refuses a function of t.
    derivatives
        ``derivatives(t, u, v) -> (dF_du, dF_dv)``, numbers or (m, m). With them the function is not traced but called by every
        evaluation: the slow path; refused by derivatives by parameters. In harmonic balance t is not a number; of a
        `MechanicalSystem` both get arrays of n samples, u and v (n,) or (m, n), slopes (n,) or (m, m, n).
    w
        Direction (n,) of u = w . x, or directions (m, n) of m coordinates, for `MechanicalSystem`.

    Notes
    -----
    A traced function is saved as text; the slow path needs functions that can be imported by name.

    Examples
    --------
    >>> import numpy as np
    >>> from mbrs.model.function_law import FunctionLaw
    >>> float(FunctionLaw(lambda t, u, v: np.sinh(u)).force(1.0))
    1.1752011936438014
    """

    def __init__(
        self,
        function: Callable[[float, np.ndarray, np.ndarray], Any],
        derivatives: Callable[..., Any] | None = None,
        w: ArrayLike | None = None,
    ) -> None:
        for name, value in (("function", function), ("derivatives", derivatives)):
            if not callable(value) and (name == "function" or value is not None):
                raise ModelError(f"FunctionLaw: {name} must be callable with (t, u, v), it is {shown(value)}")
        self.function, self.derivatives = function, derivatives
        several = _has_rows(w)
        super().__init__((), None if several else w)
        if several:
            self.w = directions("FunctionLaw", w)

    @property
    def uses_rate(self) -> bool:
        """Not known before the function is traced; True covers both."""
        return True

    def force(self, u: ArrayLike, v: ArrayLike = 0.0, t: float = 0.0) -> np.ndarray:
        """Force for displacements ``u`` and rates ``v``, arrays that broadcast, (m, ...) of m coordinates, by calling the function."""
        u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
        return _filled("function", self._called("function", t, u, v), u.shape)

    def _called(self, name: str, t: float, u: np.ndarray, v: np.ndarray) -> Any:
        """Value of the function or its derivatives; its exceptions come out unchanged, with a note."""
        try:
            return getattr(self, name)(t, u, v)
        except BaseException as raised:
            raised.add_note(f"raised by the {name} of {self!r}")
            raise

    def traced(self, m: int, where: str) -> tuple[Program, list[Any]]:
        """The program of the function on ``m`` coordinates, 0 for numbers, and the expressions that it uses."""
        return trace(self.function, m, max(m, 1), where)

    def body(self, where: str) -> tuple[Any, list[float]]:
        """The program (nodes, roots, None) that the core samples, or `sampled`, and its numbers."""
        if self.derivatives is not None:
            return self.sampled, []
        program, numbers = self.traced(0 if self.w is None or self.w.ndim == 1 else len(self.w), where)
        if any(program.core.uses()[:1]):
            raise ModelError(
                f"{where}: {self!r} depends on the time t, which harmonic balance does not know; mb.VaryingStiffness "
                "follows the phase"
            )
        return (program.nodes, program.roots, None), [number(v) for v in numbers]

    def sampled(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Force, df/du and df/dv at samples."""
        force = self.force(u, v, np.nan)
        slopes = self._called("derivatives", np.nan, u, v)
        if not isinstance(slopes, tuple | list) or len(slopes) != 2:
            raise ModelError("FunctionLaw: derivatives must return (dF_du, dF_dv)")
        square = u.shape if self.w is None or self.w.ndim == 1 else (len(u), *u.shape)
        f_u, f_v = (_filled("derivatives", slope, square) for slope in slopes)
        return force, f_u, f_v

    def __repr__(self) -> str:
        w = "" if self.w is None else " ".join(np.array2string(self.w, threshold=6, separator=", ").split())
        where = w and f", w={w}"
        return f"FunctionLaw({getattr(self.function, '__name__', self.function)}{where})"


def _has_rows(w: Any) -> bool:
    """True of directions (m, n), whatever else is wrong with them."""
    if hasattr(w, "ndim"):
        return bool(w.ndim == 2 and not hasattr(w, "toarray"))
    return isinstance(w, list | tuple) and len(w) > 0 and all(is_list(row) for row in w)


def _filled(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """An array of this shape of what a function returned, which may have left out the last parts where all are equal."""
    if isinstance(value, tuple | list) and shape and len(value) == shape[0]:
        return np.array([_filled(name, part, shape[1:]) for part in value])
    array = np.asarray(value, dtype=float)
    if array.shape != shape[: array.ndim]:
        raise ModelError(f"FunctionLaw: {name} returned the shape {array.shape} for samples of the shape {shape}")
    return np.array(np.broadcast_to(array.reshape(array.shape + (1,) * (len(shape) - array.ndim)), shape))
