"""Rigid rotors with wakes of vortex filaments: prescribed, or free and marched in time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

import numpy as np

from .._lib.checks import choice, count, real_number, shown
from .._lib.progress import Progress
from ..errors import Interrupted, ModelError
from ..results import Result, Stats, quantity, result
from .blades import strips
from .circulation import BALANCED, Balance, bound_circulation
from .lattice import Frame, March, Wake
from .lines import Lines, Sections, rigid_lines
from .momentum import inflow as momentum_inflow
from .rotors import Rotor
from .wake_options import WakeOptions, wake_options
from .wake_paths import Path, hover_path, prescribed, wind_path

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .wake_options import WakeKeywords

__all__ = ["RotorWake", "rotor_wake"]

INFLOWS = ("prescribed-wake", "free-wake")
# Turns over which the loads of a free wake are averaged.
LAST = 3
UNSTEADY = "unsteady wake"
# Fewest turns in hover, where the wake that it began with leaves slowly.
LEAST_HOVER = 10
# Change of the thrust and of the circulation, relative, at which a prescribed wake and its loads agree; steps until then.
AGREED, MOST_ROUNDS = 1e-7, 200


@result
class RotorWake(Result):
    """A rigid rotor with its wake. Coefficients over the tip's speed: C_T = T / (rho pi R^2 (Omega R)^2), C_P = P / (rho pi R^2 (Omega
    R)^3), positive for thrust along the axis and power that the wind gives.

    ``turn`` (n,) turns since the start with ``thrust_coefficient`` and ``power_coefficient`` (n,). At ``place`` (m,) m along the blade,
    averages over blades and the last three turns: ``circulation`` (m,) m over the tip's speed, ``angle_of_attack`` (m,) rad,
    ``lift`` (m,): cl W^2 over (Omega r)^2, and ``axial_velocity`` (m,) induced, over the tip's speed. ``thrust`` and ``power``
    are means of these turns, ``spread`` (2,) half of the largest less the smallest, over the mean. ``wake`` holds the filaments at
    the end, in axes that do not turn. The status is "unsteady wake" for one that is marched, "computed" for a prescribed one that
    agrees with its loads.
    """

    turn: np.ndarray = quantity(dims=("turn",), unit="1", label="turns")
    thrust_coefficient: np.ndarray = quantity(dims=("turn",), unit="1", label="thrust coefficient")
    power_coefficient: np.ndarray = quantity(dims=("turn",), unit="1", label="power coefficient")
    place: np.ndarray = quantity(dims=("place",), unit="m", label="distance from the axis along the blade")
    circulation: np.ndarray = quantity(dims=("place",), unit="m", label="circulation over the tip's speed")
    angle_of_attack: np.ndarray = quantity(dims=("place",), unit="rad", label="angle of attack")
    lift: np.ndarray = quantity(dims=("place",), unit="1", label="lift coefficient over the speed of rotation")
    axial_velocity: np.ndarray = quantity(
        dims=("place",), unit="1", label="induced axial velocity over the tip's speed"
    )
    thrust: float = quantity(unit="1", label="mean thrust coefficient")
    power: float = quantity(unit="1", label="mean power coefficient")
    spread: np.ndarray = quantity(dims=("coefficient",), unit="1", label="spread of thrust and power")
    radius: float = quantity(unit="m", label="radius of the swept circle")
    wake: Wake

    row: ClassVar[str] = "turn"
    axes: ClassVar[Mapping[str, str]] = {"turn": "turn", "place": "place"}

    def heading(self) -> str:
        return (
            f"rotor with {self.stats.route}: {self.status}, thrust coefficient {self.thrust:.5g} +- {self.spread[0] * 100:.2g} %, "
            f"power coefficient {self.power:.5g} +- {self.spread[1] * 100:.2g} %"
        )

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """The filaments that roll up, seen from the side, about the blades; returns the figure."""
        from ..plot.aero import wake as draw

        return draw(self, ax=ax)


def rotor_wake(
    rotor: Rotor,
    tip_speed_ratio: float = np.inf,
    *,
    pitch: float = 0.0,
    yaw: float = 0.0,
    tilt: float = 0.0,
    inflow: str = "free-wake",
    turns: int = 12,
    **options: Unpack[WakeKeywords],
) -> RotorWake:
    """Loads of a rigid rotor in steady wind, or in hover, with a wake of vortex filaments.

    Each blade is a lifting line whose strips carry the circulation that their polars give with the wind at three quarters of the chord.
    Behind it a lattice of trailed and shed filaments rolls up, at the age ``lattice``, into one filament for what lies outboard and one
    for what lies inboard of the largest circulation, at the centres of vorticity and with cores of its second moment.

    Parameters
    ----------
    rotor
        As from `mbrs.aero.rotor`; its losses at tip and hub are not used.
    tip_speed_ratio
        One number; inf is hover, where the blades need a negative pitch to push against the axis.
    pitch
        rad, added to the rotor's.
    yaw, tilt
        rad: direction of the wind (cos yaw cos tilt, sin yaw cos tilt, sin tilt) in axes of the rotor: x is the axis, z up.
    inflow
        "free-wake": filaments move with the velocities at their nodes. "prescribed-wake": they lie where the thrust puts them,
        by momentum theory in wind (a wake that expands and slows down as a vortex cylinder does), by Landgrebe in hover.
    turns
        To be marched, from the prescribed wake; at least 4, for hover at least 10. The means are those of the last three.
    **options
        ``strips`` (16) of a blade, narrow at both ends; ``steps`` (24) of a turn, even; ``lattice`` (pi / 3) rad; ``free_turns`` (2)
        whose nodes move freely, then ``mean_turns`` (2) that go over to the mean velocity of a turn, then ``tail_turns`` (10) of
        a regular helix with prescribed advance. What rolls up inboard moves with mean velocities from the start.
        ``core_radius`` m (.05 of the radius), ``core_growth`` (2e-4, Squire's coefficient), ``core`` ("vatistas") and ``exponent`` (2)
        as of `mbrs.aero.induced_velocity`; ``threads`` (0: as many as the machine has).

    Returns
    -------
    RotorWake
        "unsteady wake" for a free one, with the spread of its last turns; it is never called converged. "computed" for a prescribed
        one whose wake, thrust and circulation agree (else "unresolved"): there is no estimate of what cutting it into filaments changes.

    Raises
    ------
    ModelError
        Options out of their range; angles of attack that a polar does not hold, named with their station.
    Interrupted
        Ctrl-C; ``result`` holds the turns so far.

    Notes
    -----
    Cost O(nodes filaments) a step, twice. The free wake marches by a predictor and corrector of second order after M. J. Bhagwat and
    J. G. Leishman, J. Am. Helicopter Soc. 46 (2001) 59. J. G. Leishman, "Principles of Helicopter Aerodynamics", chapter 10;
    J. Weissinger, NACA TM 1120 (1947); A. J. Landgrebe, J. Am. Helicopter Soc. 17 (1972) 3; H. B. Squire, Aeronaut. Quart. 16 (1965)
    302.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> a = np.linspace(-np.pi, np.pi, 73)
    >>> section = mb.aero.polar(a, np.pi * np.sin(2 * a), 0.01 + np.sin(a) ** 4)
    >>> b = mb.aero.blade([2.0, 10.0, 40.0], [3.0, 3.5, 1.2], np.radians([20.0, 7.0, -2.0]), section)
    >>> w = mb.aero.rotor_wake(mb.aero.rotor(b, 3), 7.0, inflow="prescribed-wake", strips=8)
    >>> w.status, round(2 * 7.0**3 * w.power, 2)  # over that of the wind
    ('computed', 0.43)
    """
    start = time.perf_counter()
    case = _Case.checked(rotor, tip_speed_ratio, pitch, yaw, tilt, _options(rotor, options))
    choice("inflow of a wake", inflow, INFLOWS)
    wake, found, rounds, agreed = case.steady()
    if inflow == "prescribed-wake":
        return case.result([0.0], [found], wake, start, {"rounds": rounds}, "computed" if agreed else "unresolved")
    least = LEAST_HOVER if not case.wind.any() else LAST + 1
    return case.march(wake, found.thrust, count("rotor_wake: turns", turns, 10000, least), start)


def _options(rotor: Any, options: Mapping[str, Any]) -> WakeOptions:
    if not isinstance(rotor, Rotor):
        raise ModelError(f"rotor_wake: rotor must be what mb.aero.rotor gives, it is {shown(rotor)}")
    return wake_options(rotor.radius, **options)


@dataclass(frozen=True)
class _Loads:
    """At one time: thrust and power coefficients, the balance of the circulation, angles, lift, induced axial velocity (b, n)."""

    thrust: float
    power: float
    balance: Balance
    angle: np.ndarray
    lift: np.ndarray
    axial: np.ndarray


@dataclass(frozen=True)
class _Case:
    """A rotor that turns at 1 rad/s about the x axis in a uniform wind (3,) m/s; air of density 1 kg/m^3."""

    rotor: Rotor
    wind: np.ndarray
    lines: Lines
    sections: Sections
    options: WakeOptions

    @classmethod
    def checked(cls, rotor: Rotor, ratio: Any, pitch: Any, yaw: Any, tilt: Any, options: WakeOptions) -> _Case:
        still = isinstance(ratio, float) and ratio == np.inf
        lam = np.inf if still else real_number("rotor_wake: tip_speed_ratio", ratio)
        if not lam > 0.0:
            raise ModelError(f"rotor_wake: tip_speed_ratio must be positive, inf for hover; it is {shown(ratio)}")
        turned = replace(rotor, pitch=rotor.pitch + real_number("rotor_wake: pitch", pitch))
        y, t = real_number("rotor_wake: yaw", yaw), real_number("rotor_wake: tilt", tilt)
        wind = turned.radius / lam * np.array([np.cos(y) * np.cos(t), np.sin(y) * np.cos(t), np.sin(t)])
        _, middles = strips(turned.hub_radius, turned.tip_radius, options.strips)
        sections = Sections.along(turned.blade, middles)
        return cls(turned, wind, rigid_lines(turned, options.strips, 1.0), sections, options)

    def frame(self, step: int) -> Frame:
        """The hub after some steps."""
        c, s = np.cos(step * self.options.turn), np.sin(step * self.options.turn)
        return Frame(np.zeros(3), np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]))

    def air(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) m/s without induction."""
        return np.broadcast_to(self.wind, points.shape)

    def balance(self, wake: Wake, lines: Lines) -> Balance:
        """Circulations of the bound vortices in front of a wake, whose first column is the guess."""
        known = wake.with_circulation(np.zeros(wake.strength.shape[:2])).induced(lines.rear)
        known = known + self.air(lines.rear) - lines.rear_velocity
        return bound_circulation(lines, self.sections, known, wake.influence(lines.rear), wake.strength[..., 0])

    def loads(self, wake: Wake, balance: Balance, lines: Lines) -> _Loads:
        """Loads of the strips in front of a wake that has their circulation."""
        angle, speed, _ = lines.angles(balance.wind)
        coefficients = self.sections.coefficients(angle)
        induced = wake.induced(lines.points)
        wind = induced + self.air(lines.points) - lines.velocity
        force = lines.forces(wind, balance.circulation, coefficients[..., 1] * self.sections.chord)
        r = self.rotor.radius
        area = np.pi * r**2
        torque = np.sum(np.cross(lines.points, force)[..., 0])
        around = np.linalg.norm(lines.velocity, axis=-1)
        lift = coefficients[..., 0] * (speed / around) ** 2
        thrust, power = float(np.sum(force[..., 0]) / (area * r**2)), float(torque / (area * r**3))
        return _Loads(thrust, power, balance, angle, lift, induced[..., 0] / r)

    def path(self, thrust: float) -> Path:
        """A wake for a thrust coefficient over the tip's speed."""
        o, r = self.options, self.rotor.radius
        angle = np.arange(o.lattice + o.far + 1) * o.turn
        speed = self.wind[0]
        if speed == 0.0:
            blade = self.rotor.blade
            span = blade.stations[-1] - blade.stations[0]
            # pitch counts towards the side that lift pushes to; linear over the radius
            washout = -np.degrees(blade.twist[-1] - blade.twist[0]) * np.sign(thrust or 1.0) * r / span
            chord = np.mean(self.sections.chord)
            made = hover_path(thrust, self.rotor.count * chord / (np.pi * r), self.rotor.count, r, washout, angle)
        else:
            made = wind_path(2.0 * thrust * (r / speed) ** 2, speed, r, angle)
        return replace(made, drift=np.array([0.0, *self.wind[1:]]))

    def start(self) -> tuple[np.ndarray, float]:
        """Circulation (b, n) and thrust coefficient of annuli."""
        annuli = self.rotor.annuli(self.sections.places)
        r = self.sections.places * np.cos(self.rotor.precone)
        flow = momentum_inflow(annuli, np.full(len(r), self.wind[0] * np.cos(self.rotor.precone)), r)
        lift = self.sections.coefficients(flow.angle_of_attack)[..., 0]
        gamma = 0.5 * self.sections.chord * flow.speed * lift
        thrust = 0.5 * self.sections.chord * flow.speed**2 * flow.normal * self.lines.width[0]
        radius = self.rotor.radius
        return np.tile(gamma, (self.rotor.count, 1)), float(self.rotor.count * np.sum(thrust) / (np.pi * radius**4))

    def steady(self) -> tuple[Wake, _Loads, int, bool]:
        """The prescribed wake that belongs to the loads that it causes, by relaxed rounds."""
        gamma, thrust = self.start()
        rounds, agreed = 0, False
        while not agreed and rounds < MOST_ROUNDS:
            rounds += 1
            wake = self.wake(gamma, self.path(thrust))
            balance = self.balance(wake, self.lines)
            found = self.loads(wake.with_circulation(balance.circulation), balance, self.lines)
            change = found.balance.circulation - gamma
            size = np.max(np.abs(found.balance.circulation))
            agreed = np.max(np.abs(change)) <= AGREED * size and abs(found.thrust - thrust) <= AGREED * abs(thrust)
            if agreed:
                continue
            gamma = gamma + 0.3 * change
            thrust = thrust + 0.3 * (found.thrust - thrust)
        return wake, found, rounds, bool(agreed and found.balance.residual <= BALANCED)

    def wake(self, gamma: np.ndarray, path: Path) -> Wake:
        """A wake on a path, shed with circulations (b, n)."""
        o = self.options
        ages = (o.lattice, o.far, o.tail)
        return prescribed(self.lines, gamma, path, self.frame(0), o.turn, o.turn, o.cores, ages, o.threads)

    def marching(self, wake: Wake, thrust: float) -> March:
        """The march of a wake that began on the path of a thrust coefficient."""
        still = self.wake(wake.strength[..., 0], replace(self.path(thrust), drift=np.zeros(3)))
        return March(wake, still, [self.frame(-i) for i in range(3)], self.options.turn, self.air, self.options.free)

    def march(self, wake: Wake, thrust: float, turns: int, start: float) -> RotorWake:
        """The free wake, from a prescribed one."""
        o = self.options
        motion = self.marching(wake, thrust)
        when: list[float] = []
        found: list[_Loads] = []
        unbalanced = 0
        total = turns * o.steps
        try:
            with Progress("free wake", total) as progress:
                for step in range(1, total + 1):
                    frame = self.frame(step)
                    lines = self.lines.rotate(frame.rotation)
                    predicted = motion.predict(lines, frame)
                    predicted = predicted.with_circulation(self.balance(predicted, lines).circulation)
                    corrected = motion.correct(predicted, lines, frame)
                    balance = self.balance(corrected, lines)
                    motion.accept(corrected.with_circulation(balance.circulation), frame)
                    unbalanced += balance.residual > BALANCED
                    when.append(step / o.steps)
                    found.append(self.loads(motion.wake, balance, lines))
                    progress.advance(note=f"C_T {found[-1].thrust:.5f}")
        except KeyboardInterrupt:
            made = None
            if found:
                made = self.result(when, found, motion.wake, start, {"unbalanced_steps": unbalanced}, "interrupted")
            raise Interrupted(f"a free wake was interrupted after {len(found) / o.steps:.2f} turns", made) from None
        return self.result(when, found, motion.wake, start, {"unbalanced_steps": unbalanced}, UNSTEADY)

    def result(
        self,
        when: list[float],
        found: list[_Loads],
        wake: Wake,
        start: float,
        counts: dict[str, int],
        status: str,
    ) -> RotorWake:
        """Series and means; the polars must hold the angles of the last turns."""
        o = self.options
        last = found[-LAST * o.steps :]
        if status != "interrupted":
            for one in last:
                self.rotor.blade.require(self.sections.places, one.angle)
        thrust, power = (np.array([getattr(one, name) for one in found]) for name in ("thrust", "power"))
        means, spreads = [], []
        for series in (thrust, power):
            end = series[-LAST * o.steps :]
            means.append(float(np.mean(end)))
            spreads.append(float(0.5 * np.ptp(end) / abs(np.mean(end))))

        def mean(values: Callable[[_Loads], np.ndarray]) -> np.ndarray:
            return np.mean([np.mean(values(one), axis=0) for one in last], axis=0)

        return RotorWake(
            turn=np.array(when),
            thrust_coefficient=thrust,
            power_coefficient=power,
            place=self.sections.places,
            circulation=mean(lambda one: one.balance.circulation) / self.rotor.radius,
            angle_of_attack=mean(lambda one: one.angle),
            lift=mean(lambda one: one.lift),
            axial_velocity=mean(lambda one: one.axial),
            thrust=means[0],
            power=means[1],
            spread=np.array(spreads),
            radius=self.rotor.radius,
            wake=wake,
            stats=Stats(
                time.perf_counter() - start,
                wake.counts | counts,
                route="prescribed wake" if "rounds" in counts else "free wake",
            ),
            error=None if "rounds" in counts else max(spreads),
            status=status,
        )
