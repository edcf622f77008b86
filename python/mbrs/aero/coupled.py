"""Induced velocities at the sections of blades that move and bend: what a motion asks for at every step of a wake."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from inspect import signature
from typing import Any, Protocol

import numpy as np

from .._lib.rotations import quaternion_matrix
from ..errors import ModelError
from .blades import Blade
from .circulation import bound_circulation
from .lattice import Frame, March, Wake
from .lines import Lines
from .momentum import Annuli
from .momentum import inflow as momentum_inflow
from .polars import Polar, polar
from .rotors import Rotor
from .wake_options import WakeOptions, wake_options
from .wake_paths import prescribed, wind_path
from .winds import Wind, wind

__all__ = ["Blades", "Induction", "RotorWakeInduction", "induction", "rotor_frame"]

# Steps of a turn where none are asked for.
STEPS = 24
# Rounds of a prescribed wake and the loads that cause it, and the relative change of the circulation that ends them.
ROUNDS, AGREED, RELAXED = 40, 1e-4, 0.4
# Residual of the circulations, relative, from which on a step is told to be out of balance. Larger: unbalanced loads pass. Smaller:
# rounding near stall is told.
UNBALANCED = 1e-6


@dataclass(frozen=True, eq=False)
class Blades:
    """b equal blades of n strips: plain data of an `Aerodynamics`, with the wind and the axis that it has now."""

    place: np.ndarray
    width: np.ndarray
    chord: np.ndarray
    twist: np.ndarray
    line: float
    centre: np.ndarray
    first: float
    last: float
    polars: tuple[Polar, ...]
    weights: np.ndarray
    count: int
    axis: np.ndarray
    wind: Wind
    speed: float
    density: float

    @classmethod
    def of(cls, air: Any) -> Blades:
        """The blades of an `Aerodynamics`."""
        blades: Sequence[Mapping[str, Any]] = air.blades
        one = blades[0]
        for other in blades[1:]:
            if any(other[key] != one[key] for key in one if key != "body"):
                raise ModelError(
                    f"{air.name}: inflow {air.inflow!r} needs equal blades, but those of {one['body']!r} and {other['body']!r} differ"
                )
        known = {p["name"]: i for i, p in enumerate(air.polars)}
        weights = np.zeros((len(one["place"]), len(known)))
        share = np.array(one["share"])
        for k, (a, b, s) in enumerate(zip(one["polar"], one["second_polar"], share, strict=True)):
            weights[k, known[a]] += 1.0 - s
            weights[k, known[b]] += s
        axis, pitch = np.array(air.values("axis")), air.values("pitch")[0]
        return cls(
            place=np.array(one["place"]),
            width=np.array(one["width"]),
            chord=np.array(one["chord"]),
            twist=np.array(one["twist"]) + pitch,
            line=one["line"],
            centre=np.array(one["aerodynamic_center"]),
            first=one["first"],
            last=one["last"],
            polars=tuple(polar(**p) for p in air.polars),
            weights=weights,
            count=len(blades),
            axis=axis / np.linalg.norm(axis),
            wind=_wind(air),
            speed=air.values("speed")[0],
            density=air.values("density")[0],
        )

    def coefficients(self, angle: np.ndarray, slope: bool = False) -> np.ndarray:
        """(..., n, 3) lift, drag and moment at angles (..., n) rad, or their slopes."""
        total = np.zeros((*np.shape(angle), 3))
        for k, one in enumerate(self.polars):
            takes = np.flatnonzero(self.weights[:, k])
            value = one.clip_slopes(angle[..., takes]) if slope else one.clip_values(angle[..., takes])
            total[..., takes, :] += self.weights[takes, k, None] * value
        return total


def rotor_of(model: Any) -> Rotor:
    """The rigid rotor that the blades of a model make as drawn; their strips are its stations."""
    air = model.airs[0]
    b = Blades.of(air)
    out = quaternion_matrix(np.array(model[air.blades[0]["body"]].values("orientation")))[:, 0]
    shape = Blade(b.place, b.chord, b.twist, b.centre, b.polars, b.weights)
    return Rotor(shape, b.count, b.first, b.last, 0.0, float(np.arcsin(np.clip(out @ b.axis, -1.0, 1.0))), True, True)


def _wind(air: Any) -> Wind:
    shear, height = air.values("shear")[0], air.values("reference_height")[0]
    return wind(
        air.values("speed")[0],
        air.values("direction"),
        shear,
        height if shear else None,
        air.values("up"),
        air.values("ground")[0],
    )


@dataclass(frozen=True, eq=False)
class Rows:
    """Places and velocities of all sections at one time, from the core; each (b, n, 3) in world axes."""

    centre: np.ndarray
    rear: np.ndarray
    forward: np.ndarray
    span: np.ndarray
    ahead: np.ndarray
    suction: np.ndarray
    centre_velocity: np.ndarray
    rear_velocity: np.ndarray

    @property
    def axes(self) -> np.ndarray:
        """(b, n, 3, 3): span, ahead, suction as columns."""
        return np.stack([self.span, self.ahead, self.suction], axis=-1)

    def into_sections(self, velocity: np.ndarray) -> np.ndarray:
        """(b n, 3): world vectors (b, n, 3) in the axes of the sections."""
        return np.einsum("bnck,bnc->bnk", self.axes, velocity).reshape(-1, 3)


class Induction(Protocol):
    """A source of induced velocities (b n, 3) m/s in the axes of the sections, a step after the other."""

    step: float
    blades: Blades

    def start(self, rows: Rows) -> np.ndarray:
        """At the beginning of the motion."""

    def trial(self, rows: Rows) -> np.ndarray:
        """A step later, if the sections are there then; may be asked again."""

    def accept(self) -> None:
        """The last trial is what happened."""


def induction(air: Any, rows: Rows) -> Induction:
    """The source of induced velocities for the inflow of an `Aerodynamics`."""
    blades = Blades.of(air)
    frame, speed = rotor_frame(blades, rows)
    options = _options(air)
    if not abs(speed) > 0.0:
        raise ModelError(
            f"{air.name}: inflow {air.inflow!r} needs a rotor that turns about its axis when the motion begins"
        )
    return RotorWakeInduction(air.name, blades, frame, speed, options, air.inflow == "free-wake")


def _options(air: Any) -> dict[str, Any]:
    """The options of a stepped inflow, none of them unknown."""
    known = {*signature(wake_options).parameters} - {"rotor_radius", "strips"}
    if unknown := [key for key in air.options if key not in known]:
        raise ModelError(
            f"{air.name}: inflow {air.inflow!r} has no option {unknown[0]!r}; known: {', '.join(sorted(known))}"
        )
    return dict(air.options)


def rotor_frame(blades: Blades, rows: Rows) -> tuple[Frame, float]:
    """Axes of the hub with blade 1 along z, and the speed of rotation in rad/s: from where the sections near the roots are."""
    root, out = rows.centre[:, 0], rows.span[:, 0]
    n = blades.axis
    if len(root) > 1:
        origin = np.mean(root - blades.place[0] * out, axis=0)
    else:
        origin = root[0] - blades.place[0] * out[0]
    up = out[0] - (out[0] @ n) * n
    up = up / np.linalg.norm(up)
    arm = root - origin
    arm = arm - (arm @ n)[:, None] * n
    around = np.cross(n, arm)
    speed = float(np.mean(np.sum(rows.centre_velocity[:, 0] * around, axis=1) / np.sum(arm**2, axis=1)))
    return Frame(origin, np.stack([n, np.cross(up, n), up], axis=1)), speed


def balanced(blades: Blades, rows: Rows) -> np.ndarray:
    """(b n, 3): the velocities that balance momentum at once, in the axes of the sections; one annulus for the mean of the blades."""
    b, n = blades, blades.axis
    out = n - np.sum(rows.span * n, axis=-1)[..., None] * rows.span
    normal = out / np.linalg.norm(out, axis=-1, keepdims=True)
    ahead = np.cross(normal, rows.span)
    u = b.wind.velocity(rows.rear) - rows.rear_velocity
    axial = np.mean(np.sum(u * normal, axis=-1), axis=0)
    around = np.mean(-np.sum(u * ahead, axis=-1), axis=0)
    cone = float(np.mean(np.sum(normal * n, axis=-1)))
    radius, half = b.place * cone, 0.5 * b.count
    torsion = np.mean(np.arctan2(np.sum(normal * rows.ahead, -1), np.sum(normal * rows.suction, -1)), axis=0)
    loss = np.array([half * (b.last - b.place) / b.place, half * (b.place - b.first) / b.first])
    annuli = Annuli(b.coefficients, b.twist - torsion, b.count * b.chord / (2.0 * np.pi * radius), loss)
    flow = momentum_inflow(annuli, axial, around)
    return rows.into_sections(flow.axial[:, None] * normal - flow.tangential[:, None] * ahead)


class RotorWakeInduction:
    """A lattice behind the blades, rolled up into filaments: prescribed by the thrust, or free."""

    def __init__(
        self, name: str, blades: Blades, frame: Frame, speed: float, options: dict[str, Any], free: bool
    ) -> None:
        self.name, self.blades, self.free = name, blades, free
        radius = blades.last
        options.setdefault("steps", STEPS)
        self.options: WakeOptions = wake_options(radius, strips=len(blades.place), **options)
        self.sense = float(np.sign(speed))
        self.step = 2.0 * np.pi / (abs(speed) * self.options.steps)
        self.radius, self.origin, self.speed = radius, frame.origin, speed
        self.march: March | None = None
        self.wake: Wake | None = None
        self.gamma = np.zeros((blades.count, len(blades.place)))
        self._tried: tuple[Wake, Frame] | None = None
        self.unbalanced = 0
        first, last = blades.first, blades.last
        angle = np.linspace(0.0, np.pi, len(blades.place) + 1)
        self.edges = 0.5 * (first + last) - 0.5 * (last - first) * np.cos(angle)

    def lines(self, rows: Rows) -> Lines:
        """Bound vortices through the aerodynamic centres, their ends between the sections."""
        b = self.blades
        behind = np.interp(self.edges, b.place, (1.0 - b.centre) * b.chord)
        edges = _along(b.place, rows.centre, self.edges)
        ahead = _along(b.place, rows.forward, self.edges)
        ahead = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
        return Lines(
            edges=edges,
            trailing=edges - behind[:, None] * ahead,
            points=rows.centre,
            forward=rows.forward,
            suction=np.cross(rows.span, rows.forward),
            rear=rows.rear,
            velocity=rows.centre_velocity,
            rear_velocity=rows.rear_velocity,
        )

    def _frame(self, rows: Rows) -> Frame:
        return Frame(self.origin, rotor_frame(self.blades, rows)[0].rotation)

    def _balance(self, wake: Wake, lines: Lines) -> tuple[np.ndarray, np.ndarray]:
        """Circulations (b, n), and the induced velocity (b, n, 3) that the sections' polars see."""
        blades = self.blades
        known = wake.with_circulation(np.zeros(wake.strength.shape[:2])).induced(lines.rear)
        wind = blades.wind.velocity(lines.rear) - lines.rear_velocity
        found = bound_circulation(lines, blades, known + wind, wake.influence(lines.rear), wake.strength[..., 0])
        self.unbalanced += found.residual > UNBALANCED
        return found.circulation, found.wind - wind

    def _thrust(self, lines: Lines, gamma: np.ndarray) -> float:
        """Thrust coefficient over the wind's speed, of lift alone."""
        air = self.blades.wind.velocity(lines.points) - lines.velocity
        force = lines.forces(air, gamma, 0.0 * gamma) @ self.blades.axis
        u = self.blades.speed
        return float(np.sum(force) / (0.5 * np.pi * self.radius**2 * u**2))

    def _prescribed(self, lines: Lines, frame: Frame, gamma: np.ndarray, drift: bool = True) -> Wake:
        o, u = self.options, self.blades.wind.velocity(frame.origin)
        axial = float(u @ self.blades.axis)
        if not axial > 0.0:
            where = (
                ""
                if u.any()
                else "; there is none at its hub, which is not above the ground: give mb.aero.wind(ground=...)"
            )
            raise ModelError(
                f"{self.name}: the wake of a rotor needs wind along its axis, which points down the wind{where}"
            )
        h = self.step
        ages = np.arange(o.lattice + o.far + 1) * h
        path = wind_path(min(self._thrust(lines, gamma), 0.96), axial, self.radius, ages)
        across = frame.rotation.T @ (u - axial * self.blades.axis)
        path = replace(path, drift=across if drift else np.zeros(3))
        counts = (o.lattice, o.far, o.tail)
        return prescribed(lines, gamma, path, frame, self.sense * o.turn, h, o.cores, counts, o.threads)

    def _steady(self, rows: Rows, gamma: np.ndarray) -> tuple[Wake, np.ndarray, np.ndarray]:
        """The prescribed wake that belongs to the circulations that it causes, by relaxed rounds."""
        lines, frame = self.lines(rows), self._frame(rows)
        for _ in range(ROUNDS):
            wake = self._prescribed(lines, frame, gamma)
            found, induced = self._balance(wake, lines)
            change = found - gamma
            if np.max(np.abs(change)) <= AGREED * np.max(np.abs(found)):
                break
            gamma = gamma + RELAXED * change
        return wake.with_circulation(found), found, induced

    def _first_guess(self, rows: Rows) -> np.ndarray:
        """Circulations of blade elements and momentum."""
        v = balanced(self.blades, rows).reshape(*rows.rear.shape)
        u = self.blades.wind.velocity(rows.rear) - rows.rear_velocity
        lines = self.lines(rows)
        angle, speed, _ = lines.angles(u + np.einsum("bnck,bnk->bnc", rows.axes, v))
        lift = self.blades.coefficients(angle)[..., 0]
        return 0.5 * self.blades.chord * speed * lift

    def start(self, rows: Rows) -> np.ndarray:
        """The prescribed wake; the free one begins from it."""
        self.wake, self.gamma, induced = self._steady(rows, self._first_guess(rows))
        if self.free:
            lines, frame = self.lines(rows), self._frame(rows)
            still = self._prescribed(lines, frame, self.gamma, drift=False)
            o = self.options
            frames = [self._back(frame, i) for i in range(3)]
            self.march = March(self.wake, still, frames, self.sense * o.turn, self.blades.wind.velocity, o.free)
        return rows.into_sections(induced)

    def _back(self, frame: Frame, steps: int) -> Frame:
        """The hub some steps ago, if it turned evenly."""
        a = -steps * self.sense * self.options.turn
        c, s = np.cos(a), np.sin(a)
        return Frame(frame.origin, frame.rotation @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]))

    def trial(self, rows: Rows) -> np.ndarray:
        """The wake a step later."""
        lines, frame = self.lines(rows), self._frame(rows)
        if self.march is None:
            wake, _, induced = self._steady(rows, self.gamma)
        else:
            predicted = self.march.predict(lines, frame)
            predicted = predicted.with_circulation(self._balance(predicted, lines)[0])
            corrected = self.march.correct(predicted, lines, frame)
            gamma, induced = self._balance(corrected, lines)
            wake = corrected.with_circulation(gamma)
        self._tried = (wake, frame)
        return rows.into_sections(induced)

    def accept(self) -> None:
        """Take the last trial."""
        assert self._tried is not None
        self.wake, frame = self._tried
        self.gamma = self.wake.strength[..., 0]
        if self.march is not None:
            self.march.accept(self.wake, frame)

    def filaments(self) -> np.ndarray:
        """(b, 2, q, 3) m: the filaments that roll up, to be drawn."""
        assert self.wake is not None
        return self.wake.far.copy()

    def copy(self) -> RotorWakeInduction:
        """An independent copy, from which a motion goes on."""
        return copy.deepcopy(self)


def _along(place: np.ndarray, values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """(b, m, 3): values (b, n, 3) at places (n,) taken to places (m,) by cubic splines, straight beyond the ends."""
    from scipy.interpolate import make_interp_spline

    inside = np.clip(where, place[0], place[-1])
    spline = make_interp_spline(place, values, k=min(3, len(place) - 1), axis=1)
    slope = spline.derivative()
    made: np.ndarray = spline(inside) + (where - inside)[:, None] * slope(inside)
    return made
