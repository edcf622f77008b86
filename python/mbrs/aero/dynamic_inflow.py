"""Rigid rotors whose wind, speed or pitch change in time: blade elements with an induced velocity that lags behind."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from .._lib.checks import choice, count, each, real_number, rising, shown
from ..errors import ModelError
from ..results import Result, Stats, quantity, result
from .lags import lagged
from .momentum import inflow as momentum_inflow
from .rotors import Rotor
from .separation import Separation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

__all__ = ["RotorResponse", "lagging", "rotor_response", "time_constants"]

# Share of the quasi-steady induced velocity that the first lag passes at once, in Oeye's model.
SHARE = 0.6
# Largest axial induction in the time constants: the fit holds below it.
MOST_INDUCTION = 0.5


@result
class RotorResponse(Result):
    """Loads of a rotor over ``time`` (n,) s: ``thrust`` N, ``torque`` N m and ``power`` W (n,) of all blades. At ``place`` (m,) m along
    the blade ``axial_velocity`` (n, m) m/s induced, the mean of the annulus, and ``angle_of_attack`` (n, m) rad of blade 1.
    ``error``: what twice as long steps change in the thrust, over the largest.
    """

    time: np.ndarray = quantity(dims=("time",), unit="s")
    thrust: np.ndarray = quantity(dims=("time",), unit="N")
    torque: np.ndarray = quantity(dims=("time",), unit="N m")
    power: np.ndarray = quantity(dims=("time",), unit="W")
    place: np.ndarray = quantity(dims=("place",), unit="m", label="distance from the axis along the blade")
    axial_velocity: np.ndarray = quantity(dims=("time", "place"), unit="m/s", label="induced axial velocity")
    angle_of_attack: np.ndarray = quantity(dims=("time", "place"), unit="rad", label="angle of attack of blade 1")

    row: ClassVar[str] = "time"
    axes: ClassVar[Mapping[str, str]] = {"time": "time", "place": "place"}

    def heading(self) -> str:
        return f"rotor over {self.time[-1] - self.time[0]:.5g} s, {self.stats.route}: {self.status}, estimated error {self.error:.1e}"

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Thrust over time; returns the figure."""
        from ..plot.aero import response as draw

        return draw(self, ax=ax)


