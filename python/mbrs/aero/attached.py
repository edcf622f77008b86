"""Attached flow that changes in time: Theodorsen's and Wagner's functions, and a model with states."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._lib.checks import complex_array, count, real_array, real_number, shown
from ..errors import ModelError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["AttachedFlow", "Indicial", "attached_flow", "indicial", "theodorsen", "wagner"]

# Logarithms of the smallest and largest rate, per half chord, in Wagner's function. A narrower range: phi misses 1/2 at 0 and its
# tail. A wider one: Bessel functions overflow. Pinned by test_wagners_function.
SLOWEST, FASTEST = -28.0, 3.2
# Rates at which its integral is summed. Fewer: the error, which falls exponentially with their number, is above rounding. More: time.
# Pinned by test_wagners_function.
RATES = 260
# Relative changes that end the fit of the indicial function. Larger: weights and rates stop short of the best. Smaller: rounding never
# ends.
_FITTED = 1e-14


def theodorsen(k: ArrayLike) -> np.ndarray:
    """Theodorsen's function of the reduced frequency k = omega b / U, b the half chord.

        C(k) = K1(i k) / (K0(i k) + K1(i k))

    Parameters
    ----------
    k
        (...) of any shape, real or complex; not negative real part. 1 at 0, 1/2 at infinity.

    Returns
    -------
    ndarray
        (...) complex.

    Raises
    ------
    ModelError
        nan, a negative real part.

    Notes
    -----
    T. Theodorsen, "General theory of aerodynamic instability and the mechanism of flutter", NACA Report 496 (1935). A complex k =
    -i s b / U continues it to motions exp(s t).

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.aero.theodorsen([0.0, 0.4]).round(4)
    array([1.   +0.j   , 0.625-0.165j])
    """
    from scipy.special import kve

    x = complex_array("theodorsen: k", k)
    if np.any(x.real < 0.0):
        raise ModelError(f"theodorsen: the reduced frequency must not be negative, it is {shown(k)}")
    p = 1j * np.where(x == 0.0, 1.0, x)
    return np.where(x == 0.0, 1.0, kve(1, p) / (kve(0, p) + kve(1, p)))


def wagner(s: ArrayLike) -> np.ndarray:
    """Wagner's function: lift after a sudden start over the final lift.

        phi(s) = 1 - int_0^inf exp(-x s) / (x^2 ((K0(x) - K1(x))^2 + pi^2 (I0(x) + I1(x))^2)) dx

    Parameters
    ----------
    s
        (...) half chords flown, not negative.

    Returns
    -------
    ndarray
        (...), from 1/2 at 0 to 1.

    Raises
    ------
    ModelError
        nan, negative distances.

    Notes
    -----
    H. Wagner, Z. angew. Math. Mech. 5 (1925) 17; I. E. Garrick, NACA Report 629 (1938), for the integral.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.aero.wagner([0.0, 1.0, 5.0, 10.0]).round(4)
    array([0.5   , 0.6006, 0.7882, 0.875 ])
    """
    x = real_array("wagner: s", s)
    if np.any(x < 0.0):
        raise ModelError(f"wagner: the distance must not be negative, it is {shown(s)}")
    rates, weights = _spectrum(RATES)
    return 1.0 - np.exp(-x[..., None] * rates) @ weights


def _spectrum(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Rates and weights of exponentials that add up to 1 - phi: the trapezoidal rule of its integral over log x."""
    from scipy.special import ive, kve

    t = np.linspace(SLOWEST, FASTEST, n)
    x = np.exp(t)
    k = (kve(0, x) - kve(1, x)) * np.exp(-x)
    i = (ive(0, x) + ive(1, x)) * np.exp(x)
    return x, (t[1] - t[0]) / (x * (k**2 + (np.pi * i) ** 2))


@dataclass(frozen=True, eq=False)
class Indicial:
    """Wagner's function as a sum of exponentials, phi(s) = 1 - sum A exp(-b s): ``weights`` A and ``rates`` b (n,); `indicial`
    makes it.
    """

    weights: np.ndarray
    rates: np.ndarray

    def response(self, s: ArrayLike) -> np.ndarray:
        """(...) the sum at s (...) half chords flown."""
        return 1.0 - np.exp(-np.asarray(s, dtype=float)[..., None] * self.rates) @ self.weights

    def transfer(self, k: ArrayLike) -> np.ndarray:
        """(...) complex: what takes the place of Theodorsen's function at reduced frequencies k (...), 1 - sum A i k / (i k + b)."""
        p = 1j * np.asarray(k)[..., None]
        return 1.0 - (p / (p + self.rates)) @ self.weights


def indicial(states: int = 2) -> Indicial:
    """Wagner's function by so many exponentials.

    Parameters
    ----------
    states
        2: R. T. Jones' weights .165, .335 and rates .0455, .3 (within 1 % of phi). More, 3 to 8: fitted to phi over 0 to 1000 half chords,
        with phi(0) = 1/2 and phi(inf) = 1 exact; 4 are within 1e-3, 6 within 1.3e-4, 8 within 1.2e-5.

    Raises
    ------
    ModelError
        Another number of states.

    Notes
    -----
    R. T. Jones, "The unsteady lift of a wing of finite aspect ratio", NACA Report 681 (1940).

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.aero.indicial().response([0.0, 5.0]).round(4)
    array([0.5   , 0.7938])
    """
    n = count("indicial: states", states, 8, 2)
    if n == 2:
        return Indicial(np.array([0.165, 0.335]), np.array([0.0455, 0.3]))
    return _fit(n)


