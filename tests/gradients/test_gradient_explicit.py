"""Gradients of the explicit scheme of order 8: every scene, closed forms, the order of value and gradient, differences."""

import mbrs as mb
import numpy as np
import pytest
from gradient_scenes import SCENES
from motion_models import five_bar, open_chain, silent, spatial_loop
from test_gradient import FIVE_BAR, LENGTHS, differences, drift, everything, worst
from test_gradient_hand import against_direct

EXPLICIT = {"scheme": "explicit"}


@pytest.mark.parametrize("name", SCENES)
def test_adjoint_is_direct_in_every_scene(name):
    error = against_direct(silent(SCENES[name]), "explicit")
    print(f"{name}: adjoint - direct {error:.1e}")
    assert error < 1e-9


def swing(length, speed):
    """A pendulum of small mass moments on a ball: x(0) = (0, 0, -length), planar, of any amplitude."""
    m = mb.Model("swing", gravity=(0, 0, -9.81))
    m.parameter("l", length)
    b = m.body("b", mass=2.0, inertia=(0.02, 0.02, 0.02), at=(0, 0, -length), velocity=(speed, 0, 0))
    m.revolute("J", m.ground, b, at=(0, 0, 0), axis="y")
    return m


def oscillator(k=4.0):
    m = mb.Model("one")
    m.parameter("k", k)
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0), velocity=(0, 0, 0))
    m.prismatic("rail", m.ground, p, at=(1, 0, 0), axis="x", k="k", preload=4.0)
    return m


@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_an_oscillator_has_its_closed_form(method):
    """x = cos(w t), w^2 = k: x at the end, the integral of x^2, and their derivatives by k, to 1e-9 with the tolerance 1e-10."""
    w, t = 2.0, 3.0
    goals = [mb.Final(lambda s: s.position("p")[0]), mb.Integral(lambda s: s.position("p")[0] ** 2)]
    value, slope = mb.gradient(oscillator(w * w), goals, "k", t=t, rtol=1e-10, method=method, **EXPLICIT)
    sin2, cos2 = np.sin(2 * w * t), np.cos(2 * w * t)
    values = [np.cos(w * t), t / 2 + sin2 / (4 * w)]
    by_w = [-t * np.sin(w * t), t * cos2 / (2 * w) - sin2 / (4 * w * w)]
    assert value == pytest.approx(values, abs=1e-9)
    assert slope[:, 0] == pytest.approx(np.array(by_w) / (2 * w), abs=1e-9)


SMOOTH = {five_bar: LENGTHS, open_chain: ["a.mass", "bush.k[1]"], spatial_loop: ["R1.at[0]", "spring.c", "crank.mass"]}


@pytest.mark.parametrize("make", list(SMOOTH), ids=lambda f: f.__name__)
def test_value_and_gradient_have_the_order_of_the_scheme(make):
    """Of a final value and of an integral, with fixed steps."""
    m = silent(make)
    goals = [mb.Final(everything(m)), mb.Integral(everything(m))]
    found = {}
    for h in (0.4, 0.2, 0.1):
        found[h] = mb.gradient(m, goals, SMOOTH[make], t=0.8, step=h, method="direct", **EXPLICIT)
    exact = mb.gradient(m, goals, SMOOTH[make], t=0.8, step=0.01, method="direct", **EXPLICIT)
    for i in range(2):
        errors = {h: worst(np.asarray(g.gradient)[i], np.asarray(exact.gradient)[i]) for h, g in found.items()}
        values = {h: abs(g.value[i] - exact.value[i]) for h, g in found.items()}
        orders = [np.log2(e[0.4] / e[0.1]) / 2 for e in (values, errors)]
        print(f"{make.__name__} {i}: {errors} orders of value and gradient {orders}")


def test_differences_of_the_simulated_motion():
    """Eighth-order differences of mb.simulate; the gradient takes its tolerance from a run of its own."""
    m = silent(five_bar)
    value, slope = mb.gradient(m, mb.Integral(drift), LENGTHS, t=1.0, rtol=1e-10, **EXPLICIT)
    print(value - FIVE_BAR[1.0][0], slope - FIVE_BAR[1.0][1])
    assert abs(value - FIVE_BAR[1.0][0]) < 1e-9
    assert np.all(np.abs(slope - FIVE_BAR[1.0][1]) < 1e-8)
    assert slope == pytest.approx(differences(m, mb.Integral(drift), LENGTHS, t=1.0, step=0.02, **EXPLICIT), abs=1e-8)
