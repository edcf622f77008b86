"""Gradients of the explicit scheme of order 8: every scene, closed forms, the order of value and gradient, differences."""

import mbrs as mb
import numpy as np
import pytest
from gradient_scenes import SCENES
from mbrs.examples import five_bar
from motion_models import open_chain, silent, spatial_loop
from test_gradient import FIVE_BAR, LENGTHS, differences, drift, worst
from test_gradient_hand import against_direct

EXPLICIT = {"scheme": "explicit"}


@pytest.mark.some(12)
@pytest.mark.parametrize("name", SCENES)
def test_adjoint_is_direct_in_every_scene(name):
    error = against_direct(silent(SCENES[name]), "explicit")
    print(f"{name}: adjoint - direct {error:.1e}")
    assert error < 1e-9


def oscillator(k):
    m = mb.Model("one")
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1, 0, 0))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x", k=m.parameter("k", k))
    return m


@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_an_oscillator_has_its_closed_form(method):
    """x = sin(w t)/w, w^2 = k: x at the end, the integral of x^2, and their derivatives by k, to 1e-9 with the tolerance 1e-10."""
    w, t = 2.0, 3.0
    goals = [mb.Final(lambda s: s.position("p")[0]), mb.Integral(lambda s: s.position("p")[0] ** 2)]
    value, slope = mb.gradient(oscillator(w * w), goals, "k", t=t, rtol=1e-10, method=method, **EXPLICIT)
    one, two = np.sin(w * t), np.sin(2 * w * t)
    by_w = [
        t * np.cos(w * t) / w - one / w**2,
        -t / w**3 - t * np.cos(2 * w * t) / (2 * w**3) + 3 * two / (4 * w**4),
    ]
    assert value == pytest.approx([one / w, t / (2 * w**2) - two / (4 * w**3)], abs=1e-9)
    assert slope[:, 0] == pytest.approx(np.array(by_w) / (2 * w), abs=1e-9)


SMOOTH = {five_bar: LENGTHS, open_chain: ["a.mass", "bush.k[1]"], spatial_loop: ["R1.at[0]", "spring.c", "crank.mass"]}


def place(m):
    """A number of the place of the last body."""
    body = m.bodies[-1].name
    return lambda s: np.sum(s.position(body) * [1.0, -2.0, 0.5])


@pytest.mark.some(1)
@pytest.mark.parametrize("make", list(SMOOTH), ids=lambda f: f.__name__)
def test_value_and_gradient_have_the_order_of_the_scheme(make):
    """Of a final value and of an integral, with fixed steps; a scheme of order 7 would gain a factor of 128 a halving."""
    m = silent(make)
    goals = [mb.Final(place(m)), mb.Integral(place(m))]

    def run(h):
        return mb.gradient(m, goals, SMOOTH[make], t=0.8, step=h, method="direct", **EXPLICIT)

    coarse, fine, exact = run(0.05), run(0.025 if make is five_bar else 0.0125), run(0.00625)
    for i in range(2):
        errors = [worst(np.asarray(g.gradient)[i], np.asarray(exact.gradient)[i]) for g in (coarse, fine)]
        order = np.log2(errors[0] / errors[1]) / np.log2(len(fine.t) / len(coarse.t))
        print(f"{make.__name__} {i}: errors {errors}, order {order:.2f}")
        assert order > 7.7


def test_the_known_gradient_and_what_the_run_says_of_it():
    m = silent(five_bar)
    for rtol in (1e-5, 1e-7):
        value, slope = found = mb.gradient(m, mb.Integral(drift), LENGTHS, t=1.0, rtol=rtol, **EXPLICIT)
        effects = np.abs(np.asarray(slope) * found.where).max()
        true = np.abs((np.asarray(slope) - FIVE_BAR[1.0][1]) * found.where).max() / effects
        print(f"rtol {rtol}: {len(found.t) - 1} steps, error {true:.1e}, estimated {found.error:.1e}")
        assert abs(value - FIVE_BAR[1.0][0]) < rtol
        # the known gradient has eight digits
        assert true < 2.0 * found.error + 1e-8
        assert found.error < 100.0 * true + 1e-8


def test_differences_of_the_same_steps():
    m = silent(five_bar)
    psi = mb.Integral(drift)
    slope = mb.gradient(m, psi, LENGTHS, t=0.5, step=0.02, **EXPLICIT).gradient
    assert slope == pytest.approx(differences(m, psi, LENGTHS, t=0.5, step=0.02, **EXPLICIT), abs=1e-9)


def test_a_trajectory_has_its_derivatives_over_time():
    w = 2.0
    traj = mb.simulate(oscillator(w * w), t=2.0, rtol=1e-10, method="explicit", parameters="k")
    by_w = traj.t * np.cos(w * traj.t) / w - np.sin(w * traj.t) / w**2
    assert traj.sensitivity("p.position")[:, 0, 0] == pytest.approx(by_w / (2 * w), abs=1e-9)


def test_checkpoints_give_the_same():
    """A motion that is not kept whole is run again between checkpoints."""
    m = silent(spatial_loop)
    psi = mb.Integral(place(m))
    whole, parts = (
        mb.gradient(m, psi, SMOOTH[spatial_loop], t=0.4, step=0.02, method="adjoint", keep=keep, **EXPLICIT)
        for keep in (2**23, 0)
    )
    assert parts.stats.counts["checkpoints"] > 1
    assert parts.gradient == pytest.approx(np.asarray(whole.gradient), rel=1e-12)


def stiff(k):
    """A pendulum whose rod is a spring: the motion is that of the pendulum, the vibration as fast as the spring is stiff."""
    m = mb.Model("stiff", gravity=(0, 0, -9.81))
    b = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(1, 0, 0))
    m.spring_damper("rod", m.ground, b, at=((0, 0, 0), (1, 0, 0)), k=k, c=0.01 * k**0.5)
    return m


@pytest.mark.parametrize(
    ("k", "options", "scheme"),
    [
        (1e2, {"rtol": 1e-6}, "explicit"),
        (1e2, {"step": 0.01}, "explicit"),
        (1e4, {"step": 0.02}, "ali3p"),
        (1e8, {"step": 0.01}, "ali3p"),
        (1e8, {"rtol": 1e-6}, "radau"),
    ],
)
def test_auto_takes_the_explicit_scheme_where_nothing_is_stiff(k, options, scheme):
    m = silent(lambda: stiff(k))
    psi = mb.Final(lambda s: s.position("b")[2])
    found = mb.gradient(m, psi, ["b.mass", "rod.length"], t=0.5, scheme="auto", **options)
    same = mb.gradient(m, psi, ["b.mass", "rod.length"], t=0.5, scheme=scheme, **options)
    assert found.stats.route.startswith(scheme)
    assert np.array_equal(found.gradient, same.gradient)
