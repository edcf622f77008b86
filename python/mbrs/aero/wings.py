"""Wings by the lifting line with a straight rigid wake: steady, and started impulsively."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.border import require_memory
from .._lib.checks import count, real_array, shown
from ..errors import ConvergenceError, ModelError
from ..results import Result, Stats, quantity, result
from .blades import Blade

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

__all__ = ["WingLoads", "WingStart", "impulsive_start", "lifting_line"]

# Circulation, over the largest of the wing, by which Kutta-Joukowski's law may be missed. Larger: loads that do not balance are
# called converged. Smaller: Newton's method circles in rounding. Pinned by test_stalled_wings_balance_or_say_so.
BALANCED = 1e-10
# Newton steps, and halvings of one: in the linear range one full step is enough.
MOST_STEPS, MOST_HALVINGS = 60, 12
# Place of the newest shed vortex, in steps behind the trailing edge: beside it the effect of a sheet grows as one over the root of
# the distance, whose mean over a step is that of a vortex at a quarter of it. A choice of the discretisation, first order.
NEWEST = 0.25


@result
class WingLoads(Result):
    """A wing in steady wind. Coefficients over its area at ``angle`` (n,) rad; at ``place`` (m,) m along the span ``circulation``
    (n, m) m, over the wind's speed, and ``angle_of_attack`` (n, m) rad with the induced velocity. ``error`` (n,): what half as
    many strips change in lift and induced drag, over the largest.
    """

    angle: np.ndarray = quantity(dims=("angle",), unit="rad")
    lift_coefficient: np.ndarray = quantity(dims=("angle",), unit="1", label="lift coefficient")
    induced_drag: np.ndarray = quantity(dims=("angle",), unit="1", label="coefficient of induced drag")
    drag_coefficient: np.ndarray = quantity(dims=("angle",), unit="1", label="drag coefficient")
    place: np.ndarray = quantity(dims=("place",), unit="m", label="place along the span")
    circulation: np.ndarray = quantity(dims=("angle", "place"), unit="m", label="circulation over the wind's speed")
    angle_of_attack: np.ndarray = quantity(dims=("angle", "place"), unit="rad", label="angle of attack")
    aspect_ratio: float = quantity(unit="1", label="aspect ratio")

    row: ClassVar[str] = "angle"
    axes: ClassVar[Mapping[str, str]] = {"angle": "angle", "place": "place"}
    error_dims: ClassVar[tuple[str, ...]] = ("angle",)

    def heading(self) -> str:
        return f"wing of aspect ratio {self.aspect_ratio:.5g}: {self.status}, estimated error {np.max(self.error):.1e}"

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Circulation along the span at each angle; returns the figure."""
        from ..plot.aero import circulation as draw

        return draw(self, ax=ax)


