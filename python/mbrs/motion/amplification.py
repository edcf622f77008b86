"""Undamped modes that four-step BDF amplifies: found after a motion, and warned of by name."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._lib.warning import warn_user
from ..errors import MbrsError
from ..linear.modal_result import dominant_in
from ..linear.modes import modes

if TYPE_CHECKING:
    from ..model.model import Model

# Beyond this growth over the run a mode is worth a warning.
_GROWTH = 1.1
# Growth over |s| of an oscillation up to which it is steady. Larger: what grows by itself is blamed on steps. Smaller: rounding of undamped
# modes keeps silent.
_UNDAMPED = 1e-9
# Larger models are not solved for their modes only to be warned of.
_LARGEST = 300


def bdf4_factor(z: complex) -> float:
    """Largest factor per step of four-step BDF on y' = s y, z = s h.

    (25/12 - z) q^4 - 4 q^3 + 3 q^2 - 4/3 q + 1/4 = 0; above one for undamped modes with 0 < omega h < 4.8 or so.
    """
    return float(np.abs(np.roots([25 / 12 - z, -4, 3, -4 / 3, 1 / 4])).max())


def warn_amplified(m: Model, at: Any, steps: ArrayLike) -> None:
    """Warn of oscillations about the start that should not grow, but that these steps (s, their ends) let grow."""
    times = np.asarray(steps)
    if len(times) < 3:
        return
    h, n = float(np.median(np.diff(times))), len(times) - 1
    modes = _modes(m, at)
    if modes is None:
        return
    growth = [n * np.log(bdf4_factor(s * h)) if _steady(s) else 0.0 for s in modes.eigenvalue]
    worst = int(np.argmax(growth)) if growth else 0
    if not growth or growth[worst] <= np.log(_GROWTH):
        return
    s = modes.eigenvalue[worst]
    grown = f"a factor of {np.exp(growth[worst]):.3g}" if growth[worst] < 30 else "more than 1e13"
    warn_user(
        f"'bdf-bfgs' amplifies mode {worst} ({s.imag / (2 * np.pi):.4g} Hz, {dominant_in(modes)[worst]}) of {m.name!r} by {grown} "
        f"over this run, if it is excited: omega h = {abs(s) * h:.3g} lies between 0 and 4.8, where BDF of order 4 is not "
        "stable; take a smaller step, give the mode damping, or use 'generalized-alpha'"
    )


def _steady(s: complex) -> bool:
    """An oscillation without damping, or with less than counts; not one that grows by itself."""
    return s.imag > 0.0 and s.real <= _UNDAMPED * abs(s)


def _modes(m: Model, at: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            if 6 * len(m.bodies) > _LARGEST:
                return None
            return modes(m, at=at)
        except MbrsError:
            # a state that cannot be linearised has no modes to warn of
            return None
