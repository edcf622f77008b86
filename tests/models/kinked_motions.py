"""One body on a rail under laws with kinks, and its motion piece by piece: exponentials of linear pieces, located events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mbrs as mb
import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

Rates = Callable[[float, np.ndarray, tuple[int, ...]], np.ndarray]
Distances = Callable[[float, np.ndarray, tuple[int, ...]], np.ndarray]


def by_pieces(rates: Rates, distances: Distances, turn, start, sides, times) -> np.ndarray:
    """Displacements at ``times`` of y' = rates(t, y, sides), smooth as long as no distance (towards zero) passes zero.

    ``turn(k, y, sides)`` gives the sides behind an event of distance k. Pieces by DOP853 at 1e-13.
    """
    y, t, out = np.array(start, dtype=float), float(times[0]), []
    while len(out) < len(times):
        n = len(distances(t, y, sides))

        def event(k, sides=sides):
            def f(s, x):
                return distances(s, x, sides)[k]

            f.terminal, f.direction = True, -1
            return f

        made = solve_ivp(
            lambda s, x, sides=sides: rates(s, x, sides),
            (t, times[-1]),
            y,
            "DOP853",
            rtol=1e-13,
            atol=1e-15 * max(np.abs(y).max(), 1e-3),
            events=[event(k) for k in range(n)],
            dense_output=True,
            max_step=(times[-1] - times[0]) / 50,
        )
        end = made.t[-1]
        while len(out) < len(times) and times[len(out)] <= end:
            out.append(made.sol(times[len(out)])[0])
        if made.status == 0:
            break
        k = next(k for k in range(n) if len(made.t_events[k]))
        y, t = made.y[:, -1], end
        sides = turn(k, y, sides)
    return np.array(out)


@dataclass
class Scene:
    """A model in random units, and the truth."""

    model: mb.Model
    axis: np.ndarray
    at: np.ndarray
    length: float
    t: float
    truth: Callable[[np.ndarray], np.ndarray]

    def error(self, traj) -> float:
        """Over the characteristic length."""
        found = (traj.position("block") - self.at) @ self.axis
        return float(np.abs(found - self.truth(np.asarray(traj.t))).max() / traj.snapshot.system.characteristic_length)


@dataclass
class Numbers:
    """Of a random scene: units, direction, mass, stiffness, a harmonic push and a starting speed."""

    rng: np.random.Generator

    def __post_init__(self) -> None:
        r = self.rng
        self.length, self.mass, self.w = 10.0 ** r.uniform(-1, 2), 10.0 ** r.uniform(-1, 2), 10.0 ** r.uniform(0, 1)
        axis = r.normal(size=3)
        self.axis, self.at = axis / np.linalg.norm(axis), self.length * r.normal(size=3)
        self.k = self.mass * self.w**2
        self.c = 2 * r.uniform(0.01, 0.05) * self.mass * self.w
        self.push, self.pushed = self.k * self.length * r.uniform(0.2, 0.5), self.w * r.uniform(0.5, 1.4)
        self.phase = r.uniform(0, 2 * np.pi)
        self.speed = self.w * self.length * r.uniform(0.3, 0.8)
        self.t = 2 * np.pi / self.w * r.uniform(3.0, 4.0)

    def force(self, t):
        return self.push * np.sin(self.pushed * t + self.phase)

    def scene(self, law, truth) -> Scene:
        m = mb.Model("block on a rail")
        b = m.body(
            "block",
            mass=self.mass,
            inertia=(self.mass * self.length**2,) * 3,
            at=self.at,
            velocity=tuple(self.speed * self.axis),
        )
        m.prismatic("rail", m.ground, b, at=self.at, axis=self.axis, k=self.k, c=self.c, law=law)
        m.marker("far", m.ground, at=self.at + self.length * np.array([0.6, -0.5, 0.62]))
        m.force("push", b, at=self.at, value=[mb.Sine(self.push * a, self.pushed, phase=self.phase) for a in self.axis])
        return Scene(m, self.axis, self.at, self.length, self.t, truth)


def stops(seed: int, stiff: float | None = None) -> Scene:
    """Between two stops, up to 1e6 times as stiff as the spring: exponentials of linear pieces."""
    n = Numbers(np.random.default_rng([seed, 1]))
    stiff = 10.0 ** n.rng.uniform(2, 6) if stiff is None else stiff
    gap, kc = n.length * n.rng.uniform(0.1, 0.3), stiff * n.k

    def matrix(side):
        """Of (u, v, sin, cos, 1)."""
        a = np.zeros((5, 5))
        a[0, 1], a[2, 3], a[3, 2] = 1.0, n.pushed, -n.pushed
        a[1, :3] = -(n.k + kc * (side != 0)) / n.mass, -n.c / n.mass, n.push / n.mass
        a[1, 4] = side * kc * gap / n.mass
        return a

    def truth(times):
        y = np.array([0.0, n.speed, np.sin(n.phase), np.cos(n.phase), 1.0])
        side, t, out = 0, 0.0, []
        while len(out) < len(times):
            a = matrix(side)
            # a twentieth of the fastest vibration
            h = 0.05 * 2 * np.pi / np.sqrt((n.k + kc * (side != 0)) / n.mass)
            step = expm(h * a)
            beyond = (lambda y: max(y[0] - gap, -gap - y[0])) if side == 0 else (lambda y, s=side: gap - s * y[0])
            # the first step may begin on the kink
            first, s, z = True, 0.0, y
            while True:
                after = step @ z
                if beyond(after) > 0 and not first:
                    root = brentq(lambda x, z=z, a=a, f=beyond: f(expm(x * a) @ z), 0.0, h, xtol=1e-16, rtol=1e-15)
                    found = s + root
                    break
                first, s, z = False, s + h, after
                if t + s > times[-1]:
                    found = np.inf
                    break
            while len(out) < len(times) and times[len(out)] <= t + found:
                out.append((expm((times[len(out)] - t) * a) @ y)[0])
            if found == np.inf:
                break
            y, t = expm(found * a) @ y, t + found
            side = int(np.sign(y[0])) if side == 0 else 0
        return np.array(out)

    return n.scene(mb.Gap(kc, gap, bilateral=True), truth)


def slider(seed: int) -> Scene:
    """A Jenkins element: it sticks until its limit, slides until it turns."""
    n = Numbers(np.random.default_rng([seed, 2]))
    kt = n.k * n.rng.uniform(2.0, 20.0)
    slip = n.push * n.rng.uniform(0.1, 0.4)

    def rates(t, y, sides):
        u, v, z = y
        f = sides[0] * slip if sides[0] else kt * (u - z)
        return np.array([v, (n.force(t) - n.k * u - n.c * v - f) / n.mass, v if sides[0] else 0.0])

    def distances(t, y, sides):
        u, v, z = y
        return np.array([sides[0] * v] if sides[0] else [slip / kt - (u - z), slip / kt + (u - z)])

    def turn(k, y, sides):
        return (0,) if sides[0] else ((1,), (-1,))[k]

    def truth(times):
        # the slider stays behind by the limit: a turn is passed with no distance left
        return by_pieces(rates, distances, turn, [0.0, n.speed, 0.0], (0,), times)

    return n.scene(mb.Jenkins(kt, slip), truth)


def bristles(seed: int) -> Scene:
    """LuGre friction that reverses."""
    n = Numbers(np.random.default_rng([seed, 3]))
    fc = n.push * n.rng.uniform(0.1, 0.3)
    fs, vs = fc * n.rng.uniform(1.0, 1.5), 0.1 * n.w * n.length
    s0 = n.k * 10.0 ** n.rng.uniform(1, 3)
    s1 = n.rng.uniform(0.2, 1.0) * np.sqrt(s0 * n.mass)

    def slope(v, z, side):
        return v - s0 * side * v * z / (fc + (fs - fc) * np.exp(-((v / vs) ** 2)))

    def rates(t, y, sides):
        u, v, z = y
        dz = slope(v, z, sides[0])
        return np.array([v, (n.force(t) - n.k * u - n.c * v - s0 * z - s1 * dz) / n.mass, dz])

    def truth(times):
        return by_pieces(
            rates, lambda t, y, s: s[0] * y[1:2], lambda k, y, s: (-s[0],), [0.0, n.speed, 0.0], (1,), times
        )

    return n.scene(mb.LuGre(fc, fs, vs, s0, s1, 0.0), truth)


def hysteresis(seed: int) -> Scene:
    """Bouc and Wen's law, n = 1: its state bends where rate or state reverse."""
    n = Numbers(np.random.default_rng([seed, 4]))
    k, alpha = n.k * n.rng.uniform(1.0, 3.0), n.rng.uniform(0.1, 0.4)
    beta, gamma = n.rng.uniform(0.5, 1.0) * 8 / n.length, n.rng.uniform(-0.3, 0.3) * 8 / n.length
    return n.scene(mb.BoucWen(k, alpha, beta, gamma, 1.0), _hysteretic(n, k, alpha, beta, gamma))


