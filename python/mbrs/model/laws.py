"""Force laws of one relative coordinate, law(u, u') -> force, for nonlinear elements and joints.

With a direction ``w`` a law is an element of a `MechanicalSystem`: u = w . x, and the force ``w law(u, u')`` is on the left-hand
side of the equation of motion (a positive law resists a positive u). Without ``w`` it is the ``law=`` of an element of a `Model`.
The numbers of a law may be parameter expressions. The core computes the law (``rust/src/force``); `Law.force` here is for looking
at it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import count, flag
from ..errors import ModelError
from .function_law import FunctionLaw
from .law import Law
from .law_numbers import is_plain, positive, scalar, sequence

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .aliases import Scalar, Vector


class Cubic(Law):
    """Cubic spring: force = k3 u^3.

    Parameters
    ----------
    k3
        Stiffness, force / displacement^3.
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.

    Examples
    --------
    >>> from mbrs.model.laws import Cubic
    >>> Cubic(0.1, w=[1.0])
    Cubic(0.1, w=[1.])
    """

    def __init__(self, k3: Scalar, w: ArrayLike | None = None) -> None:
        super().__init__((scalar("Cubic", "k3", k3),), w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        return [Polynomial1D(_moved_polynomial([0.0, 0.0, 0.0, *self.numbers()], u0), w=self.w)]


class Polynomial1D(Law):
    """Polynomial spring and damper: force = sum_i c_i u^i + sum_i d_i u'^i.

    Parameters
    ----------
    coefficients
        c_0, c_1, ... of u, force / displacement^i.
    velocity
        d_0, d_1, ... of the rate u', or None.
    w
        Direction (n,) of u = w . x.
    """

    def __init__(self, coefficients: Vector, velocity: Vector | None = None, w: ArrayLike | None = None) -> None:
        c = sequence("Polynomial1D", "coefficients", coefficients)
        if velocity is None:
            super().__init__(c, w)
            return
        d = sequence("Polynomial1D", "velocity", velocity)
        n = max(len(c), len(d))
        self.code = self.kind.codes[1]
        super().__init__([*c, *[0.0] * (n - len(c)), *d, *[0.0] * (n - len(d))], w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        numbers = self.numbers()
        if not self.uses_rate:
            return [Polynomial1D(_moved_polynomial(numbers, u0), w=self.w)]
        half = len(numbers) // 2
        return [Polynomial1D(_moved_polynomial(numbers[:half], u0), numbers[half:], w=self.w)]


class Gap(Law):
    """Stop beyond a gap: force = k max(u - gap, 0), with ``bilateral=True`` also k min(u + gap, 0).

    Parameters
    ----------
    k
        Stiffness of the stop, force / displacement.
    gap
        Displacement at which it closes; a negative one is a preload of a one-sided stop.
    smoothing
        s > 0, a displacement, replaces max(d, 0) by the hyperbola (d + sqrt(d^2 + s^2)) / 2, which is s/2 too large at d = 0.
    bilateral
        Stops on both sides.
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.
    """

    def __init__(
        self, k: Scalar, gap: Scalar, smoothing: Scalar = 0.0, bilateral: bool = False, w: ArrayLike | None = None
    ) -> None:
        k, gap, smoothing = (
            scalar("Gap", "k", k),
            scalar("Gap", "gap", gap),
            scalar("Gap", "smoothing", smoothing),
        )
        bilateral = flag("Gap: bilateral", bilateral)
        if is_plain(smoothing) and smoothing < 0:
            raise ModelError(f"Gap: smoothing must not be negative, it is {smoothing}")
        if bilateral and is_plain(gap) and gap < 0:
            raise ModelError(
                f"Gap: a two-sided gap must not be negative, it is {gap}; give a preload to a one-sided one"
            )
        self.code = self.kind.codes[bilateral]
        super().__init__((k, gap, smoothing), w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        k, gap, smoothing = self.numbers()
        one = Gap(k, gap - u0, smoothing, w=self.w)
        if self.code == self.kind.codes[0]:
            return [one]
        # the two sides are no longer alike: one stop for each, the second looking the other way
        return [one, Gap(k, gap + u0, smoothing, w=None if self.w is None else -self.w)]


class CoulombTanh(Law):
    """Regularised dry friction: force = force_limit tanh(u' / v_ref).

    Parameters
    ----------
    force_limit
        Friction coefficient times normal force.
    v_ref
        Rate at which 76 % of it is reached; positive.
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.
    """

    def __init__(self, force_limit: Scalar, v_ref: Scalar, w: ArrayLike | None = None) -> None:
        v_ref = positive("CoulombTanh", "v_ref", v_ref)
        super().__init__((scalar("CoulombTanh", "force_limit", force_limit), v_ref), w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        return [self]


class Hertz(Law):
    """Contact after Hertz: force = k max(u - gap, 0)^exponent.

    Parameters
    ----------
    k
        Force / displacement^exponent.
    exponent
        Above 1; 1.5 for spheres.
    gap
        Displacement at which the bodies touch.
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.

    Notes
    -----
    K. L. Johnson, Contact Mechanics, Cambridge University Press 1985, section 4.2.
    """

    def __init__(self, k: Scalar, exponent: Scalar = 1.5, gap: Scalar = 0.0, w: ArrayLike | None = None) -> None:
        exponent = positive("Hertz", "exponent", exponent)
        if is_plain(exponent) and exponent <= 1:
            raise ModelError(f"Hertz: the exponent must exceed 1, it is {exponent}; Gap is the linear contact")
        super().__init__((scalar("Hertz", "k", k), exponent, scalar("Hertz", "gap", gap)), w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        k, exponent, gap = self.numbers()
        return [Hertz(k, exponent, gap - u0, w=self.w)]


class TableLaw(Law):
    """Force from a table by a monotone cubic spline (PCHIP), straight beyond the ends.

    Parameters
    ----------
    u, f
        Displacements, strictly ascending, and forces there; at least two points.
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.

    Notes
    -----
    Slopes after Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304: as
    `scipy.interpolate.PchipInterpolator`.
    """

    def __init__(self, u: Vector, f: Vector, w: ArrayLike | None = None) -> None:
        x, y = sequence("TableLaw", "u", u), sequence("TableLaw", "f", f)
        if len(x) != len(y) or len(x) < 2:
            raise ModelError(f"TableLaw: u and f need the same length of at least 2, they have {len(x)} and {len(y)}")
        plain = [float(value) for value in x if is_plain(value)]
        if len(plain) == len(x) and not all(b > a for a, b in itertools.pairwise(plain)):
            raise ModelError("TableLaw: u must ascend strictly; sort the table and join equal points")
        super().__init__([*x, *y], w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        numbers = self.numbers()
        half = len(numbers) // 2
        return [TableLaw([u - u0 for u in numbers[:half]], numbers[half:], w=self.w)]


class VanDerPol(Law):
    """The nonlinear part of van der Pol's oscillator: force = mu u^2 u'.

    Parameters
    ----------
    mu
        Force / (displacement^2 rate).
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.
    """

    def __init__(self, mu: Scalar, w: ArrayLike | None = None) -> None:
        super().__init__((scalar("VanDerPol", "mu", mu),), w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        (mu,) = self.numbers()
        return [FunctionLaw(_Displaced(mu, u0), w=self.w)]


@dataclass(frozen=True)
class _Displaced:
    """Van der Pol's law seen from u0."""

    mu: float
    u0: float

    def __call__(self, t: Any, u: Any, v: Any) -> Any:
        return self.mu * (self.u0 + u) ** 2 * v


class Jenkins(Law):
    """Spring and slider in series: force = k (u - z) within +-f_slip; beyond, the place z of the slider follows.

    Parameters
    ----------
    k
        Stiffness of the spring, force / displacement; positive.
    f_slip
        Force at which the slider moves; positive.
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.

    Notes
    -----
    docs/theory.md (2.8). The slider starts centred (z = 0): in full stick, where the motion does not determine z, the element is the
    spring k.
    """

    def __init__(self, k: Scalar, f_slip: Scalar, w: ArrayLike | None = None) -> None:
        super().__init__((positive("Jenkins", "k", k), positive("Jenkins", "f_slip", f_slip)), w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        # the places of the sliders are counted from u0 as well
        return self._starting(u0, [z - u0 for z in states])


class Iwan(Law):
    """Parallel Jenkins elements (the model of Iwan): force = sum_i k_i (u - z_i), each within +-f_i.

    Parameters
    ----------
    k, f_slip
        Stiffnesses (force / displacement) and slip forces of the sliders, of the same length, all positive.
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.
    """

    def __init__(self, k: Vector, f_slip: Vector, w: ArrayLike | None = None) -> None:
        ks, fs = sequence("Iwan", "k", k), sequence("Iwan", "f_slip", f_slip)
        if len(ks) != len(fs):
            raise ModelError(f"Iwan: {len(ks)} stiffnesses but {len(fs)} slip forces")
        pairs = [(positive("Iwan", "k", k), positive("Iwan", "f_slip", f)) for k, f in zip(ks, fs, strict=True)]
        super().__init__([number for pair in pairs for number in pair], w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        # the places of the sliders are counted from u0 as well
        return self._starting(u0, [z - u0 for z in states])


class VaryingStiffness(Law):
    """Parametric excitation: force = k cos(order phi + phase) u, phi the phase of the excitation (omega t).

    Only harmonic balance drives it; elsewhere phi = 0.

    Parameters
    ----------
    k
        Amplitude of the stiffness, force / displacement.
    order
        Periods of the stiffness in one of the excitation, a positive integer.
    phase
        rad.
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.
    """

    def __init__(self, k: Scalar, order: int = 1, phase: Scalar = 0.0, w: ArrayLike | None = None) -> None:
        name = "VaryingStiffness"
        order = count(f"{name}: order", order, 1_000_000)
        super().__init__((scalar(name, "k", k), float(order), scalar(name, "phase", phase)), w)


class Maxwell(Law):
    """Springs in series with dashpots, in parallel: force = sum_i k_i (u - z_i), z_i' = (u - z_i) / tau_i.

    The generalised element of Maxwell, a Prony series: on u = exp(i w t) the complex stiffness is
    sum_i k_i (i w tau_i) / (1 + i w tau_i). A chain of Kelvin elements is another form of the same relation. Slow motions feel
    nothing; give the static stiffness to the element itself (``k=``). At rest z_i = u.

    Parameters
    ----------
    k, tau
        Stiffnesses and relaxation times (s) of the branches, one or a list of the same length; positive. The dashpots are k tau.
    w
        Direction (n,) of u = w . x.
    """

    def __init__(self, k: Scalar | Vector, tau: Scalar | Vector, w: ArrayLike | None = None) -> None:
        one = not isinstance(k, Sequence | np.ndarray) or (isinstance(k, np.ndarray) and k.ndim == 0)
        ks, taus = ([k], [tau]) if one else (sequence("Maxwell", "k", k), sequence("Maxwell", "tau", tau))
        if len(ks) != len(taus):
            raise ModelError(f"Maxwell: {len(ks)} stiffnesses but {len(taus)} relaxation times")
        pairs = [(positive("Maxwell", "k", a), positive("Maxwell", "tau", b)) for a, b in zip(ks, taus, strict=True)]
        super().__init__([number for pair in pairs for number in pair], w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        # at rest the dashpots have followed: z = u0
        return [self]


class BoucWen(Law):
    """Smooth hysteresis: force = alpha k u + (1 - alpha) k z, z' = u' - beta |u'| |z|^(n-1) z - gamma u' |z|^n.

    z is a displacement, the slope at the origin is k, and z tends to (beta + gamma)^(-1/n). At rest after slow loading z lies on
    the curve of first loading.

    Parameters
    ----------
    k
        Stiffness at the origin, force / displacement; positive.
    alpha
        Part of k that stays when z has reached its bound, 0 to 1.
    beta, gamma
        Shape, displacement^-n; energy is dissipated where beta >= abs(gamma).
    n
        Sharpness, at least 1.
    w
        Direction (n,) of u = w . x.

    Notes
    -----
    Y.-K. Wen, J. Eng. Mech. Div. ASCE 102 (1976) 249-263.
    """

    def __init__(
        self, k: Scalar, alpha: Scalar, beta: Scalar, gamma: Scalar, n: Scalar = 1.0, w: ArrayLike | None = None
    ) -> None:
        name = "BoucWen"
        k, n = positive(name, "k", k), positive(name, "n", n)
        alpha, beta, gamma = (
            scalar(name, "alpha", alpha),
            scalar(name, "beta", beta),
            scalar(name, "gamma", gamma),
        )
        if is_plain(n) and n < 1:
            raise ModelError(f"BoucWen: n must be at least 1, it is {n}")
        if is_plain(alpha) and not 0 <= alpha <= 1:
            raise ModelError(f"BoucWen: alpha must be from 0 to 1, it is {alpha}")
        if is_plain(beta) and is_plain(gamma) and (beta < abs(gamma) or beta == 0):
            raise ModelError(
                f"BoucWen: beta must be positive and not below abs(gamma), otherwise cycles make energy; they are {beta} and {gamma}"
            )
        super().__init__((k, alpha, beta, gamma, n), w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        # what moves sees the rate alone
        return self._starting(u0, states)


class LuGre(Law):
    """Friction of elastic bristles: force = s0 z + s1 z' + s2 u', z' = u' - s0 abs(u') z / g(u').

    g(u') = f_c + (f_s - f_c) exp(-(u'/v_s)^2) is the friction of steady sliding (Stribeck), z the deflection of the bristles. It
    sticks (with the stiffness s0), creeps before it slips, and slips with hysteresis.

    Parameters
    ----------
    f_c, f_s
        Coulomb friction and breakaway force; positive, f_s >= f_c.
    v_s
        Stribeck velocity; positive.
    s0
        Stiffness of the bristles; positive.
    s1, s2
        Their damping and viscous friction; not negative.
    w
        Direction (n,) of u = w . x.

    Notes
    -----
    C. Canudas de Wit, H. Olsson, K. J. Astrom, P. Lischinsky, IEEE Trans. Automatic Control 40 (1995) 419-425.
    """

    def __init__(
        self,
        f_c: Scalar,
        f_s: Scalar,
        v_s: Scalar,
        s0: Scalar,
        s1: Scalar = 0.0,
        s2: Scalar = 0.0,
        w: ArrayLike | None = None,
    ) -> None:
        name = "LuGre"
        f_c, f_s, v_s, s0 = (
            positive(name, key, value) for key, value in (("f_c", f_c), ("f_s", f_s), ("v_s", v_s), ("s0", s0))
        )
        s1, s2 = scalar(name, "s1", s1), scalar(name, "s2", s2)
        for key, value in (("s1", s1), ("s2", s2)):
            if is_plain(value) and value < 0:
                raise ModelError(f"LuGre: {key} must not be negative, it is {value}")
        if is_plain(f_c) and is_plain(f_s) and f_s < f_c:
            raise ModelError(f"LuGre: the breakaway force f_s must not be below f_c, they are {f_s} and {f_c}")
        super().__init__((f_c, f_s, v_s, s0, s1, s2), w)

    def moved(self, u0: float, states: Sequence[float] = ()) -> list[Law] | None:
        # what moves sees the rate alone
        return self._starting(u0, states)


def _moved_polynomial(c: Sequence[float], u0: float) -> list[float]:
    """Coefficients in u of the polynomial at u0 + u, less its value at u0."""
    return [0.0, *(sum(comb(i, j) * c[i] * u0 ** (i - j) for i in range(j, len(c))) for j in range(1, len(c)))]