def rotor_response(
    rotor: Rotor,
    t: ArrayLike,
    wind: ArrayLike,
    speed: ArrayLike,
    *,
    pitch: ArrayLike = 0.0,
    yaw: float = 0.0,
    tilt: float = 0.0,
    density: float = 1.225,
    inflow: str = "dynamic-inflow",
    elements: int = 40,
    stall: float = 0.0,
) -> RotorResponse:
    """Loads of a rigid rotor while wind, speed or pitch change, in wind that may come from the side.

        Y + t1 Y' = W + .6 t1 W',   V + t2 V' = Y
        t1 = 1.1 / (1 - 1.3 a) R / U,   t2 = (.39 - .26 (r/R)^2) t1

    W is the induced velocity that balances blade elements and momentum at once, V the one that acts (S. Oeye, in H. Snel and J. G.
    Schepers, ECN-C--94-107 (1995)). In wind at the angle chi of the wake to the axis it grows across the disc towards the side that
    the wind blows to, by 1 + (15 pi / 64) tan(chi / 2) (r/R) cos(psi) (D. M. Pitt and D. A. Peters, Vertica 5 (1981) 21).

    Parameters
    ----------
    rotor
        As from `mbrs.aero.rotor`.
    t
        (n,) s, increasing, at least three.
    wind, speed, pitch
        (n,) or one number: m/s; rad/s; rad added to the rotor's.
    yaw, tilt
        rad, within 60 degrees: the direction of the wind, as for `mbrs.aero.rotor_wake`. Blade 1 points upwards when t begins.
    density
        kg/m^3 of the air.
    inflow
        "dynamic-inflow", or "bem": without lag.
    elements
        Along the blade, 8 to 10000; even.
    stall
        Oeye's dynamic stall: chords of the flow over which the separation of each section of each blade lags behind its angle of
        attack, as ``lag`` of `mbrs.aero.dynamic_stall` (4 is usual); 0 for the static polars.

    Returns
    -------
    RotorResponse
        "converged"; each lag is integrated exactly for an input that is linear between the times: of second order in the steps.

    Raises
    ------
    ModelError
        Shapes that do not fit, wind that is not positive, angles of attack that a polar does not hold.

    Notes
    -----
    The balance is that of the annulus with the axial wind alone; the wind across the axis acts on the sections, blade by blade. Cost
    O(n m) section solutions.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> a = np.linspace(-np.pi, np.pi, 73)
    >>> section = mb.aero.polar(a, np.pi * np.sin(2 * a), 0.01 + np.sin(a) ** 4)
    >>> b = mb.aero.blade([2.0, 10.0, 40.0], [3.0, 3.5, 1.2], np.radians([20.0, 7.0, -2.0]), section)
    >>> t = np.linspace(0.0, 60.0, 601)
    >>> pitch = np.where(t < 10.0, 0.0, 0.05)
    >>> r = mb.aero.rotor_response(mb.aero.rotor(b, 3), t, 8.0, 1.4, pitch=pitch)
    >>> (r.thrust[[50, 102, 600]] / 1e3).round()  # before, just after, long after: the wake takes its time
    array([137.,  90., 105.])
    """
    start = time.perf_counter()
    if not isinstance(rotor, Rotor):
        raise ModelError(f"rotor_response: rotor must be what mb.aero.rotor gives, it is {shown(rotor)}")
    when = rising("rotor_response: t", t)
    choice("inflow of a rotor in time", inflow, ("dynamic-inflow", "bem"))
    m = count("rotor_response: elements", elements, 10000, 8)
    if m % 2:
        raise ModelError(f"rotor_response: elements must be even, it is {m}")
    courses = (("wind", wind), ("speed", speed), ("pitch", pitch))
    given = [each(f"rotor_response: {name}", v, len(when), "times") for name, v in courses]
    if np.any(given[0] <= 0.0):
        raise ModelError(f"rotor_response: wind must be positive, it is {shown(wind)}")
    y, tau, rho = (
        real_number(f"rotor_response: {name}", v) for name, v in (("yaw", yaw), ("tilt", tilt), ("density", density))
    )
    if max(abs(y), abs(tau)) > np.pi / 3.0:
        raise ModelError(f"rotor_response: yaw and tilt must be within 60 degrees, in radians; they are {yaw}, {tilt}")
    direction = np.array([np.cos(y) * np.cos(tau), np.sin(y) * np.cos(tau), np.sin(tau)])
    lag, chords = inflow == "dynamic-inflow", real_number("rotor_response: stall", stall)
    if chords < 0.0:
        raise ModelError(f"rotor_response: stall must not be negative, it is {shown(stall)}")
    full = _loads(rotor, when, given, direction, m, lag, chords)
    coarse = _loads(rotor, when[::2], [v[::2] for v in given], direction, m, lag, chords)
    rotor.blade.require(full["places"], full["angle"].reshape(-1, m))
    thrust = rho * full["thrust"]
    size = np.max(np.abs(full["thrust"]))
    return RotorResponse(
        time=when,
        thrust=thrust,
        torque=rho * full["torque"],
        power=rho * full["torque"] * given[1],
        place=full["places"],
        axial_velocity=full["axial"],
        angle_of_attack=full["angle"][:, 0],
        stats=Stats(
            time.perf_counter() - start,
            {"section_solutions": (len(when) + len(when[::2])) * m},
            route="dynamic inflow" if lag else "blade elements and momentum",
        ),
        error=float(np.max(np.abs(full["thrust"][::2] - coarse["thrust"])) / size) if size else 0.0,
    )


