"""Force laws of one relative coordinate, law(u, u') -> force, for nonlinear elements and joints.

With a direction ``w`` a law is an element of a `MechanicalSystem`: u = w . x, and the force ``w law(u, u')`` is on the left-hand
side of the equation of motion (a positive law resists a positive u). Without ``w`` it is the ``law=`` of an element of a `Model`.
The numbers of a law may be parameter expressions. The core computes the law (``rust/src/force``); `Law.force` here is for looking
at it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import count, flag, shown
from ..errors import ModelError
from .expressions import Program
from .law_numbers import direction, is_plain, number, positive, scalar, sequence
from .schema import FUNCTION_LAW, LAWS, LawKind
from .tracing import trace

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from .aliases import Scalar, Vector


class Law:
    """Base of all laws.

    ``code`` and ``values`` are what the core reads: the kind of law and its numbers. ``w`` is the direction (n,) or
    None. ``kind`` tells what its force depends on.
    """

    code: int = -1
    kind: LawKind = LawKind("", (), "", smooth=False)

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

    def moved(self, u0: float) -> list[Law] | None:
        """Laws that together are force(u0 + u), but for a constant; None where no known laws are.

        Exact for polynomials, stops, contact and tables, whose numbers move; rate laws do not see u0.
        """
        return None

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

    def moved(self, u0: float) -> list[Law] | None:
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

    def moved(self, u0: float) -> list[Law] | None:
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

    def moved(self, u0: float) -> list[Law] | None:
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

    def moved(self, u0: float) -> list[Law] | None:
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

    def moved(self, u0: float) -> list[Law] | None:
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

    def moved(self, u0: float) -> list[Law] | None:
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

    def moved(self, u0: float) -> list[Law] | None:
        # at rest the dashpots have followed
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
        evaluation: the slow path, for `mb.equilibrium`, `mb.linearize`, `mb.modes`, `mb.frf` and `mb.simulate`, and with arrays of
        samples for u and v (and t not a number) in harmonic balance of a `MechanicalSystem`; refused by derivatives by parameters.
    w
        Direction (n,) of u = w . x, for `MechanicalSystem`.

    Notes
    -----
    A traced function is saved as text; the slow path needs functions that can be imported by name.

    Examples
    --------
    >>> import numpy as np
    >>> from mbrs.model.laws import FunctionLaw
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
        super().__init__((), w)

    @property
    def uses_rate(self) -> bool:
        """Not known before the function is traced; True covers both."""
        return True

    def force(self, u: ArrayLike, v: ArrayLike = 0.0, t: float = 0.0) -> np.ndarray:
        """Force for displacements ``u`` and rates ``v``, arrays that broadcast, by calling the function."""
        u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
        return self._shaped("function", self._called("function", t, u, v), u.shape)

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
        """The program (nodes, roots, None) that the core samples on one coordinate, or `sampled`, and its numbers."""
        if self.derivatives is not None:
            return self.sampled, []
        program, numbers = self.traced(0, where)
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
        f_u, f_v = (self._shaped("derivatives", slope, u.shape) for slope in slopes)
        return force, f_u, f_v

    @staticmethod
    def _shaped(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
        array = np.asarray(value, dtype=float)
        if array.shape not in ((), shape):
            raise ModelError(f"FunctionLaw: {name} returned the shape {array.shape} for samples of the shape {shape}")
        return np.array(np.broadcast_to(array, shape))

    def __repr__(self) -> str:
        where = "" if self.w is None else f", w={np.array2string(self.w, threshold=6, separator=', ')}"
        return f"FunctionLaw({getattr(self.function, '__name__', self.function)}{where})"


def _moved_polynomial(c: Sequence[float], u0: float) -> list[float]:
    """Coefficients in u of the polynomial at u0 + u, less its value at u0."""
    return [0.0, *(sum(comb(i, j) * c[i] * u0 ** (i - j) for i in range(j, len(c))) for j in range(1, len(c)))]
