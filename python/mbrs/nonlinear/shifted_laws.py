"""Laws seen from a loaded state: law(u0 + u) - law(u0) as laws of u, for analyses that count motion from that state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from ..errors import ModelError
from ..model import laws as L
from ..model.function_calls import FunctionCall
from ..model.function_law import FunctionLaw
from ..model.law import Law
from ..model.schema import LAW_OF_CODE


def law_of(code: int, values: Sequence[float], w: np.ndarray) -> Law:
    """A law from what the core reads: its code and its numbers, which were checked when the model was made."""
    kind: type[Law] = getattr(L, LAW_OF_CODE[code].name)
    law = kind.__new__(kind)
    Law.__init__(law, [float(v) for v in values], w)
    law.code = code
    return law


class ShiftedFunction(FunctionLaw):
    """f(0, u0 + u, v) - f(0, u0, 0) of a function of m coordinates: ``function`` is the program (nodes, roots) into which it was traced,
    with its captured numbers, or what calls it. ``u0`` (m,), ``w`` (m, n)."""

    def __init__(self, function: Any, numbers: np.ndarray, u0: np.ndarray, w: np.ndarray, where: str) -> None:
        Law.__init__(self, ())
        self.w = np.array(w[0] if len(w) == 1 else w)
        self.w.setflags(write=False)
        self.derivatives = None
        self.program, self.p, self.u0, self.where = function, [float(x) for x in numbers], np.array(u0, float), where
        self.is_called = isinstance(function, FunctionCall)
        self._refuse_time()

    def _refuse_time(self) -> None:
        still = np.zeros(len(self.u0))
        if self.is_called:
            called = self._evaluator()
            called(0.0, self.u0, still)
            try:
                called(np.nan, self.u0, still)
                depends = False
            except ModelError:  # not finite
                depends = True
        else:
            depends = _core.Program(*self.program).uses()[:1] == [True]
        if depends:
            raise ModelError(
                f"{self.where} depends on the time t, which harmonic balance does not know; mb.VaryingStiffness follows the phase"
            )

    def body(self, where: str) -> tuple[Any, list[float]]:
        if self.is_called:
            return self.sampled, []
        nodes, roots = self.program
        return (nodes, roots, self.u0.tolist()), self.p

    def _evaluator(self) -> Callable[[float, np.ndarray, np.ndarray], list[float]]:
        """(t, u, v) to forces (m,), and, of a function that is called, slopes (m, m) by u and by v, one after the other."""
        if self.is_called:
            return lambda t, u, v: self.program(t, u.tolist(), v.tolist())
        nodes, roots = self.program
        program = _core.Program(nodes, roots)

        def values(t: float, u: np.ndarray, v: np.ndarray) -> list[float]:
            made = program.values([t, *u, *v, *self.p])
            return [made[root] for root in roots]

        return values

    def _at(self, u: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Answers of the function at samples (n,) or (m, n), one column each, the forces less those at u0."""
        m, values = len(self.u0), self._evaluator()
        t = np.nan if self.is_called else 0.0
        points = zip(u.reshape(m, -1).T, v.reshape(m, -1).T, strict=True)
        made = np.array([values(t, self.u0 + a, b) for a, b in points]).T
        made[:m] -= np.array(values(t, self.u0, np.zeros(m)))[:m, None]
        return made

    def sampled(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces, df/du and df/dv at samples, of a function that is called."""
        m, made = len(self.u0), self._at(u, v)
        square = (m, m, made.shape[1])
        return made[:m], made[m : m + m * m].reshape(square), made[m + m * m :].reshape(square)

    def force(self, u: Any, v: Any = 0.0, t: float = 0.0) -> np.ndarray:
        """Forces at displacements and rates, (m, ...) of m coordinates."""
        u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
        return self._at(u, v)[: len(self.u0)].reshape(u.shape)

    def __repr__(self) -> str:
        return f"FunctionLaw({self.where})"


def shifted(
    code: int, values: Sequence[float], w: np.ndarray, u0: float, where: str, memory: Sequence[float] = ()
) -> list[Law]:
    """The laws of u = w . x that together are law(u0 + u) - law(u0); ``memory``: where sliders are, empty: centred.

    Exact for polynomials, stops, contact and tables, whose numbers move; rate laws do not see u0; laws with memory start from their
    states at u0. `ModelError` where the shifted law is none of the known ones: a varying stiffness that is displaced.
    """
    law = law_of(code, values, w)
    if law.has_memory:
        with core_errors():
            states, _ = _core.law_at_rest(code, law.numbers(), u0, list(memory))
            moved = law.moved(u0, states)
            # no interval from which a state with a rate would move on
            still = [0.0] if law.kind.state == "rate" else []
            start = [] if moved is None else [*moved[0].start]
            held = _core.law_at_rest(code, law.numbers(), 0.0, [*start, *still])[1] if start else 0.0
    else:
        moved = [law] if u0 == 0.0 else law.moved(u0)
        held = 0.0 if moved is None else _at_rest(moved, w)
    if moved is None:
        raise ModelError(
            f"{where} is displaced by {u0:.3g} at this state, and {law.kind.name} cannot be counted from there; draw the "
            "model so that it is at rest undeformed, or give a natural length (angle) with which it is"
        )
    return moved if held == 0.0 else [*moved, L.Polynomial1D([-held], w=w)]


def _at_rest(laws: Sequence[Law], w: np.ndarray) -> float:
    """The force that the laws hold at the state itself, along w: it belongs to the equilibrium."""
    held = 0.0
    for law in laws:
        along = 1.0 if law.w is not None and np.array_equal(law.w, w) else -1.0
        held += along * float(law.force(0.0))
    return held