def time_constants(
    induction: np.ndarray, share: np.ndarray, passage: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """The lags t1 and t2 in s at an axial induction, at shares r/R of the radius, for R/U in s; shapes that broadcast."""
    first = 1.1 / (1.0 - 1.3 * np.minimum(induction, MOST_INDUCTION)) * passage
    return first, (0.39 - 0.26 * share**2) * first


def lagging(t: np.ndarray, quasi_steady: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n, m): what follows ``quasi_steady`` (n, m) at times (n,) s with the two lags (n, m) s, at rest when it begins."""
    h = np.diff(t)[:, None]
    rest = (1.0 - SHARE) * quasi_steady
    inner = lagged(h, rest, 0.5 * (first[1:] + first[:-1]))
    return lagged(h, inner + SHARE * quasi_steady, 0.5 * (second[1:] + second[:-1]))


def _loads(
    rotor: Rotor, t: np.ndarray, given: list[np.ndarray], direction: np.ndarray, m: int, lag: bool, stall: float
) -> dict[str, np.ndarray]:
    """Thrust and torque (n,) over the density, axial induced velocity (n, m), angles of attack (n, b, m)."""
    wind, speed, pitch = given
    places, lengths = rotor.elements(m)
    cone, sine = np.cos(rotor.precone), np.sin(rotor.precone)
    annuli = rotor.annuli(places)
    twist = annuli.twist + pitch[:, None]
    air = wind[:, None] * direction
    turning = speed[:, None] * places * cone
    flow = momentum_inflow(replace(annuli, twist=twist), np.broadcast_to(air[:, :1] * cone, turning.shape), turning)
    axial, around = flow.axial, flow.tangential
    share = places * cone / rotor.radius
    if lag:
        induction = np.clip(-axial / (air[:, :1] * cone), 0.0, None)
        lags = time_constants(induction, share, rotor.radius / wind[:, None])
        axial, around = lagging(t, axial, *lags), lagging(t, around, *lags)
    azimuth = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (speed[1:] + speed[:-1]))])
    psi = azimuth[:, None] + 2.0 * np.pi * np.arange(rotor.count) / rotor.count
    out = np.stack([-np.sin(psi), np.cos(psi)], axis=-1)  # y, z of the blades; ahead is x times out
    across = np.einsum("nbk,nk->nb", out, air[:, 1:])
    ahead = np.einsum("nbk,nk->nb", np.stack([-out[..., 1], out[..., 0]], axis=-1), air[:, 1:])
    # the wake leans to where the wind goes
    side = np.hypot(air[:, 1], air[:, 2])
    through = np.maximum(air[:, 0] + axial[:, int(0.7 * m)], 0.1 * air[:, 0])
    lean = 15.0 * np.pi / 64.0 * np.tan(0.5 * np.arctan2(side, through)) / np.where(side > 0.0, side, 1.0)
    skew = 1.0 + (lean[:, None] * across)[..., None] * share
    normal = (air[:, :1] * cone - across * sine)[..., None] + axial[:, None] * skew
    tangential = turning[:, None] - ahead[..., None] + around[:, None]
    phi = np.arctan2(normal, tangential)
    angle = phi - twist[:, None]
    c = annuli.coefficients(angle)
    square = normal**2 + tangential**2
    if stall:
        section = Separation.of(lambda x: annuli.coefficients(x)[..., 0], m)
        passage = stall * rotor.blade.chords(places) / np.sqrt(np.maximum(square, np.finfo(float).tiny))
        c[..., 0] = section.lift(t, angle, passage)[1]
    scale = 0.5 * rotor.blade.chords(places) * lengths * square
    push = scale * (c[..., 0] * np.cos(phi) + c[..., 1] * np.sin(phi))
    drive = scale * (c[..., 0] * np.sin(phi) - c[..., 1] * np.cos(phi))
    return {
        "places": places,
        "thrust": np.sum(push, axis=(1, 2)) * cone,
        "torque": np.sum(drive * places, axis=(1, 2)) * cone,
        "axial": axial,
        "angle": angle,
    }
