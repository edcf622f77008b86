"""A first guess of a periodic motion from its past: what a motion that begins at rest settles to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import condensation, verify
from .cycle_start import Bounded, TooLong, coefficients
from .options import Fourier

# Coordinates up to which integration in time costs less than what is tried afterwards. A count: too large, large systems wait for
# nothing; too small, contacts of small models have no first point (tests/truth/test_hbm_contact.py).
MOST_COORDINATES = 60
# Periods before the one that is taken. A count: too large, minutes; too small, the motion has not forgotten its start.
PERIODS = 16
# Relative error of a step: a guess needs no more.
ACCURACY = 1e-7
SAMPLES = 1 << 13
# Largest change from one period to the next, over the largest displacement, of a motion that is called periodic. Too large: motions on
# their way are; too small: those of little damping are not (tests/truth/test_hbm_contact.py).
REPEATED = 1e-2
# Part of the largest amplitude from which on a harmonic is one of those that a motion has. Too large: too few are recommended, from
# which Newton's method does not converge; too small: too many (tests/truth/test_hbm_contact.py).
SEEN = 1e-4


@dataclass(frozen=True)
class Settled:
    """Coefficients ``X`` (n, 2 H + 1) of the last period, whether it ``repeats`` the one before, and the harmonics that it has,
    ``top``."""

    X: np.ndarray
    repeats: bool
    top: int


def settled(system: Any, force: Any, omega: float, fourier: Fourier) -> Settled | None:
    """The last of some periods from rest, None where the system has memory or is not of moderate size, or where it takes too long."""
    from scipy.integrate import solve_ivp

    n, nu = system.n, fourier.subharmonic
    if n > MOST_COORDINATES or any(law.has_memory for law in system.elements):
        return None
    period = 2 * np.pi * nu / omega
    t = (PERIODS - 2) * period + period * np.arange(2 * SAMPLES) / SAMPLES
    rate = Bounded(verify.first_order(system, force, omega))
    size = ACCURACY * _displacement(system, force, omega)
    given = dict(rtol=ACCURACY, atol=np.repeat([size, omega * size], n))
    try:
        motion = solve_ivp(rate, (0.0, t[-1]), np.zeros(2 * n), "LSODA", t, **given)
    except (TooLong, np.linalg.LinAlgError):
        return None
    if not motion.success or not np.all(np.isfinite(motion.y)):
        return None
    before, last = motion.y[:n, :SAMPLES], motion.y[:n, SAMPLES:]
    spectrum = coefficients(last, SAMPLES // 2 - 1)
    amplitude = np.max(np.hypot(spectrum[:, 1::2], spectrum[:, 2::2]), axis=0)
    seen = 1 + np.flatnonzero(amplitude > SEEN * np.max(amplitude))
    X = spectrum[:, : 2 * fourier.terms[-1] + 1]
    repeats = bool(np.max(np.abs(last - before)) <= REPEATED * np.max(np.abs(last)))
    return Settled(X, repeats, int(seen[-1]) if len(seen) else 1)


def _displacement(system: Any, force: Any, omega: float) -> float:
    """The smaller of what the forces move masses without springs and springs without masses."""
    M, _, K = condensation.dense(system)
    given = force.values() if isinstance(force, Mapping) else [force]
    push = np.sum([np.abs(f) for f in given], axis=0)
    free = float(np.max(np.abs(np.linalg.solve(M, push)))) / omega**2
    try:
        held = float(np.max(np.abs(np.linalg.solve(K, push))))
    except np.linalg.LinAlgError:
        held = np.inf
    return max(min(free, held), np.finfo(float).tiny)
