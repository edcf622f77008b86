"""Blade element and momentum theory of one annulus: the inflow angle at which both give the same force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import _core

__all__ = ["Annuli", "Inflow", "inflow"]

# Relative step of the slope in the residual. Larger: pieces of fine tables are averaged. Smaller: rounding is taken for a slope,
# which hides a residual. Pinned by test_any_input_has_a_balance.
NEIGHBOUR = 1e-8


@dataclass(frozen=True)
class Annuli:
    """The annuli of a rotor, without the wind.

    ``coefficients`` maps angles of attack (..., m) rad to (..., m, 2 or more): lift, drag; ``twist`` (m,) rad of the section to
    the plane of rotation, pitch included; ``solidity`` (m,) blades times chord over 2 pi r; ``loss`` (k, m): exponents e of the
    factors (2/pi) acos(exp(-e / |sin phi|)) of Prandtl's losses.
    """

    coefficients: Callable[[np.ndarray], np.ndarray]
    twist: np.ndarray
    solidity: np.ndarray
    loss: np.ndarray


@dataclass(frozen=True)
class Inflow:
    """The flow at the sections, each (..., m): ``angle`` phi rad of the relative wind to the plane of rotation,
    ``angle_of_attack`` rad, ``speed`` m/s of the relative wind, ``axial`` and ``tangential`` induced velocities m/s (added to the
    wind's), ``normal`` and ``driving`` force coefficients, ``loss`` F, and ``residual`` rad: the change of ``angle`` by which, to
    first order, the direction of the wind that belongs to it would be that of the wind that blows.
    """

    angle: np.ndarray
    angle_of_attack: np.ndarray
    speed: np.ndarray
    axial: np.ndarray
    tangential: np.ndarray
    normal: np.ndarray
    driving: np.ndarray
    loss: np.ndarray
    residual: np.ndarray
    steps: int


def inflow(annuli: Annuli, axial: np.ndarray, tangential: np.ndarray) -> Inflow:
    """Balance of blade elements and momentum in annuli that do not act upon each other.

        phi + atan2(s cl, 4 F |sin phi| + s cd) = atan2(axial, tangential),   s the solidity

    The wind and the force of a section that meets the relative wind at phi give, with 4 F |u| du of axial and tangential
    momentum, the wind far away as a vector whose direction is the left side. It is continuous in phi, and the arc tangent is at
    most pi/2 where drag is not negative: there is always a root within pi/2 of the wind's direction. Where k = s cn / (4 F sin^2
    phi) exceeds 2/3 while the wind blows through the rotor (phi > 0), 1/(1 - a) is

        5/3 - F + sqrt(s cn / (2 sin^2 phi) - F (4/3 - F))

    instead of 1 + k: Buhl's parabola of the thrust, solved for a without its singularity. The left side then runs from at most
    the wind's direction at phi = 0 to at least it at pi, which brackets the root. Annuli that take more than this are reversed
    (phi < 0), with momentum theory: hover is among them.

    Parameters
    ----------
    annuli
        The m sections.
    axial, tangential
        (..., m) m/s, of any sign: the wind relative to the sections without induction. A rotor turns against ``tangential``.

    Returns
    -------
    Inflow

    Notes
    -----
    S. A. Ning, "A simple solution method for the blade element momentum equations with guaranteed convergence", Wind Energy 17
    (2014) 1327: the same equations, in one unknown. M. L. Buhl, NREL/TP-500-36834 (2005). Sections are solved side by side by
    T. R. Chandrupatla's method (Adv. Eng. Software 28 (1997) 145) with some ten evaluations of the polars.
    """
    vx, vy = np.broadcast_arrays(np.asarray(axial, dtype=float), np.asarray(tangential, dtype=float))
    balance = _Balance(annuli, np.where(vx < 0.0, -1.0, 1.0), np.where(vy < 0.0, -1.0, 1.0))
    wind = np.arctan2(np.abs(vx), np.abs(vy))
    low, high, empirical = _brackets(balance, wind)
    phi, steps = _roots(lambda p: balance.direction(p, empirical) - wind, low, high)
    return balance.flow(phi, empirical, np.hypot(vx, vy), wind, (vx, vy), steps)


class _Balance:
    """The equations for winds of positive components: others are mirrored, which turns the sign of the lift."""

    def __init__(self, annuli: Annuli, sign_x: np.ndarray, sign_y: np.ndarray) -> None:
        self.annuli, self.sx, self.sy = annuli, sign_x, sign_y

    def forces(self, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Angle of attack, solidity times lift and drag, loss factor."""
        alpha = np.arctan2(self.sx * np.sin(phi), self.sy * np.cos(phi)) - self.annuli.twist
        c = self.annuli.coefficients(alpha)
        sigma = self.annuli.solidity
        return alpha, sigma * self.sx * self.sy * c[..., 0], sigma * c[..., 1], loss_factor(self.annuli.loss, phi)

    def wind(self, phi: np.ndarray, empirical: np.ndarray) -> tuple[np.ndarray, ...]:
        """Tangential and axial component of the wind far away, over that of the relative wind times 4 F |sin phi|."""
        alpha, lift, drag, f = self.forces(phi)
        s, c = np.sin(phi), np.cos(phi)
        tangential = 4.0 * f * np.abs(s) * c + drag * c - lift * s
        normal = lift * c + drag * s
        axial = 4.0 * f * np.abs(s) * s + normal
        above = empirical & (s > 0.0) & (normal > 4.0 * _core.HIGH_LOAD * f * s**2)
        root = np.sqrt(np.where(above, 0.5 * normal - f * (4.0 / 3.0 - f) * s**2, 0.0))
        axial = np.where(above, 4.0 * f * s * ((5.0 / 3.0 - f) * s + root), axial)
        return tangential, axial, above, alpha, lift, drag, f

    def direction(self, phi: np.ndarray, empirical: np.ndarray) -> np.ndarray:
        """Direction of that wind, continuous in phi."""
        tangential, axial, above, _, lift, drag, f = self.wind(phi, empirical)
        momentum = phi + np.arctan2(lift, 4.0 * f * np.abs(np.sin(phi)) + drag)
        return np.where(above, np.arctan2(axial, tangential), momentum)

    def flow(
        self,
        phi: np.ndarray,
        empirical: np.ndarray,
        speed: np.ndarray,
        wind: np.ndarray,
        given: tuple[np.ndarray, np.ndarray],
        steps: int,
    ) -> Inflow:
        """The flow at the roots, evaluated afresh."""
        tangential, axial, _, alpha, lift, drag, f = self.wind(phi, empirical)
        s, c = np.sin(phi), np.cos(phi)
        size = np.hypot(tangential, axial)
        relative = np.where(size > 0.0, 4.0 * f * np.abs(s) * speed / np.where(size > 0.0, size, 1.0), 0.0)
        sigma = np.where(self.annuli.solidity > 0.0, self.annuli.solidity, 1.0)
        return Inflow(
            angle=np.arctan2(self.sx * s, self.sy * c),
            angle_of_attack=alpha,
            speed=relative,
            axial=self.sx * relative * s - given[0],
            tangential=self.sy * relative * c - given[1],
            normal=self.sx * (lift * c + drag * s) / sigma,
            driving=self.sy * (lift * s - drag * c) / sigma,
            loss=f,
            residual=self.residual(phi, empirical, wind),
            steps=steps,
        )

    def residual(self, phi: np.ndarray, empirical: np.ndarray, wind: np.ndarray) -> np.ndarray:
        """Distance of the directions over one plus its slope, which steep tables make large."""
        h = NEIGHBOUR * np.abs(phi)
        rise = np.abs(self.direction(phi + h, empirical) - self.direction(phi - h, empirical))
        return np.abs(self.direction(phi, empirical) - wind) / (1.0 + rise / np.where(h > 0.0, 2.0 * h, 1.0))


