"""Base of all laws of relative coordinates: numbers, a direction, and how it is seen from a displaced state."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .law_numbers import direction, is_plain, number
from .schema import FUNCTION_LAW, LAWS, LawKind

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class Law:
    """Base of all laws.

    ``code`` and ``values`` are what the core reads: the kind of law and its numbers. ``w`` is the direction (n,), of a law of m
    coordinates (m, n), or None. ``kind`` tells what its force depends on. ``start`` are its states at rest, which is u = ``displaced``
    of the law from which it was moved; empty where they are zero.
    """

    code: int = -1
    kind: LawKind = LawKind("", (), "", smooth=False)
    start: Sequence[float] = ()
    displaced: float = 0.0

    def __init_subclass__(cls) -> None:
        cls.kind = FUNCTION_LAW if cls.__name__ == FUNCTION_LAW.name else LAWS.get(cls.__name__, cls.kind)
        cls.code = cls.kind.codes[0] if cls.kind.codes else -1

    @property
    def has_memory(self) -> bool:
        """True if the force depends on what happened before."""
        return self.kind.state != ""

    @property
    def uses_rate(self) -> bool:
        """True if the force depends on the rate u'."""
        return self.code in self.kind.rate_codes

    def __init__(self, values: Sequence[Any], w: ArrayLike | None = None) -> None:
        self.values: tuple[Any, ...] = tuple(values)
        for value in self.values:
            if is_plain(value) and not np.isfinite(float(value)):
                raise ModelError(f"{type(self).__name__}: {value} among its numbers; all must be finite")
        self.w: np.ndarray | None = None if w is None else direction(type(self).__name__, w)

    @property
    def directions(self) -> np.ndarray:
        """Directions (m, n) of its coordinates; ``w`` must be there."""
        return np.atleast_2d(np.asarray(self.w))

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        """Laws that together are force(u0 + u), but for a constant; None where no known laws are.

        Exact for polynomials, stops, contact and tables, whose numbers move; rate laws do not see u0. Laws with memory start from
        their ``states`` at u0.
        """
        return None

    def _starting(self, u0: float, states: Sequence[float]) -> list[Law]:
        """This law with these states at its u = 0, which is u0 of the present one."""
        made = copy(self)
        made.start, made.displaced = (tuple(states) if any(states) else ()), u0
        return [made]

    def numbers(self) -> list[float]:
        """The numbers at the present values of the parameters."""
        return [number(value) for value in self.values]

    def force(self, u: ArrayLike, v: ArrayLike = 0.0) -> np.ndarray:
        """Force for displacements ``u`` and rates ``v`` (arrays that broadcast); a law with sliders takes them as a
        history, and one whose state has a rate is at rest in each."""
        from .. import _core

        u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
        return _core.law_force(self.code, self.numbers(), u.ravel(), v.ravel()).reshape(u.shape)

    def __repr__(self) -> str:
        numbers = ", ".join(f"{v:g}" if is_plain(v) else str(v) for v in self.values)
        where = "" if self.w is None else f", w={np.array2string(self.w, threshold=6, separator=', ')}"
        return f"{type(self).__name__}({numbers}{where})"
