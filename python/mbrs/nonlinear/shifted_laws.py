"""Laws seen from a loaded state: law(u0 + u) - law(u0) as laws of u, for analyses that count motion from that state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import _core
from ..errors import ModelError
from ..model import laws as L
from ..model.schema import LAW_OF_CODE


def law_of(code: int, values: Sequence[float], w: np.ndarray) -> L.Law:
    """A law from what the core reads: its code and its numbers, which were checked when the model was made."""
    kind: type[L.Law] = getattr(L, LAW_OF_CODE[code].name)
    law = kind.__new__(kind)
    L.Law.__init__(law, [float(v) for v in values], w)
    law.code = code
    return law


class ShiftedFunction(L.FunctionLaw):
    """f(0, u0 + u, v) - f(0, u0, 0) of the function that is traced into ``body``, (nodes, roots), with its captured numbers."""

    def __init__(self, body: Any, numbers: np.ndarray, u0: float, w: np.ndarray, where: str) -> None:
        L.Law.__init__(self, (), w)
        self.derivatives = None
        self.program, self.p, self.u0, self.where = body, [float(x) for x in numbers], u0, where

    def body(self, where: str) -> tuple[Any, list[float]]:
        nodes, roots = self.program
        if _core.Program(nodes, roots).uses()[:1] == [True]:
            raise ModelError(
                f"{self.where} depends on the time t, which harmonic balance does not know; mb.VaryingStiffness follows the phase"
            )
        return (nodes, roots, self.u0), self.p

    def force(self, u: Any, v: Any = 0.0, t: float = 0.0) -> np.ndarray:
        u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
        program = _core.Program(*self.program)
        root = self.program[1][0]
        one = lambda x, y: program.values([t, self.u0 + x, y, *self.p])[root]  # noqa: E731
        held = program.values([t, self.u0, 0.0, *self.p])[root]
        return np.array([one(x, y) - held for x, y in zip(u.ravel(), v.ravel(), strict=True)]).reshape(u.shape)

    def __repr__(self) -> str:
        return f"FunctionLaw({self.where})"


def shifted(code: int, values: Sequence[float], w: np.ndarray, u0: float, where: str) -> list[L.Law]:
    """The laws of u = w . x that together are law(u0 + u) - law(u0).

    Exact for polynomials, stops, contact and tables, whose numbers move; rate laws do not see u0. `ModelError` where
    the shifted law is none of the known ones: sliders, van der Pol's law and a varying stiffness that are displaced.
    """
    law = law_of(code, values, w)
    moved = [law] if u0 == 0.0 else law.moved(u0)
    if moved is None:
        raise ModelError(
            f"{where} is displaced by {u0:.3g} at this state, and {law.kind.name} cannot be counted from there; draw the "
            "model so that it is at rest undeformed, or give a natural length (angle) with which it is"
        )
    held = _at_rest(moved, w)
    return moved if held == 0.0 else [*moved, L.Polynomial1D([-held], w=w)]


def _at_rest(laws: Sequence[L.Law], w: np.ndarray) -> float:
    """The force that the laws hold at the state itself, along w: it belongs to the equilibrium."""
    held = 0.0
    for law in laws:
        along = 1.0 if law.w is not None and np.array_equal(law.w, w) else -1.0
        held += along * float(law.force(0.0))
    return held