def _hysteretic(n, k, alpha, beta, gamma):
    def rates(t, y, sides):
        u, v, z = y
        speed, size = sides[0] * v, sides[1] * z
        dz = v - beta * speed * z - gamma * v * size
        return np.array([v, (n.force(t) - n.k * u - n.c * v - k * (alpha * u + (1 - alpha) * z)) / n.mass, dz])

    def turn(i, y, sides):
        return (-sides[0], sides[1]) if i == 0 else (sides[0], -sides[1])

    def truth(times):
        return by_pieces(
            rates,
            lambda t, y, s: np.array([s[0] * y[1], s[1] * y[2]]),
            turn,
            [0.0, n.speed, 0.0],
            (1, 1),
            times,
        )

    return truth


def dry(seed: int, part: float = 0.05) -> Scene:
    """Friction, of a part of the push, whose force jumps as the rate reverses, pushed too hard to stick: a function with a switch."""
    n = Numbers(np.random.default_rng([seed, 5]))
    f = part * n.push

    def rates(t, y, sides):
        u, v = y
        return np.array([v, (n.force(t) - n.k * u - n.c * v - sides[0] * f) / n.mass])

    def truth(times):
        return by_pieces(rates, lambda t, y, s: s[0] * y[1:2], lambda k, y, s: (-s[0],), [0.0, n.speed], (1,), times)

    return n.scene(mb.FunctionLaw(lambda t, u, v: f * np.where(v > 0, 1.0, -1.0)), truth)


