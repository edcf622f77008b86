"""Fixed steps of methods that keep their matrices, so short that the first correction of rates is nothing: with rows of constraints what is
left of the forces shows in the next correction alone. Truth is "explicit" at 1e-13."""

from __future__ import annotations

from itertools import pairwise

import jitter
import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest

END = 0.4


def ball_on_a_wire():
    m = mb.Model("ball on a wire", gravity=(0.4, -1.1, -9.7))
    ball = m.body(
        "ball",
        mass=1.5,
        inertia=(0.15, 0.13, 0.17),
        at=(0.8, 0.11, -0.6),
        velocity=(0.12, 2.0, (0.12 * 0.8 + 2.0 * 0.11) / 0.6),
    )
    m.distance("wire", m.ground, ball, at=((0, 0, 0), (0.8, 0.11, -0.6)))
    return m, "ball"


def rolling_disc():
    return mb.examples.rolling_disc(), "disc"


def five_bar():
    model = zoo.five_bar(END).model
    return model, next(iter(model.bodies)).name


SCENES = [ball_on_a_wire, rolling_disc, five_bar]


def errors(scene, steps, **options):
    model, body = scene()
    times = np.linspace(0.0, END, 5)
    truth = mb.simulate(model, t=times, rtol=1e-13, method="explicit").position(body)
    runs = [mb.simulate(model, t=times, step=h, **options) for h in steps]
    found = [np.abs(run.position(body) - truth).max() for run in runs]
    print(scene.__name__, options, [f"{h:.0e}: {e:.1e}" for h, e in zip(steps, found, strict=True)])
    return found


@pytest.mark.parametrize("scene", SCENES, ids=lambda s: s.__name__)
@pytest.mark.parametrize("options", [dict(method="bdf"), dict(method="radau")], ids=str)
def test_shorter_steps_err_less_where_rows_hold(scene, options):
    """From 1e-3 s on errors fall, to what rounding adds up."""
    if jitter.level():
        pytest.skip("noise moves the truth by more")
    found = errors(scene, (1e-3, 4e-4, 2e-4, 1e-4), **options)
    rounding = 2e-11
    assert all(b < max(0.5 * a, rounding) for a, b in pairwise(found))


def test_gradients_with_short_steps_of_bdf():
    """The mass of a pendulum changes nothing."""
    model, _ = ball_on_a_wire()
    objective = mb.Final(lambda s: s.position("ball")[1])
    made = mb.gradient(model, objective, ["ball.mass"], t=END, step=1e-4, scheme="bdf")
    truth = mb.simulate(model, t=[END], rtol=1e-13, method="explicit").position("ball")[-1, 1]
    print(made.value - truth, made.gradient)
    assert abs(made.value - truth) < 1e-11 and np.abs(made.gradient).max() < 1e-10