@result
class WingStart(Result):
    """A wing that starts suddenly: ``lift_coefficient`` (n,) over ``distance`` (n,) m flown, and ``circulation`` (n, m) m over the
    speed at ``place`` (m,) m. ``error``: what steps of twice the length change in the lift, over the largest.
    """

    distance: np.ndarray = quantity(dims=("distance",), unit="m", label="distance flown")
    lift_coefficient: np.ndarray = quantity(dims=("distance",), unit="1", label="lift coefficient")
    place: np.ndarray = quantity(dims=("place",), unit="m", label="place along the span")
    circulation: np.ndarray = quantity(dims=("distance", "place"), unit="m", label="circulation over the wind's speed")

    row: ClassVar[str] = "distance"
    axes: ClassVar[Mapping[str, str]] = {"distance": "distance", "place": "place"}

    def heading(self) -> str:
        return f"impulsive start over {self.distance[-1]:.5g} m: {self.status}, estimated error {self.error:.1e}"

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Lift over the distance flown; returns the figure."""
        from ..plot.aero import start as draw

        return draw(self, ax=ax)


def lifting_line(wing: Blade, angle: ArrayLike, *, strips: int = 80) -> WingLoads:
    """A straight wing in steady wind, with sections that follow their polars and a flat wake along the wind.

        Gamma = W c cl(alpha) / 2,   alpha = angle + twist - atan(w / U),   w = sum dGamma / (4 pi (y - y'))

    Parameters
    ----------
    wing
        As from `mbrs.aero.blade`, with stations in m from one tip to the other; the line is straight and across the wind.
    angle
        (n,) rad, or one number: of the wing to the wind, added to the twist.
    strips
        Along the span, 4 to 4000, even; their edges are spaced as cosines.

    Returns
    -------
    WingLoads
        "converged"; the error falls as 1 / strips^2.

    Raises
    ------
    ModelError
        Angles of attack that a polar does not hold, named with their station.
    ConvergenceError
        Beyond stall, where the law of Kutta and Joukowski may have no solution that Newton's method finds.

    Notes
    -----
    L. Prandtl, "Tragfluegeltheorie", Goettinger Nachrichten (1918); J. Katz and A. Plotkin, "Low-Speed Aerodynamics", section 8.1.
    Cost O(n strips^3).

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> thin = mb.aero.polar([-0.3, 0.3], [-0.6 * np.pi, 0.6 * np.pi], [0.0, 0.0])
    >>> y = -4.0 * np.cos(np.linspace(0.0, np.pi, 801))
    >>> wing = mb.aero.blade(y, 4 / np.pi * np.sqrt(np.maximum(1 - (y / 4.0) ** 2, 0.0)), 0.0, thin)
    >>> (mb.aero.lifting_line(wing, 0.1).lift_coefficient / 0.1).round(2)  # 2 pi / (1 + 2 / 8)
    array([5.03])
    """
    start = time.perf_counter()
    _require_wing("lifting_line", wing)
    alpha = _angles(angle)
    n = _even("lifting_line: strips", strips, 4000)
    full, half = _Strips(wing, n), _Strips(wing, n // 2)
    found, steps = full.steady(alpha)
    coarse, more = half.steady(alpha)
    lift, induced, drag, attack = full.loads(alpha, *found)
    rough_lift, rough_induced, _, _ = half.loads(alpha, *coarse)
    wing.require(full.y, attack)
    change = [np.abs(x - y) / np.max(np.abs(x)) for x, y in ((lift, rough_lift), (induced, rough_induced)) if np.any(x)]
    return WingLoads(
        angle=alpha,
        lift_coefficient=lift,
        induced_drag=induced,
        drag_coefficient=drag,
        place=full.y,
        circulation=found[0],
        angle_of_attack=attack,
        aspect_ratio=full.aspect_ratio,
        stats=Stats(time.perf_counter() - start, {"newton_steps": steps + more}, route="lifting line"),
        error=np.max(change, axis=0) if change else np.zeros(len(alpha)),
    )


def impulsive_start(
    wing: Blade, angle: float, distance: float, *, step: float | None = None, strips: int = 20
) -> WingStart:
    """A straight wing that is suddenly in the wind, with a flat wake that it leaves behind.

    Each step sheds the change of the circulation across the span and trails its differences along the wind. What is shed acts on a
    section as thin-airfoil theory has it, with x the distance from the middle of the chord in half chords b:

        on the circulation   gamma / (2 pi b) (sqrt((x + 1) / (x - 1)) - 1),        on the lift   gamma / (2 pi b) / sqrt(x^2 - 1)

    as the downwash of the finite vortex from the distance at which an infinite one would have this effect. What trails acts at
    the line.

    Parameters
    ----------
    wing, strips
        As for `lifting_line`.
    angle
        rad, one number.
    distance
        m to be flown.
    step
        m; a sixteenth of the mean chord by default, at most ``distance`` / 2.

    Returns
    -------
    WingStart
        "converged"; of first order in the step.

    Raises
    ------
    ModelError, ConvergenceError
        As for `lifting_line`; a distance that is not positive.

    Notes
    -----
    H. Wagner, Z. angew. Math. Mech. 5 (1925) 17; T. von Karman and W. R. Sears, J. Aeronaut. Sci. 5 (1938) 379. The force of
    acceleration at the start itself is not part of it. Cost O((distance / step)^2 strips^2).
    """
    begin = time.perf_counter()
    _require_wing("impulsive_start", wing)
    alpha = _angles(angle)
    length = real_array("impulsive_start: distance", distance)
    if alpha.size != 1 or length.ndim or length <= 0.0:
        raise ModelError(
            f"impulsive_start: one angle and one positive distance, they are {shown(angle)}, {shown(distance)}"
        )
    line = _Strips(wing, _even("impulsive_start: strips", strips, 400))
    h = line.area / line.span / 16.0 if step is None else float(real_array("impulsive_start: step", step))
    if h <= 0.0:
        raise ModelError(f"impulsive_start: the step must be positive, it is {shown(step)}")
    n = max(2 * int(np.ceil(0.5 * float(length) / h)), 2)
    if n > 20000:
        raise ModelError(f"impulsive_start: {n} steps; give a longer step= or a shorter distance")
    require_memory(
        24.0 * n * strips**2, f"the influence of {n} steps on {strips} strips", "give a longer step= or fewer strips="
    )
    x = np.linspace(0.0, float(length), n + 1)[1:]
    circulation, lift, steps = line.start(alpha[0], x)
    _, rough, more = line.start(alpha[0], x[1::2])
    return WingStart(
        distance=x,
        lift_coefficient=lift,
        place=line.y,
        circulation=circulation,
        stats=Stats(time.perf_counter() - begin, {"newton_steps": steps + more}, route="lifting line"),
        error=float(np.max(np.abs(lift[1::2] - rough)) / np.max(np.abs(lift))) if np.any(lift) else 0.0,
    )


def _require_wing(what: str, wing: Any) -> None:
    if not isinstance(wing, Blade):
        raise ModelError(f"{what}: wing must be what mb.aero.blade gives, it is {shown(wing)}")


def _angles(angle: Any) -> np.ndarray:
    alpha = np.atleast_1d(real_array("angle of the wing", angle))
    if alpha.ndim != 1 or not alpha.size or np.any(np.abs(alpha) > 0.5 * np.pi):
        raise ModelError(
            f"the angle of the wing must be one or more numbers within 90 degrees, in radians; it is {shown(angle)}"
        )
    return alpha


def _even(name: str, value: Any, most: int) -> int:
    n = count(name, value, most, 4)
    if n % 2:
        raise ModelError(f"{name} must be even, it is {n}")
    return n


class _Strips:
    """A wing as strips, in wind of 1 m/s. Lengths m, circulations m^2/s, downwash w positive against the lift."""

    def __init__(self, wing: Blade, n: int) -> None:
        first, last = wing.stations[[0, -1]]
        turn = np.linspace(0.0, np.pi, 2 * n + 1)
        along = 0.5 * (first + last) - 0.5 * (last - first) * np.cos(turn)
        self.edges, self.y = along[::2], along[1::2]
        self.width = np.diff(self.edges)
        self.chord, self.twist, self.weights = wing.chords(self.y), wing.twists(self.y), wing.weights(self.y)
        self.wing, self.span = wing, last - first
        self.area = float(0.5 * (wing.chord[1:] + wing.chord[:-1]) @ np.diff(wing.stations))
        self.aspect_ratio = float(self.span**2 / self.area)

    def trailing_influence(self, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
        """(n, n): downwash at the line of the two trailing parts, from ``begin`` to ``end`` (n,) m behind it, of each strip."""
        eta = self.edges[None, :] - self.y[:, None]

        def part(side: slice) -> np.ndarray:
            e = eta[:, side]
            return (_cosine(end[None, :], e) - _cosine(begin[None, :], e)) / (4.0 * np.pi * e)

        return part(slice(1, None)) - part(slice(None, -1))

    def shed_influence(self, distance: np.ndarray) -> np.ndarray:
        """(n, n): downwash of spanwise vortices of the strips, seen from ``distance`` (n, n) m before them."""
        high = self.edges[None, 1:] - self.y[:, None]
        low = self.edges[None, :-1] - self.y[:, None]
        return (high / np.hypot(high, distance) - low / np.hypot(low, distance)) / (4.0 * np.pi * distance)

    def steady(self, alpha: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], int]:
        """Circulation and downwash (k, n) at each angle."""
        zero = np.zeros(len(self.y))
        matrix = self.trailing_influence(zero, zero + np.inf)
        rows, steps = [], 0
        gamma = zero
        for a in alpha:
            gamma, more = self.balance(a, matrix, zero, gamma)
            rows.append(gamma)
            steps += more
        found = np.array(rows)
        return (found, found @ matrix.T), steps

    def balance(self, alpha: float, matrix: np.ndarray, wash: np.ndarray, guess: np.ndarray) -> tuple[np.ndarray, int]:
        """Circulation whose lift is that of the sections, with the downwash matrix @ circulation + wash; by Newton's method."""

        def rest(gamma: np.ndarray) -> np.ndarray:
            w = matrix @ gamma + wash
            attack = alpha + self.twist - np.arctan(w)
            return gamma - 0.5 * np.hypot(1.0, w) * self.chord * self.wing.mix(self.weights, attack)[:, 0]

        gamma = guess
        r = rest(gamma)
        scale = np.max(np.abs(gamma)) + np.max(np.abs(r))
        for step in range(MOST_STEPS):
            if np.max(np.abs(r)) <= BALANCED * scale:
                return gamma, step
            change = np.linalg.solve(self.tangent(alpha, matrix, wash, gamma), r)
            share = 1.0
            for _ in range(MOST_HALVINGS):
                trial = gamma - share * change
                r_trial = rest(trial)
                if np.linalg.norm(r_trial) < (1.0 - 0.1 * share) * np.linalg.norm(r):
                    break
                share *= 0.5
            gamma, r = trial, r_trial
        raise ConvergenceError(
            f"lifting_line: at {np.degrees(alpha):.4g} degrees the circulation misses the polars by {np.max(np.abs(r)) / scale:.1e} "
            "of its size; beyond stall give fewer strips, or smaller angles"
        )

    def tangent(self, alpha: float, matrix: np.ndarray, wash: np.ndarray, gamma: np.ndarray) -> np.ndarray:
        """Derivative of the rest by the circulation."""
        w = matrix @ gamma + wash
        attack, speed = alpha + self.twist - np.arctan(w), np.hypot(1.0, w)
        cl = self.wing.mix(self.weights, attack)[:, 0]
        slope = self.wing.mix(self.weights, attack, slope=True)[:, 0]
        by_wash = 0.5 * self.chord * (w / speed * cl - slope / speed)
        return np.eye(len(gamma)) - by_wash[:, None] * matrix

    def loads(self, alpha: np.ndarray, gamma: np.ndarray, wash: np.ndarray) -> tuple[np.ndarray, ...]:
        """Coefficients (k,) of lift, induced drag and drag; angles of attack (k, n)."""
        tilt, speed = np.arctan(wash), np.hypot(1.0, wash)
        attack = alpha[:, None] + self.twist - tilt
        drag = 0.5 * speed**2 * self.chord * self.wing.mix(self.weights, attack)[..., 1]
        scale = 2.0 / self.area * self.width
        lift = (gamma - drag * np.sin(tilt)) @ scale
        induced = (gamma * wash) @ scale
        return lift, induced, induced + (drag * np.cos(tilt)) @ scale, attack

    def start(self, alpha: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        """Circulation (k, n) and lift coefficient (k,) after the distances x (k,), evenly spaced."""
        h, n, k = x[0], len(self.y), len(x)
        half = 0.5 * self.chord
        on_gamma, on_lift, trail = np.empty((k, n, n)), np.empty((k, n, n)), np.empty((k, n, n))
        last = np.zeros(n)
        for lag in range(k):
            place = 0.75 * self.chord + (NEWEST + lag) * h  # behind the line, of what was shed lag steps ago
            middles = (place[None, :] - 0.25 * self.chord[:, None]) / half[:, None]
            middles = np.maximum(
                middles, 1.0 + NEWEST * h / half[:, None]
            )  # of strips whose trailing edge is further back
            circulation = half[:, None] / (np.sqrt((middles + 1.0) / (middles - 1.0)) - 1.0)
            on_gamma[lag] = self.shed_influence(circulation)
            on_lift[lag] = self.shed_influence(half[:, None] * np.sqrt(middles**2 - 1.0))
            trail[lag] = self.trailing_influence(last, place)
            last = place
        gammas, lifts, steps = np.zeros((k + 1, n)), np.empty(k), 0
        for i in range(k):
            # ring by ring: of age lag, between what was shed lag steps ago and the step before
            older = gammas[i:0:-1]  # ages 1, 2, ..., i
            known = np.einsum("lij,lj->i", trail[1 : i + 1], older)
            released = gammas[i:0:-1] - gammas[i - 1 :: -1] if i else np.zeros((0, n))
            wash = known + np.einsum("lij,lj->i", on_gamma[1 : i + 1], released) - on_gamma[0] @ gammas[i]
            gammas[i + 1], more = self.balance(alpha, trail[0] + on_gamma[0], wash, gammas[i])
            steps += more
            released = np.vstack([gammas[i + 1] - gammas[i], released])
            w = trail[0] @ gammas[i + 1] + known + np.einsum("lij,lj->i", on_lift[: i + 1], released)
            attack = alpha + self.twist - np.arctan(w)
            self.wing.require(self.y, attack)
            force = 0.5 * np.hypot(1.0, w) * self.chord * self.wing.mix(self.weights, attack)[:, 0]
            lifts[i] = force @ (2.0 / self.area * self.width)
        return gammas[1:], lifts, steps


def _cosine(x: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """x / sqrt(x^2 + eta^2) for x that may be infinite."""
    far = np.isinf(x)
    finite = np.where(far, 0.0, x)
    return np.where(far, 1.0, finite / np.hypot(finite, eta))
