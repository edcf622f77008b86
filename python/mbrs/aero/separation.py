"""Oeye's dynamic stall: the lift of a section whose flow separates and attaches with a lag."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from .._lib.checks import each, rising, shown
from ..errors import ModelError
from ..model.attached_lift import attached_line
from ..results import Result, Stats, quantity, result
from .lags import lagged
from .polars import Polar

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

__all__ = ["LAG", "Separation", "StallResponse", "dynamic_stall"]

# Oeye's time constant, in chords over the speed of the flow.
LAG = 4.0


@dataclass(frozen=True, eq=False)
class Separation:
    """The static lift of sections as that of a flow that is attached over the part f of the chord (Kirchhoff).

        cl = f cl_att + (1 - f) cl_sep,   cl_att = slope (alpha - zero),   cl = cl_att ((1 + sqrt(f)) / 2)^2

    ``static`` gives lifts (..., m) at angles (..., m) rad; ``slope`` 1/rad and ``zero`` rad are (m,), as of
    `attached_line`.
    """

    static: Callable[[np.ndarray], np.ndarray]
    slope: np.ndarray
    zero: np.ndarray

    @classmethod
    def of(cls, static: Callable[[np.ndarray], np.ndarray], n: int) -> Separation:
        """The separation of n sections by their lift over the angle; lift that does not grow through zero has no attached part."""
        return cls(static, *attached_line(static, n))

    def parts(self, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(..., m) each: the attached part f that the static lift tells, cl_att, cl_sep."""
        lift = self.static(angle)
        attached = self.slope * (angle - self.zero)
        share = np.clip(lift / np.where(attached == 0.0, 1.0, attached), 0.0, 1.0)
        share = np.where(attached == 0.0, 1.0, share)
        root = np.sqrt(share)
        f = np.where(share > 0.25, (2.0 * root - 1.0) ** 2, 0.0)
        # (cl - f cl_att) / (1 - f), without its quotient of two zeros
        separated = np.where(share > 0.25, attached * (3.0 * root - 1.0) / np.where(root > 0.0, 4.0 * root, 1.0), lift)
        return f, attached, separated

    def lift(self, t: np.ndarray, angle: np.ndarray, passage: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """f and lift (n, ...) over times (n,) s, steady when they begin; ``passage`` (n, ...) s is the lag."""
        static, attached, separated = self.parts(angle)
        h = np.diff(t).reshape(-1, *[1] * (angle.ndim - 1))
        f = lagged(h, static, 0.5 * (passage[1:] + passage[:-1]))
        # where all is as in steady flow the table itself, its reversed flow included
        return f, self.static(angle) + (f - static) * (attached - separated)


@result
class StallResponse(Result):
    """A section over ``time`` (n,) s: ``angle_of_attack`` rad, ``attached`` (n,) the part of the chord with attached flow, ``lift``,
    ``static_lift`` (n,) coefficients. ``error``: what twice as long steps change in the lift, over the largest.
    """

    time: np.ndarray = quantity(dims=("time",), unit="s")
    angle_of_attack: np.ndarray = quantity(dims=("time",), unit="rad", label="angle of attack")
    attached: np.ndarray = quantity(dims=("time",), unit="1", label="attached part of the chord")
    lift: np.ndarray = quantity(dims=("time",), unit="1", label="lift coefficient")
    static_lift: np.ndarray = quantity(dims=("time",), unit="1", label="lift coefficient of steady flow")

    row: ClassVar[str] = "time"
    axes: ClassVar[Mapping[str, str]] = {"time": "time"}

    def heading(self) -> str:
        return (
            f"dynamic stall over {self.time[-1] - self.time[0]:.5g} s: lift coefficient up to {np.max(self.lift):.5g} (steady flow "
            f"{np.max(self.static_lift):.5g}), estimated error {self.error:.1e}"
        )

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Lift over the angle of attack, in time (full) and in steady flow (dashed); returns the figure."""
        from ..plot.aero import stall as draw

        return draw(self, ax=ax)


def dynamic_stall(
    polar: Polar, t: ArrayLike, angle: ArrayLike, speed: ArrayLike, chord: float, *, lag: float = LAG
) -> StallResponse:
    """Lift of a section whose separation lags behind its angle of attack.

        tau f' = f_st(alpha) - f,   tau = lag c / |u|,   cl = f cl_att(alpha) + (1 - f) cl_sep(alpha)

    f_st is the attached part of the chord that gives the static lift, cl = cl_att ((1 + sqrt(f_st)) / 2)^2 (Kirchhoff), cl_att the
    straight line of attached flow and cl_sep what makes both static lifts equal.

    Parameters
    ----------
    polar
        As from `mbrs.aero.polar`.
    t
        (n,) s, increasing, at least three.
    angle, speed
        (n,) or one number: rad; m/s of the wind across the section, positive.
    chord
        m.
    lag
        Chords that the flow passes in the time tau; 4 after Oeye.

    Returns
    -------
    StallResponse
        "converged"; the lag is integrated exactly for an f_st that is linear between the times: of second order in the steps. The
        motion begins as steady flow.

    Raises
    ------
    ModelError
        Shapes that do not fit, times that do not increase, numbers that are not positive, angles that the polar does not hold.

    Notes
    -----
    S. Oeye, "Dynamic stall simulated as time lag of separation", Proc. 4th IEA Symposium on the Aerodynamics of Wind Turbines, ETSU-N-118
    (1991); the closed form of cl_sep: M. H. Hansen, M. Gaunaa, H. A. Madsen, Risoe-R-1354 (2004). Drag and moment are not part
    of it. Cost O(n).

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> a = np.radians(np.arange(-30.0, 31.0))
    >>> p = mb.aero.polar(a, np.sin(6 * a) * np.exp(-2 * a**2), 0.01 + a**2)
    >>> t = np.linspace(0.0, 2.0, 401)
    >>> r = mb.aero.dynamic_stall(p, t, np.radians(12 + 8 * np.sin(2 * np.pi * t)), speed=30.0, chord=1.0)
    >>> bool(r.lift.max() > 1.05 * r.static_lift.max())
    True
    """
    start = time.perf_counter()
    if not isinstance(polar, Polar):
        raise ModelError(f"dynamic_stall: polar must be what mb.aero.polar gives, it is {shown(polar)}")
    when = rising("dynamic_stall: t", t)
    a, u = (each(f"dynamic_stall: {name}", v, len(when), "times") for name, v in (("angle", angle), ("speed", speed)))
    c, chords = (each(f"dynamic_stall: {name}", v, 1, "sections")[0] for name, v in (("chord", chord), ("lag", lag)))
    if np.any(u <= 0.0) or c <= 0.0 or chords <= 0.0:
        raise ModelError("dynamic_stall: speed, chord and lag must be positive")
    if not np.all(polar.covers(a)):
        worst = np.degrees(a[np.argmin(polar.covers(a))])
        raise ModelError(
            f"polar {polar.name!r} covers {np.degrees(polar.angle[0]):.4g} to {np.degrees(polar.angle[-1]):.4g} degrees, but the angle of "
            f"attack becomes {worst:.4g} degrees; give a longer table, or ask for .extend(aspect_ratio=...)"
        )
    section = Separation.of(lambda x: polar.clip_values(x)[..., 0], 1)
    passage = (chords * c / u)[:, None]
    f, lift = section.lift(when, a[:, None], passage)
    coarse = section.lift(when[::2], a[::2, None], passage[::2])[1]
    static = section.static(a[:, None])[:, 0]
    size = np.max(np.abs(lift))
    return StallResponse(
        time=when,
        angle_of_attack=a,
        attached=f[:, 0],
        lift=lift[:, 0],
        static_lift=static,
        stats=Stats(time.perf_counter() - start, {"steps": len(when) - 1}, route="lag of the separation"),
        error=float(np.max(np.abs(lift[::2] - coarse)) / size) if size else 0.0,
    )
