"""Laws seen from a loaded state: law(u0 + u) - law(u0) as laws of u, for analyses that count motion from that state."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np

from ..errors import ModelError
from ..model import laws as L

_CLASSES: dict[int, type[L.Law]] = {
    0: L.Cubic,
    1: L.Polynomial1D,
    2: L.Polynomial1D,
    3: L.Gap,
    4: L.Gap,
    5: L.CoulombTanh,
    6: L.Hertz,
    7: L.TableLaw,
    8: L.VanDerPol,
    9: L.Jenkins,
    10: L.Iwan,
    11: L.VaryingStiffness,
}


def law_of(code: int, values: Sequence[float], w: np.ndarray) -> L.Law:
    """A law from what the core reads: its code and its numbers, which were checked when the model was made."""
    kind = _CLASSES[code]
    law = kind.__new__(kind)
    L.Law.__init__(law, [float(v) for v in values], w)
    law.code = code
    return law


def shifted(code: int, values: Sequence[float], w: np.ndarray, u0: float, where: str) -> list[L.Law]:
    """The laws of u = w . x that together are law(u0 + u) - law(u0).

    Exact for polynomials, stops, contact and tables, whose numbers move; rate laws do not see u0. `ModelError` where
    the shifted law is none of the known ones: sliders, van der Pol's law and a varying stiffness that are displaced.
    """
    p = [float(v) for v in values]
    if u0 == 0.0 or code == 5:
        moved = [law_of(code, p, w)]
    elif code == 0:
        moved = [law_of(1, _moved_polynomial([0.0, 0.0, 0.0, p[0]], u0), w)]
    elif code == 1:
        moved = [law_of(1, _moved_polynomial(p, u0), w)]
    elif code == 2:
        half = len(p) // 2
        moved = [law_of(2, [*_moved_polynomial(p[:half], u0), *p[half:]], w)]
    elif code == 3:
        moved = [law_of(3, [p[0], p[1] - u0, p[2]], w)]
    elif code == 4:
        # the two sides are no longer alike: one stop for each, the second looking the other way
        moved = [law_of(3, [p[0], p[1] - u0, p[2]], w), law_of(3, [p[0], p[1] + u0, p[2]], -w)]
    elif code == 6:
        moved = [law_of(6, [p[0], p[1], p[2] - u0], w)]
    elif code == 7:
        half = len(p) // 2
        moved = [law_of(7, [*(u - u0 for u in p[:half]), *p[half:]], w)]
    else:
        raise ModelError(
            f"{where} is displaced by {u0:.3g} at this state, and {_CLASSES[code].__name__} cannot be counted from "
            "there; draw the model so that it is at rest undeformed, or give a natural length (angle) with which it is"
        )
    held = _at_rest(moved, w)
    return moved if held == 0.0 else [*moved, law_of(1, [-held], w)]


def _at_rest(laws: Sequence[L.Law], w: np.ndarray) -> float:
    """The force that the laws hold at the state itself, along w: it belongs to the equilibrium."""
    held = 0.0
    for law in laws:
        along = 1.0 if law.w is not None and np.array_equal(law.w, w) else -1.0
        held += along * float(law.force(0.0))
    return held


def _moved_polynomial(c: Sequence[float], u0: float) -> list[float]:
    """Coefficients in u of the polynomial at u0 + u, less its value at u0."""
    return [0.0, *(sum(comb(i, j) * c[i] * u0 ** (i - j) for i in range(j, len(c))) for j in range(1, len(c)))]