def loss_factor(exponents: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """(..., m) product of Prandtl's factors F = (2/pi) acos(exp(-e / |sin phi|)) with exponents e (k, m)."""
    s = np.maximum(np.abs(np.sin(phi)), np.finfo(float).tiny)
    total = np.ones(np.broadcast_shapes(np.shape(phi), exponents.shape[1:]))
    for e in exponents:
        total = total * (2.0 / np.pi) * np.arccos(np.exp(-np.minimum(e / s, 700.0)))
    return total


def _brackets(balance: _Balance, wind: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ends between which the direction passes that of the wind, and whether Buhl's parabola takes part."""
    low, high = np.full(wind.shape, _core.SMALLEST_INFLOW), np.full(wind.shape, np.pi)
    on, off = np.ones(wind.shape, dtype=bool), np.zeros(wind.shape, dtype=bool)
    through = (balance.direction(low, on) < wind) & (balance.direction(high, on) >= wind)
    reversed_ = ~through & (balance.direction(low, off) >= wind)
    low = np.where(through, _core.SMALLEST_INFLOW, np.where(reversed_, -np.pi, wind - 0.5 * np.pi))
    high = np.where(through, np.pi, np.where(reversed_, _core.SMALLEST_INFLOW, wind + 0.5 * np.pi))
    return low, high, through


def _roots(function: Callable[[np.ndarray], np.ndarray], low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, int]:
    """Roots, one in each bracket, to the last bits: Chandrupatla's inverse quadratic steps where safe, else bisection."""
    a, b = low.copy(), high.copy()  # a is the newest, the root is between a and b, c is the one before
    fa, fb = function(a), function(b)
    share = np.full(a.shape, 0.5)
    best = np.where(np.abs(fa) < np.abs(fb), a, b)
    for step in range(1, _core.MOST_ANNULUS_STEPS + 1):
        x = a + share * (b - a)
        fx = function(x)
        same = np.sign(fx) == np.sign(fa)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, fx
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        least = 2.0 * np.finfo(float).eps * np.abs(best) + np.finfo(float).tiny
        width = np.abs(b - a)
        if np.all((width <= 2.0 * least) | (fa == 0.0) | (fb == 0.0)):
            return best, step
        floor = np.minimum(least / np.where(width > 0.0, width, 1.0), 0.5)
        share = np.full(a.shape, 0.5) if step % 3 == 0 else _share(a, b, c, fa, fb, fc)
        share = np.clip(share, floor, 1.0 - floor)
    return best, _core.MOST_ANNULUS_STEPS


def _share(a: np.ndarray, b: np.ndarray, c: np.ndarray, fa: np.ndarray, fb: np.ndarray, fc: np.ndarray) -> np.ndarray:
    """The next point between a and b as a share: the inverse parabola through all three where it is monotone, else the middle."""
    with np.errstate(all="ignore"):
        xi, ratio = (a - b) / (c - b), (fa - fb) / (fc - fb)
        safe = (ratio**2 < xi) & ((1.0 - ratio) ** 2 < 1.0 - xi)
        t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    return np.where(safe & np.isfinite(t), t, 0.5)
