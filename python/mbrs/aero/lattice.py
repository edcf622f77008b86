"""The wake of a rotor as vortex filaments: a lattice behind the blades, rolled up into two filaments of each blade, and a helix."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .filaments import induced_velocity
from .lines import Lines

__all__ = ["Cores", "Frame", "Wake"]

# c in the march of a wake. 1/4: nodes beside the blade swing for ever from one step to the next. Larger: they grow. Smaller: the
# instability of hovering wakes is damped less. Pinned by test_a_wake_without_circulation_goes_with_the_wind.
DAMPING = 0.2
# Lamb and Oseen's core: its square grows as 4 a (nu + a1 |Gamma|) t, with the root a of exp(a) = 1 + 2 a.
LAMB_OSEEN = 1.2564312086261697


@dataclass(frozen=True)
class Cores:
    """Cores of the filaments: ``radius`` m of a rolled up filament when it is new, ``growth`` a1 of Squire's eddy viscosity
    a1 |Gamma|, ``model`` and ``exponent`` as of `induced_velocity`, ``lattice`` the radius in the lattice over the strips' width,
    ``bound`` that of the bound vortices over their distance from the trailing edge: the angle of attack is taken in between.
    """

    radius: float
    growth: float = 2e-4
    model: str = "vatistas"
    exponent: float = 2.0
    lattice: float = 0.25
    bound: float = 0.1

    def grown(self, squared: np.ndarray, circulation: np.ndarray, age: np.ndarray) -> np.ndarray:
        """m: radius of filaments of an age in s, which began with a squared radius."""
        return np.sqrt(squared + 4.0 * LAMB_OSEEN * self.growth * np.abs(circulation) * age)


@dataclass(frozen=True, eq=False)
class Frame:
    """Axes of the hub: origin (3,) m and rotation (3, 3), whose first column is the axis of the rotor."""

    origin: np.ndarray
    rotation: np.ndarray

    def local(self, points: np.ndarray) -> np.ndarray:
        """World to hub axes."""
        return (points - self.origin) @ self.rotation

    def world(self, points: np.ndarray) -> np.ndarray:
        """Hub to world axes."""
        return points @ self.rotation.T + self.origin

    @property
    def axis(self) -> np.ndarray:
        """(3,) unit vector about which the rotor turns."""
        return self.rotation[:, 0]


@dataclass(frozen=True, eq=False)
class Wake:
    """Filaments behind b blades of n strips, a step of time after the other; nodes are counted by their age in steps.

    Attributes
    ----------
    bound
        (b, n+1, 3) m: ends of the bound vortices.
    near
        (b, n+1, p+1, 3) m: nodes of the lattice; those of age 0 are at the trailing edge.
    far
        (b, 2, q+1, 3) m: nodes of the filaments that roll up outboard and inboard of the largest circulation; the first at age p.
    tail
        (b, 2, r+1, 3) m: helices that continue them.
    strength
        (b, n, p) m^2/s: circulation of the strips when the lattice's panels were shed.
    far_strength
        (b, q) m^2/s: the largest circulation of each blade then, with its sign.
    far_core
        (b, 2, q) m^2: squared core radius with which these filaments began.
    step
        s between ages.
    advance
        (2, 3) m in axes of the hub: what the helices move on in a turn of the rotor. It is prescribed: advances that follow those of
        the filaments in front move a long tail at once, which moves these.
    """

    bound: np.ndarray
    near: np.ndarray
    far: np.ndarray
    tail: np.ndarray
    strength: np.ndarray
    far_strength: np.ndarray
    far_core: np.ndarray
    step: float
    advance: np.ndarray
    cores: Cores
    threads: int = 0
    counts: dict[str, int] = field(default_factory=lambda: {"filament_pairs": 0})

    def __repr__(self) -> str:
        b, n, p = self.strength.shape
        return f"Wake({b} blades of {n} strips, ages {p} + {self.far_strength.shape[1]} + {self.tail.shape[2] - 1})"

    @property
    def trailing(self) -> np.ndarray:
        """(b, n+1, p) m^2/s: of the lattice's filaments that lead away from the blades."""
        return -np.diff(self.strength, axis=1, prepend=0.0, append=0.0)

    def filaments(self, smooth: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Starts and ends (m, 3) m, circulations (m,) m^2/s and core radii (m,) m of all filaments, bound ones included.

        ``smooth`` gives the lattice cores as wide as those of the filaments that it rolls up to: its own are narrow, so that the
        strips between them see a sheet, and narrow filaments that convect each other tangle.
        """
        gamma, trail = self.strength, self.trailing
        p, q, r = gamma.shape[2], self.far_strength.shape[1], self.tail.shape[2] - 1
        own, wide, edge = self._lattice_cores()
        if smooth:
            own, wide, edge = (np.maximum(one, self.cores.radius) for one in (own, wide, edge))
        age = self.step * (np.arange(p + q + r) + 0.5)
        shed = np.diff(gamma, axis=2)  # what the oldest panels have more is in the joints
        pair = np.array([1.0, -1.0])[None, :, None]
        behind = pair * self.far_strength[:, None]
        old = np.broadcast_to(behind[..., -1:], (*behind.shape[:2], r))
        cores = self.cores.grown
        joints = np.take_along_axis(self.far[:, :, 0], self._sides()[..., None], axis=1)
        parts = [
            (self.bound[:, :-1], self.bound[:, 1:], gamma[..., 0], own),
            (self.bound, self.near[:, :, 0], trail[..., 0], edge),
            (
                self.near[:, :-1, 1:-1],
                self.near[:, 1:, 1:-1],
                shed,
                cores(wide[..., None] ** 2, shed, self.step * np.arange(p - 1)),
            ),
            (self.near[:, :, :-1], self.near[:, :, 1:], trail, cores(edge[..., None] ** 2, trail, age[:p] - age[0])),
            (self.near[:, :, -1], joints, trail[..., -1], cores(edge**2, trail[..., -1], age[p])),
            (self.far[:, :, :-1], self.far[:, :, 1:], behind, cores(self.far_core, behind, age[p : p + q])),
            (self.tail[:, :, :-1], self.tail[:, :, 1:], old, cores(self.far_core[..., -1:], old, age[p + q :])),
        ]
        flat: list[list[np.ndarray]] = [[], [], [], []]
        for start, end, circulation, radius in parts:
            flat[0].append(start.reshape(-1, 3))
            flat[1].append(end.reshape(-1, 3))
            flat[2].append(circulation.ravel())
            flat[3].append(np.broadcast_to(radius, circulation.shape).ravel())
        start, end, circulation, radius = (np.concatenate(one) for one in flat)
        return start, end, circulation, radius

    def induced(self, points: np.ndarray, smooth: bool = False) -> np.ndarray:
        """(..., 3) m/s: velocity at points (..., 3) m of all `filaments`."""
        start, end, circulation, radius = self.filaments(smooth)
        self.counts["filament_pairs"] += len(start) * (points.size // 3)
        return induced_velocity(
            points,
            start,
            end,
            circulation,
            core_radius=radius,
            core=self.cores.model,
            exponent=self.cores.exponent,
            threads=self.threads,
        )

    def with_circulation(self, gamma: np.ndarray) -> Wake:
        """The wake with the circulation (b, n) of the bound vortices, and of the panels behind them."""
        return replace(self, strength=np.concatenate([gamma[..., None], self.strength[..., 1:]], axis=-1))

    def _lattice_cores(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Core radii m of bound vortices (b, n) and of the lattice's new filaments across (b, n) and along (b, n+1) the wind."""
        wide = self.cores.lattice * np.linalg.norm(np.diff(self.bound, axis=1), axis=-1)
        edge = np.concatenate([wide[:, :1], np.minimum(wide[:, 1:], wide[:, :-1]), wide[:, -1:]], axis=1)
        leg = np.linalg.norm(self.near[:, :, 0] - self.bound, axis=-1)
        return self.cores.bound * 0.5 * (leg[:, 1:] + leg[:, :-1]), wide, edge

    def influence(self, points: np.ndarray) -> np.ndarray:
        """(m, b n, 3) 1/m: velocity at points (m, 3) of a unit circulation of each bound vortex with the panel behind it."""
        b, n, _ = self.strength.shape
        flat = points.reshape(-1, 3)
        out = np.empty((b * n, len(flat), 3))
        leg, panel = self.near[:, :, 0], self.near[:, :, 1]
        corners = [self.bound[:, :-1], self.bound[:, 1:], leg[:, 1:], panel[:, 1:], panel[:, :-1], leg[:, :-1]]
        ring = np.stack(corners, axis=2).reshape(b * n, 6, 3)
        own, wide, edge = self._lattice_cores()
        cores = [own, edge[:, 1:], edge[:, 1:], wide, edge[:, :-1], edge[:, :-1]]
        radius = np.stack(cores, axis=2).reshape(b * n, 6)
        for i, (corner, core) in enumerate(zip(ring, radius, strict=True)):
            out[i] = induced_velocity(
                flat,
                corner,
                np.roll(corner, -1, axis=0),
                1.0,
                core_radius=core,
                core=self.cores.model,
                exponent=self.cores.exponent,
                threads=1,
            )
        return out.transpose(1, 0, 2)

    def _sides(self) -> np.ndarray:
        """(b, n+1): to which far filament each trailing filament goes: 0 outboard, 1 inboard of the largest circulation."""
        peak = np.argmax(np.abs(self.strength[..., -1]), axis=1)
        return np.where(np.arange(self.near.shape[1]) > peak[:, None], 0, 1)

    def roll_up(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Centres where the oldest panels of the lattice roll up: points (b, 2, 3) m, squared core radii (b, 2) m^2, strength (b,) m^2/s.

        Each side goes to the centre of its vorticity. The core holds the second moment of what was rolled up: a Gaussian vortex of
        squared radius rc^2 has the moment rc^2 / a.
        """
        weight = np.abs(self.trailing[..., -1])[:, None] * (self._sides()[:, None] == np.arange(2)[:, None])
        weight = np.where(weight.sum(axis=2, keepdims=True) > 0.0, weight, _ends(self.near.shape[1]))
        weight = weight / weight.sum(axis=2, keepdims=True)
        nodes = self.near[:, :, -1]
        centre = np.einsum("bfj,bjc->bfc", weight, nodes)
        away = np.sum((nodes[:, None] - centre[:, :, None]) ** 2, axis=-1)
        last = self.strength[..., -1]
        peak = np.take_along_axis(last, np.argmax(np.abs(last), axis=1)[:, None], axis=1)[:, 0]
        return centre, self.cores.radius**2 + LAMB_OSEEN * np.sum(weight * away, axis=2), peak

    def shifted(self) -> Wake:
        """Strengths one step older; the newest panel keeps the circulation of the one before as a guess."""
        _, core, peak = self.roll_up()
        return replace(
            self,
            strength=np.concatenate([self.strength[..., :1], self.strength[..., :-1]], axis=-1),
            far_strength=np.concatenate([peak[:, None], self.far_strength[:, :-1]], axis=-1),
            far_core=np.concatenate([core[..., None], self.far_core[..., :-1]], axis=-1),
        )

    def placed(self, bound: np.ndarray, near: np.ndarray, far: np.ndarray, frame: Frame, turn: float) -> Wake:
        """The wake with its nodes moved, the first of ``far`` where the lattice rolls up, and the tail behind the last: see `helix`."""
        wake = replace(self, bound=bound, near=near)
        far = far.copy()
        far[:, :, 0] = wake.roll_up()[0]
        return replace(
            wake, far=far, tail=helix(far, self.advance @ frame.rotation.T, frame, turn, self.tail.shape[2] - 1)
        )


def _ends(nodes: int) -> np.ndarray:
    """(2, nodes): all weight at the tip, all at the root."""
    unit = np.zeros((2, nodes))
    unit[0, -1] = unit[1, 0] = 1.0
    return unit


def helix(far: np.ndarray, advance: np.ndarray, frame: Frame, turn: float, length: int) -> np.ndarray:
    """(b, 2, length+1, 3) m: regular helices behind filaments (b, 2, q+1, 3), whose last turn gives their radius.

    ``advance`` (2, 3) m is what a turn of each family moves on in a turn of the rotor. ``turn`` is the angle in rad that the rotor
    turns between ages, positive about the frame's axis.
    """
    n = round(2.0 * np.pi / abs(turn))
    last = far[:, :, -n - 1 :]
    centre = np.mean(last[:, :, 1:], axis=(0, 2)) + advance * (n - 1) / (2.0 * n)
    ages = (np.arange(n) - (n - 1)) / n
    arm = last[:, :, 1:] - (centre[:, None] + ages[:, None] * advance[:, None])
    arm = arm - (arm @ frame.axis)[..., None] * frame.axis
    radius = np.mean(np.linalg.norm(arm, axis=-1), axis=(0, 2))
    first = arm[:, :, -1] / np.maximum(np.linalg.norm(arm[:, :, -1], axis=-1, keepdims=True), 1e-300)
    side = np.cross(frame.axis, first)
    j = np.arange(1, length + 1)
    c, s = np.cos(j * turn)[:, None], np.sin(j * turn)[:, None]
    circle = radius[:, None, None] * (c * first[:, :, None] - s * side[:, :, None])
    behind = centre[:, None] + (j / n)[:, None] * advance[:, None] + circle
    return np.concatenate([far[:, :, -1:], behind], axis=2)


Wind = Callable[[np.ndarray], np.ndarray]


Nodes = tuple[np.ndarray, np.ndarray]


class March:
    """A wake that convects with the velocities of its nodes, by a predictor and corrector of second order.

    The cell between ages k and k+1 and times l and l+1 balances

        r(l+1, k+1) - r(l, k) - c (d(k) + d(k+1)) / 2 = h V,   d = y(l+1) - 3 y(l) + 3 y(l-1) - y(l-2) at one age

    with the mean V of the velocities at its four corners. With y = r and c = 1/4, d turns the central difference in time into the
    backward one of second order, which damps the instability of hovering wakes (M. J. Bhagwat and J. G. Leishman, "Stability,
    consistency and convergence of time-marching free-vortex rotor wake algorithms", J. Am. Helicopter Soc. 46 (2001) 59: PC2B). A
    wake that merely turns with the rotor is dragged around by it with some (h Omega)^2 / 4 of the rotor's speed. Here y is the
    distance from where the mean wake of the turn before would be, had it turned with the rotor: the damping is the same, and a
    periodic wake has no drag.

    ``frames`` are those of the hub now, one and two steps before; ``still`` is the wake without what carries it off the axis. Nodes
    of the far filaments that are older than ``free`` steps more and more, and a turn later only, convect with the mean velocity of a
    turn: turns of filaments pair and tangle there, and a wake that is cut off has nothing behind it that would carry this away.
    """

    def __init__(self, wake: Wake, still: Wake, frames: Sequence[Frame], turn: float, wind: Wind, free: int) -> None:
        self.wake, self.frames, self.turn, self.wind = wake, list(frames), turn, wind
        self.mean: Nodes = (frames[0].local(still.near), frames[0].local(still.far))
        off = wake.near - still.near, wake.far - still.far
        turned = [self._world_mean(frame) for frame in frames]
        self.history: list[Nodes] = [(near + off[0], far + off[1]) for near, far in turned]  # newest first
        self.sum: Nodes = (np.zeros_like(wake.near), np.zeros_like(wake.far))
        self.summed = 0
        self.velocity: Nodes | None = None
        ages = wake.near.shape[2] - 1 + np.arange(wake.far.shape[2])
        calm = np.clip((ages - free) * abs(turn) / (2.0 * np.pi), 0.0, 1.0)
        self.calm = np.stack([calm, np.ones(len(ages))])

    def velocities(self, wake: Wake, frame: Frame) -> Nodes:
        """(b, n+1, p+1, 3) and (b, 2, q+1, 3) m/s at the nodes."""
        points = np.concatenate([wake.near.reshape(-1, 3), wake.far.reshape(-1, 3)])
        split = wake.near.size // 3
        v, wind = wake.induced(points, smooth=True), self.wind(points)
        far = self._calmed(wake.far, v[split:].reshape(wake.far.shape), frame)
        near = (v[:split] + wind[:split]).reshape(wake.near.shape)
        return near, far + wind[split:].reshape(wake.far.shape)

    def _calmed(self, points: np.ndarray, velocity: np.ndarray, frame: Frame) -> np.ndarray:
        """Induced velocities (b, 2, q+1, 3) whose share ``calm`` (q+1,) is replaced by the mean of all blades over a turn of ages.

        The mean is one of the components along the axis, outwards and around; it does not feed the pairing of turns.
        """
        axis = frame.axis
        arm = points - frame.origin
        arm = arm - (arm @ axis)[..., None] * axis
        out = arm / np.maximum(np.linalg.norm(arm, axis=-1, keepdims=True), np.finfo(float).tiny)
        axes = np.stack([np.broadcast_to(axis, out.shape), out, np.cross(axis, out)], axis=-2)
        parts = np.einsum("bfkac,bfkc->bfka", axes, velocity)
        n = round(2.0 * np.pi / abs(self.turn))
        kernel = np.concatenate([[0.5], np.ones(n - 1), [0.5]]) / n
        full = np.apply_along_axis(lambda x: np.convolve(x, kernel, "valid"), 1, parts.mean(axis=0))
        mean = np.pad(full, ((0, 0), (n // 2, n // 2), (0, 0)), mode="edge")
        steady = np.einsum("bfkac,fka->bfkc", axes, mean)
        return velocity + self.calm[..., None] * (steady - velocity)

    def predict(self, lines: Lines, frame: Frame) -> Wake:
        """The wake a step later, with velocities that turn with the hub; the blades are where ``lines`` are."""
        if self.velocity is None:
            self.velocity = self.velocities(self.wake, self.frames[0])
        turned = frame.rotation @ self.frames[0].rotation.T
        near, far = (v @ turned.T for v in self.velocity)
        return self._moved(self.wake.shifted(), lines, frame, (near, far))

    def correct(self, predicted: Wake, lines: Lines, frame: Frame) -> Wake:
        """The wake a step later, with the velocities of the predicted one."""
        return self._moved(predicted, lines, frame, self.velocities(predicted, frame))

    def accept(self, wake: Wake, frame: Frame) -> None:
        """Take a wake as the present one."""
        self.wake = wake
        self.frames = [frame, *self.frames[:2]]
        self.history = [(wake.near, wake.far), *self.history[:2]]
        self.velocity = self.velocities(wake, frame)
        self.sum = (self.sum[0] + frame.local(wake.near), self.sum[1] + frame.local(wake.far))
        self.summed += 1
        if self.summed == round(2.0 * np.pi / abs(self.turn)):
            self.mean = (self.sum[0] / self.summed, self.sum[1] / self.summed)
            self.sum, self.summed = (np.zeros_like(wake.near), np.zeros_like(wake.far)), 0

    def _world_mean(self, frame: Frame) -> Nodes:
        return frame.world(self.mean[0]), frame.world(self.mean[1])

    def _moved(self, strengths: Wake, lines: Lines, frame: Frame, later: Nodes) -> Wake:
        rigid = _third(self._world_mean(frame), *(self._world_mean(f) for f in self.frames))
        own = _third((0.0, 0.0), *self.history)
        near = self._family(0, lines.trailing, later[0], own[0] - rigid[0])
        wake = replace(strengths, near=near)
        far = self._family(1, wake.roll_up()[0], later[1], own[1] - rigid[1])
        return strengths.placed(lines.edges, near, far, frame, self.turn)

    def _family(self, i: int, first: np.ndarray, later: np.ndarray, past: np.ndarray) -> np.ndarray:
        """New nodes of the lattice (0) or the far filaments (1), which begin at ``first``: a recursion along their ages."""
        assert self.velocity is not None
        now, old = self.velocity[i], self.history[0][i]
        mean = 0.25 * (now[..., :-1, :] + now[..., 1:, :] + later[..., :-1, :] + later[..., 1:, :])
        c = 0.5 * DAMPING
        known = old[..., :-1, :] + self.wake.step * mean + c * (past[..., :-1, :] + past[..., 1:, :])
        nodes = np.concatenate([first[..., None, :], known / (1.0 - c)], axis=-2)
        for k in range(1, nodes.shape[-2]):
            nodes[..., k, :] += c / (1.0 - c) * nodes[..., k - 1, :]
        return nodes


def _third(new: Any, one: Nodes, two: Nodes, three: Nodes) -> Nodes:
    """Third difference in time of both families."""
    near, far = (a - 3.0 * b + 3.0 * c - d for a, b, c, d in zip(new, one, two, three, strict=True))
    return near, far
