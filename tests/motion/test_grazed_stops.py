"""A ball thrown against a stiff stop that it hardly touches: a contact much shorter than a step, wherever in it, is not passed over."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest


class Thrown:
    """Up against a stop, with so much speed left as it would rise by this part of a length beyond it."""

    def __init__(self, seed: int, beyond: float) -> None:
        rng = np.random.default_rng([seed, 41])
        self.length, self.mass = 10.0 ** rng.uniform(-1, 2), 10.0 ** rng.uniform(-1, 2)
        axis = rng.normal(size=3)
        self.axis, self.at = axis / np.linalg.norm(axis), self.length * rng.normal(size=3)
        self.g, self.gap = self.length * rng.uniform(5, 15), self.length * rng.uniform(0.3, 0.6)
        self.k = 1e6 * self.mass * self.g / self.length
        self.speed = np.sqrt(2 * self.g * (self.gap + beyond * self.length))
        self.end = rng.uniform(1.4, 1.9) * self.speed / self.g

    def model(self) -> mb.Model:
        m = mb.Model("thrown", gravity=tuple(-self.g * self.axis))
        ball = m.body(
            "ball",
            mass=self.mass,
            inertia=(self.mass * self.length**2,) * 3,
            at=self.at,
            velocity=tuple(self.speed * self.axis),
        )
        m.prismatic("rail", m.ground, ball, at=self.at, axis=self.axis, law=mb.Gap(self.k, self.gap))
        return m

    def height(self) -> float:
        """At the end: it meets the stop with speed v and leaves it with -v after 2 atan(v w/g)/w, w^2 = k/m."""
        v, w = np.sqrt(self.speed**2 - 2 * self.g * self.gap), np.sqrt(self.k / self.mass)
        t = self.end - (self.speed - v) / self.g - 2 * np.arctan(v * w / self.g) / w
        return self.gap - v * t - self.g * t * t / 2


@pytest.mark.parametrize("beyond", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("method", ["explicit", "radau", "bdf"])
@pytest.mark.parametrize("seed", range(5))
def test_a_contact_much_shorter_than_a_step_is_met(seed, method, beyond):
    ball = Thrown(seed, beyond)
    model = ball.model()
    for rtol in (1e-5, 1e-7, 1e-9):
        traj = mb.simulate(model, ball.end, method=method, rtol=rtol)
        off = abs((traj.position("ball")[-1] - ball.at) @ ball.axis - ball.height())
        off /= traj.snapshot.system.characteristic_length
        print(f"{method}, {beyond:.0e}, rtol {rtol:.0e}: error {off:.1e} in {len(traj.steps) - 1} steps")
        # a slow contact multiplies errors: what it left of v takes the ball back
        assert off < 100 * rtol or off < 3 * traj.error < 1e4 * rtol