@functools.cache
def _fit(n: int) -> Indicial:
    """Exponentials, all positive and together 1/2 at 0, that fit what is missing from phi = 1."""
    from scipy.optimize import least_squares

    s = np.concatenate([[0.0], np.geomspace(1e-2, 1e3, 400)])
    rest = 1.0 - wagner(s)

    def parts(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        share = np.exp(p[:n] - np.max(p[:n]))
        return 0.5 * share / share.sum(), np.exp(p[n:])

    def miss(p: np.ndarray) -> np.ndarray:
        weights, rates = parts(p)
        return np.exp(-np.outer(s, rates)) @ weights - rest

    start = np.concatenate([np.zeros(n), np.linspace(np.log(0.01), np.log(0.6), n)])
    weights, rates = parts(
        least_squares(miss, start, method="trf", x_scale="jac", xtol=_FITTED, ftol=_FITTED, gtol=_FITTED).x
    )
    order = np.argsort(rates)
    return Indicial(weights[order], rates[order])


@dataclass(frozen=True, eq=False)
class AttachedFlow:
    """Forces of attached flow on a section per length, as matrices of its motion q = (plunge, pitch); `attached_flow` makes it.

        f = -(mass q" + damping q' + stiffness q + lag z),   z' = input_rate q' + input q - decay z

    ``mass``, ``damping``, ``stiffness`` (2, 2), ``lag`` (2, n), ``input_rate``, ``input`` (n, 2), ``decay`` (n,) 1/s. SI units.
    """

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    lag: np.ndarray
    input_rate: np.ndarray
    input: np.ndarray
    decay: np.ndarray

    def state_matrix(self, mass: ArrayLike, stiffness: ArrayLike, damping: ArrayLike | None = None) -> np.ndarray:
        """(4 + n, 4 + n): the matrix of d/dt (q, q', z) for a section with its own ``mass``, ``stiffness``, ``damping`` (2, 2)."""
        given = {"mass": mass, "damping": damping, "stiffness": stiffness}
        own = [
            np.zeros((2, 2)) if m is None else real_array(f"state_matrix: {name}", m, (2, 2))
            for name, m in given.items()
        ]
        n = len(self.decay)
        rows = np.hstack([-(own[2] + self.stiffness), -(own[1] + self.damping), -self.lag])
        return np.vstack(
            [
                np.hstack([np.zeros((2, 2)), np.eye(2), np.zeros((2, n))]),
                np.linalg.solve(own[0] + self.mass, rows),
                np.hstack([self.input, self.input_rate, -np.diag(self.decay)]),
            ]
        )


def attached_flow(
    half_chord: float, speed: float, *, axis: float, density: float = 1.225, model: Indicial | None = None
) -> AttachedFlow:
    """A thin section in attached flow, plunging by h and pitching by alpha about an axis, with circulation that lags behind.

        L = pi rho b^2 (h" + U alpha' - b a alpha") + 2 pi rho U b C w,   w = U alpha + h' + b (1/2 - a) alpha'
        M = pi rho b^2 (b a h" - U b (1/2 - a) alpha' - b^2 (1/8 + a^2) alpha") + 2 pi rho U b^2 (a + 1/2) C w

    C, Theodorsen's function, by the indicial ``model``: one state z for each exponential, the mean of w over the past.

    Parameters
    ----------
    half_chord
        b m, positive.
    speed
        U m/s, positive.
    axis
        a: place of the axis behind the middle of the chord, in half chords; -1/2 is the quarter chord.
    density
        kg/m^3.
    model
        As from `indicial`; Jones' by default.

    Returns
    -------
    AttachedFlow
        h is positive down and alpha nose up, both at the axis; the forces are (-L, M).

    Raises
    ------
    ModelError
        A half chord or speed that is not positive, nan.

    Notes
    -----
    R. L. Bisplinghoff, H. Ashley and R. L. Halfman, "Aeroelasticity" (1955), section 5-6; Theodorsen's report 496. Where a wake
    of filaments is shed, this circulation must not act as well: shed vorticity would be counted twice.

    Examples
    --------
    >>> import mbrs as mb
    >>> air = mb.aero.attached_flow(0.5, 20.0, axis=-0.2)
    >>> air.lag.shape, air.decay
    ((2, 2), array([ 1.82, 12.  ]))
    """
    b, u, a, rho = (
        real_number(f"attached_flow: {name}", value)
        for name, value in (("half_chord", half_chord), ("speed", speed), ("axis", axis), ("density", density))
    )
    if b <= 0.0 or u <= 0.0 or rho < 0.0:
        raise ModelError(f"attached_flow: half chord and speed must be positive, they are {b:g} m and {u:g} m/s")
    known = indicial() if model is None else model
    added = np.pi * rho * b**2 * np.array([[1.0, -b * a], [-b * a, b**2 * (0.125 + a**2)]])
    turning = np.pi * rho * b**2 * u * np.array([[0.0, 1.0], [0.0, b * (0.5 - a)]])
    # the downwash at three quarters of the chord, and what a unit of it does
    by_rate, by_place = np.array([1.0, b * (0.5 - a)]), np.array([0.0, u])
    effect = 2.0 * np.pi * rho * u * b * np.array([1.0, -b * (a + 0.5)])
    decay = known.rates * u / b
    at_once = 1.0 - known.weights.sum()
    return AttachedFlow(
        mass=added,
        damping=turning + at_once * np.outer(effect, by_rate),
        stiffness=at_once * np.outer(effect, by_place),
        lag=np.outer(effect, known.weights * decay),
        input_rate=np.tile(by_rate, (len(decay), 1)),
        input=np.tile(by_place, (len(decay), 1)),
        decay=decay,
    )