def cornered(seed: int) -> Scene:
    """A measured curve with corners: a soft middle, harder beyond."""
    n = Numbers(np.random.default_rng([seed, 6]))
    a, hard = n.length * n.rng.uniform(0.05, 0.2), n.k * n.rng.uniform(3.0, 100.0)
    b, harder = 2.0 * a, 3.0 * hard

    def law(t, u, v):
        return hard * (np.maximum(u - a, 0.0) + np.minimum(u + a, 0.0)) + harder * np.maximum(
            np.abs(u) - b, 0.0
        ) * np.where(u > 0, 1.0, -1.0)

    def rates(t, y, sides):
        u, v = y
        place = sides[0]
        f = hard * (u - a if place > 0 else u + a if place < 0 else 0.0)
        f += harder * (u - b if place > 1 else u + b if place < -1 else 0.0)
        return np.array([v, (n.force(t) - n.k * u - n.c * v - f) / n.mass])

    ends = {-2: (-np.inf, -b), -1: (-b, -a), 0: (-a, a), 1: (a, b), 2: (b, np.inf)}

    def distances(t, y, sides):
        low, high = ends[sides[0]]
        return np.array([min(y[0] - low, 1e3 * n.length), min(high - y[0], 1e3 * n.length)])

    def truth(times):
        return by_pieces(rates, distances, lambda k, y, s: (s[0] + (1 if k else -1),), [0.0, n.speed], (0,), times)

    return n.scene(mb.FunctionLaw(law), truth)


SCENES = {f.__name__: f for f in (stops, slider, bristles, hysteresis, dry, cornered)}
