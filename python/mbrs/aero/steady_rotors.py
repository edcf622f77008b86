"""Coefficients of rotors in steady wind along their axis, over tip speed ratios."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

import numpy as np

from .._lib.checks import choice, count, real_array, real_number, shown
from ..errors import Interrupted, ModelError
from ..results import Result, Stats, added_counts, quantity, result
from .coupled import rotor_of
from .momentum import Inflow
from .momentum import inflow as momentum_inflow
from .rotor_wakes import INFLOWS, RotorWake, rotor_wake
from .rotors import Rotor

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from .wake_options import WakeKeywords

__all__ = ["Performance", "performance"]

# Inflow angles, in rad, by which a root may miss the balance of blade elements and momentum. Larger: loads that do not balance
# are called converged. Smaller: rounding is called unresolved. Pinned by test_any_input_has_a_balance.
BALANCED = 1e-9
MOMENTUM = "blade elements and momentum"


@result
class Performance(Result):
    """Power, thrust and torque coefficients of a rotor over tip speed ratios.

    ``tip_speed_ratio`` (n,), ``power_coefficient``, ``thrust_coefficient``, ``torque_coefficient`` (n,); at ``place`` (m,) m along
    the blade ``axial_induction`` and ``angle_of_attack`` (n, m) rad; ``radius`` m of the swept circle. ``error`` (n,): what half
    as many elements change, over the largest coefficient: of power and thrust the larger; with a free wake half the span of their values
    in the last three turns, over the mean; None with a prescribed one.
    """

    tip_speed_ratio: np.ndarray = quantity(dims=("tip_speed_ratio",), unit="1", label="tip speed ratio")
    power_coefficient: np.ndarray = quantity(dims=("tip_speed_ratio",), unit="1", label="power coefficient")
    thrust_coefficient: np.ndarray = quantity(dims=("tip_speed_ratio",), unit="1", label="thrust coefficient")
    torque_coefficient: np.ndarray = quantity(dims=("tip_speed_ratio",), unit="1", label="torque coefficient")
    place: np.ndarray = quantity(dims=("place",), unit="m", label="distance from the axis along the blade")
    axial_induction: np.ndarray = quantity(dims=("tip_speed_ratio", "place"), unit="1", label="axial induction")
    angle_of_attack: np.ndarray = quantity(dims=("tip_speed_ratio", "place"), unit="rad", label="angle of attack")
    radius: float = quantity(unit="m", label="radius of the swept circle")

    row: ClassVar[str] = "tip_speed_ratio"
    axes: ClassVar[Mapping[str, str]] = {"tip_speed_ratio": "tip_speed_ratio", "place": "place"}
    error_dims: ClassVar[tuple[str, ...]] = ("tip_speed_ratio",)

    def power(self, speed: ArrayLike, density: float = 1.225) -> np.ndarray:
        """W: power at each tip speed ratio in wind of ``speed`` m/s (one, or one for each) and air of ``density`` kg/m^3."""
        return self.power_coefficient * self._force(speed, density) * np.asarray(speed, dtype=float)

    def thrust(self, speed: ArrayLike, density: float = 1.225) -> np.ndarray:
        """N: thrust along the axis; arguments as for `power`."""
        return self.thrust_coefficient * self._force(speed, density)

    def torque(self, speed: ArrayLike, density: float = 1.225) -> np.ndarray:
        """N m: torque about the axis; arguments as for `power`."""
        return self.torque_coefficient * self._force(speed, density) * self.radius

    def _force(self, speed: Any, density: float) -> np.ndarray:
        return 0.5 * density * np.pi * self.radius**2 * np.asarray(speed, dtype=float) ** 2

    def heading(self) -> str:
        best = int(np.argmax(self.power_coefficient))
        return (
            f"rotor performance: {self.status}, largest power coefficient {self.power_coefficient[best]:.6g} at tip speed ratio "
            f"{self.tip_speed_ratio[best]:.6g}"
        )

    def notes(self) -> list[str]:
        """Sentences on conditions in which momentum theory does not hold."""
        empirical = np.mean(self.axial_induction > 0.4)
        if self.error is None:
            return ["no estimate of what cutting the wake into filaments changes"]
        if self.stats.route != MOMENTUM:
            return [f"half the span of the last turns over the mean: up to {np.max(self.error):.1e}"]
        lines = [f"estimated error {np.max(self.error):.1e}: {len(self.place)} elements against half as many"]
        if empirical:
            lines.append(
                f"{100 * empirical:.0f} % of the sections have an axial induction above 0.4, where Buhl's empirical law acts"
            )
        return lines

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Power and thrust coefficients over the tip speed ratio; returns the figure."""
        from ..plot.aero import performance as draw

        return draw(self, ax=ax)


