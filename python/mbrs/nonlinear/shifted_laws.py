"""Laws seen from a loaded state: law(u0 + u) - law(u0) as laws of u, for analyses that count motion from that state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
