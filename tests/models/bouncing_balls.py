"""A ball that bounces on a stiff spring, or is thrown against it: closed forms piece by piece, differentiated by complex steps."""

import mbrs as mb
import numpy as np

COMPLEX_STEP = 1e-30


class Ball:
    """It falls along a random axis, through oil or not, in random units; the spring is up to 1e7 times as stiff as weight over height."""

    def __init__(self, seed, stiff=None, damped=None, bounces=None):
        rng = np.random.default_rng([seed, 31])
        length, mass = 10.0 ** rng.uniform(-1, 2), 10.0 ** rng.uniform(-1, 2)
        axis = rng.normal(size=3)
        self.length, self.axis = length, axis / np.linalg.norm(axis)
        self.g = length * rng.uniform(5.0, 15.0)
        self.pull, self.speed = self.g, 0.0
        drop = length * rng.uniform(0.3, 0.6)
        stiff = 10.0 ** rng.uniform(3, 7) if stiff is None else stiff
        self.stiff = stiff
        k = stiff * mass * self.g / length
        self.fall = np.sqrt(2 * drop / self.g)
        damped = bool(rng.integers(2)) if damped is None else damped
        c = mass / self.fall * rng.uniform(0.05, 0.3) if damped else 0.0
        self.at = length * rng.normal(size=3)
        self.values = {"ball.mass": mass, "rail.law[0]": k, "rail.law[1]": drop, "rail.c": c}
        self.names = [n for n in self.values if damped or n != "rail.c"]
        bounces = rng.uniform(0.6, 3.4) if bounces is None else bounces
        # in the air between two bounces, or before the first
        self.end = self.fall * (2.0 * round(bounces) + rng.uniform(-0.6, 0.6)) if bounces > 0.5 else 0.9 * self.fall

    def model(self, law=None):
        mass, k, drop, c = self.values.values()
        m = mb.Model("bouncing ball", gravity=tuple(self.pull * self.axis))
        velocity = tuple(self.speed * self.axis)
        b = m.body("ball", mass=mass, inertia=(mass * self.length**2,) * 3, at=self.at, velocity=velocity)
        m.prismatic("rail", m.ground, b, at=self.at, axis=self.axis, c=c, law=law or mb.Gap(k, drop))
        m.marker("far", m.ground, at=self.at + self.length * np.array([0.6, -0.5, 0.62]))
        return m

    def fallen(self, values):
        mass, k, drop, c = (complex(x) for x in values)
        t, u, v, held = 0.0, 0.0j, 0.0j, False
        while True:
            piece = (self.spring if held else self.air)(mass, k, drop, c, u, v)
            period = np.pi / np.sqrt(k / mass).real
            ahead = np.linspace(0.0, 1.2 * period, 400) if held else self.fall * np.geomspace(1e-9, 6.0, 2000)
            gone = [(piece(s)[0] - drop).real * (1 if held else -1) for s in ahead]
            # the first place behind the start where the distance has changed its sign
            i = next((i for i in range(2, len(gone)) if gone[i] <= 0 < gone[i - 1]), None)
            s = None if i is None else complex(0.5 * (ahead[i - 1] + ahead[i]))
            for _ in range(60 if s is not None else 0):
                position, rate = piece(s)
                s -= (position - drop) / rate
            if s is None or (t + s).real >= self.end:
                return piece(self.end - t)[0]
            (u, v), t, held = piece(s), t + s, not held

    def air(self, mass, k, drop, c, u, v):
        if c == 0:
            return lambda s: (u + v * s + 0.5 * self.g * s * s, v + self.g * s)
        rate, limit = c / mass, mass * self.g / c
        return lambda s: (
            u + limit * s + (v - limit) * (1 - np.exp(-rate * s)) / rate,
            limit + (v - limit) * np.exp(-rate * s),
        )

    def spring(self, mass, k, drop, c, u, v):
        rate, rest = c / (2 * mass), drop + mass * self.g / k
        w = np.sqrt(k / mass - rate**2)
        a, b = u - rest, (v + rate * (u - rest)) / w
        return lambda s: (
            rest + np.exp(-rate * s) * (a * np.cos(w * s) + b * np.sin(w * s)),
            np.exp(-rate * s) * ((b * w - a * rate) * np.cos(w * s) - (a * w + b * rate) * np.sin(w * s)),
        )

    def exact(self):
        known = np.array(list(self.values.values()))
        out = []
        for name in self.names:
            moved = known.astype(complex)
            i = list(self.values).index(name)
            moved[i] += 1j * COMPLEX_STEP * known[i]
            out.append(self.fallen(moved).imag / (COMPLEX_STEP * known[i]))
        return np.array(out)

    def off(self, m, scheme, method, law=None, **steps):
        """The error of the gradient over its largest effect, and the gradient."""
        objective = mb.Final(lambda s: sum(float(a) * x for a, x in zip(self.axis, s.position("ball"), strict=True)))
        found = mb.gradient(m, objective, self.names, t=self.end, scheme=scheme, method=method, **steps)
        exact, values = self.exact(), np.array([self.values[n] for n in self.names])
        return np.abs((found.gradient - exact) * values).max() / np.abs(exact * values).max(), found


class Thrown(Ball):
    """Thrown up against a stop of which it passes the place by a part of the length, without damping."""

    def __init__(self, seed, beyond, stiff=1e6):
        super().__init__(seed, stiff, damped=False)
        drop = self.values["rail.law[1]"]
        self.pull, self.speed = -self.g, np.sqrt(2 * self.g * (drop + beyond * self.length))
        self.end = self.speed / self.g * np.random.default_rng([seed, 41]).uniform(1.4, 1.9)

    def fallen(self, values):
        mass, k, drop, _ = values
        speed, w = np.sqrt(self.speed**2 - 2 * self.g * drop), np.sqrt(k / mass)
        t = self.end - (self.speed - speed) / self.g - 2 * np.arctan(speed * w / self.g) / w
        return drop - speed * t - 0.5 * self.g * t * t