def performance(
    rotor: Rotor,
    tip_speed_ratio: ArrayLike,
    *,
    pitch: float = 0.0,
    elements: int = 80,
    inflow: str = "bem",
    **wake: Unpack[WakeKeywords],
) -> Performance:
    """Coefficients of a rigid rotor in steady uniform wind along its axis, without structure.

        C_P = P / (rho A U^3 / 2),   C_T = T / (rho A U^2 / 2),   C_Q = C_P / lambda,   lambda = Omega R / U

    Parameters
    ----------
    rotor
        As from `mbrs.aero.rotor`; or a model with `Model.aerodynamics`, whose blades are taken as rigid.
    tip_speed_ratio
        (n,) or one number: lambda, positive.
    pitch
        rad, added to the rotor's.
    elements
        Along the blade, 8 to 10000; even. A wake has ``strips`` instead.
    inflow
        "bem": blade elements and momentum. "prescribed-wake", "free-wake": `mbrs.aero.rotor_wake` at each tip speed ratio.
    **wake
        Options of `mbrs.aero.rotor_wake`.

    Returns
    -------
    Performance
        "converged" where blade elements and momentum balance in every section; ``error`` from half as many elements. With a wake what
        its status is; ``error`` is then the spread of the last turns, None for a prescribed wake.

    Raises
    ------
    ModelError
        A tip speed ratio that is not positive; angles of attack that a polar does not hold, named with their station.
    Interrupted
        Ctrl-C; ``result`` holds the tip speed ratios that were finished, None without any.

    Notes
    -----
    Sections and their balance: see `mbrs.aero.momentum.inflow` (S. A. Ning, Wind Energy 17 (2014) 1327). Integrals by Fejer's first
    rule, whose places are dense at root and tip; kinks of chord and twist at the stations limit it to about 1/m^2. Cost O(n m)
    section solutions.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> a = np.linspace(-np.pi, np.pi, 73)
    >>> section = mb.aero.polar(a, np.pi * np.sin(2 * a), 0.01 + np.sin(a) ** 4)
    >>> b = mb.aero.blade([2.0, 10.0, 40.0], [3.0, 3.5, 1.2], np.radians([20.0, 7.0, -2.0]), section)
    >>> p = mb.aero.performance(mb.aero.rotor(b, 3), tip_speed_ratio=[6.0, 7.0])
    >>> p.status, p.power_coefficient.round(3)
    ('converged', array([0.444, 0.461]))
    """
    start = time.perf_counter()
    if getattr(rotor, "airs", None):
        rotor = rotor_of(rotor)
    if not isinstance(rotor, Rotor):
        raise ModelError(
            f"performance: rotor must be what mb.aero.rotor gives, or a model with m.aerodynamics(...), it is {shown(rotor)}"
        )
    ratio = np.atleast_1d(real_array("performance: tip_speed_ratio", tip_speed_ratio))
    if ratio.ndim != 1 or not ratio.size or np.any(ratio <= 0.0):
        raise ModelError(f"performance: tip_speed_ratio must be positive numbers, it is {shown(tip_speed_ratio)}")
    if choice("inflow of a rotor", inflow, ("bem", *INFLOWS)) != "bem":
        return _with_wake(rotor, ratio, pitch, inflow, wake, start)
    if wake:
        raise ModelError(f'performance: {", ".join(wake)} are options of a wake, inflow is "bem"')
    n = count("performance: elements", elements, 10000, 8)
    if n % 2:
        raise ModelError(f"performance: elements must be even, since half as many estimate the error; it is {n}")
    turned = replace(rotor, pitch=rotor.pitch + real_number("performance: pitch", pitch))
    power, thrust, flow = _integrals(turned, ratio, n)
    half_power, half_thrust, half = _integrals(turned, ratio, n // 2)
    places, _ = turned.elements(n)
    turned.blade.require(places, flow.angle_of_attack)
    balanced = max(np.max(flow.residual), np.max(half.residual)) <= BALANCED
    change = [np.abs(x - y) / np.max(np.abs(x)) for x, y in ((power, half_power), (thrust, half_thrust)) if np.any(x)]
    return Performance(
        tip_speed_ratio=ratio,
        power_coefficient=power,
        thrust_coefficient=thrust,
        torque_coefficient=power / ratio,
        place=places,
        axial_induction=-flow.axial / np.cos(turned.precone),
        angle_of_attack=flow.angle_of_attack,
        radius=turned.radius,
        stats=Stats(
            wall_time=time.perf_counter() - start,
            counts={"section_solutions": ratio.size * (n + n // 2), "polar_evaluations": flow.steps + half.steps},
            route=MOMENTUM,
        ),
        error=np.max(change, axis=0) if change else np.zeros(ratio.size),
        status="converged" if balanced else "unresolved",
    )


def _with_wake(
    rotor: Rotor, ratio: np.ndarray, pitch: Any, inflow: str, options: WakeKeywords, start: float
) -> Performance:
    """A wake at each tip speed ratio."""
    done: list[RotorWake] = []
    try:
        for one in ratio:
            done.append(
                rotor_wake(rotor, float(one), pitch=real_number("performance: pitch", pitch), inflow=inflow, **options)
            )
    except Interrupted:
        made = _collected(rotor, ratio, done, inflow, start, "interrupted") if done else None
        text = f"the performance of a rotor was interrupted after {len(done)} of {len(ratio)} tip speed ratios"
        raise Interrupted(text, made) from None
    worst = next((w.status for w in done if w.status == "unresolved"), done[0].status)
    return _collected(rotor, ratio, done, inflow, start, worst)


def _collected(
    rotor: Rotor, ratio: np.ndarray, done: list[RotorWake], inflow: str, start: float, status: str
) -> Performance:
    lam = ratio[: len(done)]
    power = np.array([w.power for w in done]) * 2.0 * lam**3
    return Performance(
        tip_speed_ratio=lam,
        power_coefficient=power,
        thrust_coefficient=np.array([w.thrust for w in done]) * 2.0 * lam**2,
        torque_coefficient=power / lam,
        place=done[0].place,
        axial_induction=np.array([-w.axial_velocity * x for w, x in zip(done, lam, strict=True)])
        / np.cos(rotor.precone),
        angle_of_attack=np.array([w.angle_of_attack for w in done]),
        radius=done[0].radius,
        stats=Stats(time.perf_counter() - start, added_counts(*done), route=inflow.replace("-", " ")),
        error=None if any(w.error is None for w in done) else np.array([w.error for w in done]),
        status=status,
    )


def _integrals(rotor: Rotor, ratio: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, Inflow]:
    """Power and thrust coefficients (k,) and the flow at n elements, in wind of 1 m/s."""
    places, lengths = rotor.elements(n)
    cone = np.cos(rotor.precone)
    speed = ratio / rotor.radius
    flow = momentum_inflow(rotor.annuli(places), np.full((ratio.size, n), cone), speed[:, None] * places * cone)
    # over rho / 2, and the area pi R^2
    scale = rotor.count * rotor.blade.chords(places) * lengths * flow.speed**2 / (np.pi * rotor.radius**2)
    thrust = np.sum(scale * flow.normal, axis=-1) * cone
    torque = np.sum(scale * flow.driving * places, axis=-1) * cone
    return torque * speed, thrust, flow
