"""Rigid rotors with wakes of vortex filaments: prescribed, or free and marched in time."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from .._lib.checks import choice, count, real_array, shown
from .._lib.progress import Progress
from ..errors import Interrupted, ModelError
from ..results import Result, Stats, quantity, result
from .circulation import BALANCED, Balance, bound_circulation
from .filaments import CORES
from .lattice import Cores, Frame, March, Wake
from .lines import Lines, Sections, rigid_lines, strips
from .momentum import inflow as momentum_inflow
from .rotors import Rotor
from .wake_paths import Path, hover_path, prescribed, wind_path

__all__ = ["RotorWake", "rotor_wake"]

INFLOWS = ("prescribed-wake", "free-wake")
# Turns over which the loads of a free wake are averaged.
LAST = 3
# Change of the thrust and of the circulation, relative, at which a prescribed wake and its loads agree; steps until then.
AGREED, MOST_ROUNDS = 1e-7, 200


@result
class RotorWake(Result):
    """A rigid rotor with its wake. Coefficients over the tip's speed: C_T = T / (rho pi R^2 (Omega R)^2), C_P = P / (rho pi R^2 (Omega
    R)^3), positive for thrust along the axis and power that the wind gives.

    ``turn`` (n,) turns since the start with ``thrust_coefficient`` and ``power_coefficient`` (n,); at ``place`` (m,) m along the
    blade ``circulation`` (m,) m over the tip's speed, ``angle_of_attack`` (m,) rad, ``lift`` (m,): c cl W^2 over c (Omega r)^2 --
    averages over blades and the last three turns, with ``thrust``, ``power`` and their ``spread`` (2,): half of largest less smallest
    then, over the mean. ``wake`` is a `mbrs.aero.lattice.Wake` in rotor axes. "unsteady wake" for one that is marched, which is what
    it is; "converged" for a prescribed one.
    """

    turn: np.ndarray = quantity(dims=("turn",), unit="1", label="turns")
    thrust_coefficient: np.ndarray = quantity(dims=("turn",), unit="1", label="thrust coefficient")
    power_coefficient: np.ndarray = quantity(dims=("turn",), unit="1", label="power coefficient")
    place: np.ndarray = quantity(dims=("place",), unit="m", label="distance from the axis along the blade")
    circulation: np.ndarray = quantity(dims=("place",), unit="m", label="circulation over the tip's speed")
    angle_of_attack: np.ndarray = quantity(dims=("place",), unit="rad", label="angle of attack")
    lift: np.ndarray = quantity(dims=("place",), unit="1", label="lift coefficient over the speed of rotation")
    thrust: float = quantity(unit="1", label="mean thrust coefficient")
    power: float = quantity(unit="1", label="mean power coefficient")
    spread: np.ndarray = quantity(dims=("of",), unit="1", label="spread of thrust and power")
    radius: float = quantity(unit="m", label="radius of the swept circle")
    wake: Wake

    row: ClassVar[str] = "turn"
    axes: ClassVar[Mapping[str, str]] = {"turn": "turn", "place": "place"}

    def heading(self) -> str:
        return (
            f"rotor with {self.stats.route}: {self.status}, thrust coefficient {self.thrust:.5g} +- {self.spread[0] * 100:.2g} %, "
            f"power coefficient {self.power:.5g} +- {self.spread[1] * 100:.2g} %"
        )


@dataclass(frozen=True)
class WakeOptions:
    """How a wake is cut into filaments; see `rotor_wake`."""

    strips: int
    steps: int
    lattice: int
    free: int
    mean: int
    tail: int
    cores: Cores
    threads: int

    @property
    def turn(self) -> float:
        """rad: of the rotor in a step."""
        return 2.0 * np.pi / self.steps

    @property
    def far(self) -> int:
        """Ages of the filaments behind the lattice."""
        return self.free + self.mean - self.lattice


def rotor_wake(
    rotor: Rotor,
    tip_speed_ratio: float = np.inf,
    *,
    pitch: float = 0.0,
    yaw: float = 0.0,
    tilt: float = 0.0,
    inflow: str = "free-wake",
    turns: int = 12,
    **options: Any,
) -> RotorWake:
    """Loads of a rigid rotor in steady wind with a wake of vortex filaments."""
    start = time.perf_counter()
    case = _Case.checked(rotor, tip_speed_ratio, pitch, yaw, tilt, wake_options(rotor, **options))
    choice("inflow of a wake", inflow, INFLOWS)
    wake, found, rounds, agreed = case.steady()
    if inflow == "prescribed-wake":
        return case.result([0.0], [found], wake, start, rounds, agreed)
    return case.march(wake, count("rotor_wake: turns", turns, 10000, LAST + 1), start)


def wake_options(
    rotor: Rotor,
    *,
    strips: int = 20,
    steps: int = 36,
    lattice: float = np.pi / 3.0,
    free_turns: float = 2.0,
    mean_turns: float = 2.0,
    tail_turns: float = 4.0,
    core_radius: float | None = None,
    core_growth: float = 2e-4,
    core: str = "vatistas",
    exponent: float = 2.0,
    threads: int = 0,
) -> WakeOptions:
    """The options of `rotor_wake`, checked."""
    if not isinstance(rotor, Rotor):
        raise ModelError(f"rotor_wake: rotor must be what mb.aero.rotor gives, it is {shown(rotor)}")
    n = count("rotor_wake: steps", steps, 720, 12)
    if n % 2:
        raise ModelError(f"rotor_wake: steps must be even, it is {n}")
    behind = max(round(_number("lattice", lattice) * n / (2.0 * np.pi)), 2)
    given = {"free_turns": free_turns, "mean_turns": mean_turns, "tail_turns": tail_turns}
    free, mean, tail = (round(_number(name, v) * n) for name, v in given.items())
    if min(free, mean - n, tail) < n // 2:
        raise ModelError(f"rotor_wake: free_turns and tail_turns must be at least 0.5, mean_turns 1.5; they are {given}")
    radius = 0.02 * rotor.radius if core_radius is None else _number("core_radius", core_radius)
    if not radius > 0.0:
        raise ModelError(f"rotor_wake: core_radius must be positive, it is {shown(core_radius)}")
    choice("core of filaments", core, CORES)
    cores = Cores(radius, _number("core_growth", core_growth), core, _number("exponent", exponent))
    return WakeOptions(
        count("rotor_wake: strips", strips, 400, 4), n, behind, free, mean, tail, cores, count("threads", threads, 1000, 0)
    )


def _number(name: str, value: Any) -> float:
    array = real_array(f"rotor_wake: {name}", value)
    if array.ndim:
        raise ModelError(f"rotor_wake: {name} must be one number, it is {shown(value)}")
    return float(array)


@dataclass(frozen=True)
class _Loads:
    """Of one time: thrust and power coefficients, the balance of the circulation, angles (b, n) and lift (b, n)."""

    thrust: float
    power: float
    balance: Balance
    angle: np.ndarray
    lift: np.ndarray


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
        lam = np.inf if still else _number("tip_speed_ratio", ratio)
        if not lam > 0.0:
            raise ModelError(f"rotor_wake: tip_speed_ratio must be positive, inf for hover; it is {shown(ratio)}")
        turned = replace(rotor, pitch=rotor.pitch + _number("pitch", pitch))
        y, t = _number("yaw", yaw), _number("tilt", tilt)
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
        """What the strips feel in front of a wake that has their circulation."""
        angle, speed, _ = lines.angles(balance.wind)
        coefficients = self.sections.coefficients(angle)
        wind = wake.induced(lines.points) + self.air(lines.points) - lines.velocity
        force = lines.forces(wind, balance.circulation, coefficients[..., 1] * self.sections.chord)
        r = self.rotor.radius
        area = np.pi * r**2
        torque = np.sum(np.cross(lines.points, force)[..., 0])
        around = np.linalg.norm(lines.velocity, axis=-1)
        lift = coefficients[..., 0] * (speed / around) ** 2
        return _Loads(float(np.sum(force[..., 0]) / (area * r**2)), float(torque / (area * r**3)), balance, angle, lift)

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
        o = self.options
        gamma, thrust = self.start()
        for i in range(1, MOST_ROUNDS + 1):
            wake = prescribed(
                self.lines,
                gamma,
                self.path(thrust),
                self.frame(0),
                o.turn,
                o.turn,
                o.cores,
                (o.lattice, o.far, o.tail),
                o.threads,
            )
            balance = self.balance(wake, self.lines)
            found = self.loads(wake.with_circulation(balance.circulation), balance, self.lines)
            change = found.balance.circulation - gamma
            size = np.max(np.abs(found.balance.circulation))
            agreed = np.max(np.abs(change)) <= AGREED * size and abs(found.thrust - thrust) <= AGREED * abs(thrust)
            if agreed:
                break
            gamma = gamma + 0.3 * change
            thrust = thrust + 0.3 * (found.thrust - thrust)
        return wake, found, i, bool(agreed and found.balance.residual <= BALANCED)

    def march(self, wake: Wake, turns: int, start: float) -> RotorWake:
        """The free wake, from a prescribed one."""
        o = self.options
        motion = March(wake, [self.frame(-i) for i in range(3)], o.turn, self.air, o.free)
        when, found = [], []
        unbalanced = 0
        total = turns * o.steps
        try:
            with Progress("free wake", total) as progress:
                for step in range(1, total + 1):
                    frame = self.frame(step)
                    lines = self.lines.turned(frame.rotation)
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
            made = self.result(when, found, motion.wake, start, unbalanced, None, "interrupted") if found else None
            raise Interrupted(f"a free wake was interrupted after {len(found) / o.steps:.2f} turns", made) from None
        return self.result(when, found, motion.wake, start, unbalanced, None)

    def result(self, when, found, wake, start, rounds, agreed, status=None) -> RotorWake:
        o = self.options
        last = found[-LAST * o.steps :]
        thrust, power = (np.array([getattr(one, name) for one in found]) for name in ("thrust", "power"))
        means, spreads = [], []
        for series in (thrust, power):
            end = series[-LAST * o.steps :]
            means.append(float(np.mean(end)))
            spreads.append(float(0.5 * np.ptp(end) / abs(np.mean(end))))
        mean = lambda f: np.mean([np.mean(f(one), axis=0) for one in last], axis=0)
        return RotorWake(
            turn=np.array(when),
            thrust_coefficient=thrust,
            power_coefficient=power,
            place=self.sections.places,
            circulation=mean(lambda one: one.balance.circulation) / self.rotor.radius,
            angle_of_attack=mean(lambda one: one.angle),
            lift=mean(lambda one: one.lift),
            thrust=means[0],
            power=means[1],
            spread=np.array(spreads),
            radius=self.rotor.radius,
            wake=wake,
            stats=Stats(time.perf_counter() - start, dict(wake.counts), route="free wake" if agreed is None else "prescribed wake"),
            error=max(spreads),
            status=status or ("unsteady wake" if agreed is None else "converged" if agreed else "unresolved"),
        )
