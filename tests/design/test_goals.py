"""Objectives on modes and transfer functions: closed forms of oscillators and absorbers, gradients against differences."""

import math

import mbrs as mb
import numpy as np
import pytest
from scipy.integrate import quad

AXIS = np.array([0.36, -0.48, 0.8])
AT = (0.37, -1.21, 2.03)


def oscillator(k=731.0, c=3.7, mass=1.93):
    """m x" + c x' + k x = f along an axis that is not one of the world."""
    m = mb.Model("oscillator")
    p = m.body("p", mass=mass, inertia=(0.1, 0.2, 0.25), at=AT)
    m.prismatic("rail", m.ground, p, at=AT, axis=AXIS, k=k, c=c)
    return m


def absorber(mu=0.083, omega=41.3, ratio=0.9, zeta=0.09):
    """A mass on a spring without damper, and a damped absorber on it, along an axis that is not one of the world."""
    big = 7.1
    m = mb.Model("absorber")
    a = m.body("a", mass=big, inertia=(0.1, 0.2, 0.25), at=AT)
    b = m.body("b", mass=mu * big, inertia=(0.1, 0.2, 0.25), at=(0.1, 0.2, 0.3))
    m.prismatic("main", m.ground, a, at=AT, axis=AXIS, k=big * omega**2)
    small = ratio * omega
    m.prismatic("tuned", a, b, at=AT, axis=AXIS, k=mu * big * small**2, c=2.0 * zeta * mu * big * small)
    return m


def mount(seed=3, damping=True):
    """A body on six bushings' worth of stiffness without symmetry, and another on it."""
    rng = np.random.default_rng(seed)
    m = mb.Model("mount")
    a = m.body("a", mass=1.31, inertia=(0.11, 0.23, 0.29), at=AT, orientation=mb.rotation(AXIS, 0.7))
    b = m.body("b", mass=0.77, inertia=(0.05, 0.07, 0.06), at=(0.5, -1.0, 2.6))
    c = [9.0, 4.0, 6.0, 0.3, 0.2, 0.1] if damping else [0.0] * 6
    m.bushing("ka", m.ground, a, at=(0.3, -1.1, 1.8), k=1e3 * (0.5 + rng.random(6)) * [1, 1, 1, 0.1, 0.1, 0.1], c=c)
    m.bushing("kb", a, b, at=(0.4, -1.1, 2.4), k=1e3 * (0.5 + rng.random(6)) * [1, 1, 1, 0.1, 0.1, 0.1], c=c)
    return m


NAMES = ["ka.k[0]", "kb.k[4]", "ka.c[2]", "a.mass", "b.at[1]", "kb.c[0]"]


def differences(goal, m, names=NAMES, e=1e-5):
    """The gradient by central differences of the values, over sizes of the parameters."""
    out = []
    for name in names:
        now = float(m.value(name))
        step = e * abs(now)
        ends = []
        for sign in (1.0, -1.0):
            m.set({name: now + sign * step})
            ends.append(goal.both(m, names)[0])
        m.set({name: now})
        out.append((ends[0] - ends[1]) / (2.0 * step))
    return np.array(out)


def loads(m):
    a, b = m["a"], m["b"]
    cases = [a.force("x"), {b.force(AXIS): 2.0, a.torque("y"): 0.3 - 0.4j}]
    return cases, [b.motion((0.6, 0.0, -0.8)), a.motion("rz", at=(0.1, 0.2, 0.3))]


GOALS = {
    "match": lambda m: mb.Match(mb.modes(m), frequency=6.1, damping=0.031, shape=mb.modes(m).shape[:, 5], weight=1.7),
    "peak": lambda m: mb.Peak(*loads(m), (1.0, 30.0), kind="mobility"),
    "peak below": lambda m: mb.Peak(*loads(m), (1.0, 30.0), below=1e-3, weight=3.0),
    "peak of points": lambda m: mb.Peak(*loads(m), np.linspace(1.0, 30.0, 23)),
    "mean square": lambda m: mb.MeanSquare(*loads(m), (2.0, 17.0), kind="accelerance"),
    "mean square of points": lambda m: mb.MeanSquare(*loads(m), np.linspace(1.0, 30.0, 23)),
    "robust": lambda m: mb.Robust(
        mb.MeanSquare(*loads(m), (2.0, 17.0)),
        mb.design.normal({"ka.k[0]": 0.0, "b.mass": 0.8}, {"ka.k[0]": 9.0, "b.mass": 0.05}, n=5, seed=4),
        spread=1.5,
    ),
    "worst": lambda m: mb.Robust(
        mb.Peak(*loads(m), (2.0, 17.0)),
        mb.design.normal({"b.mass": 0.8}, {"b.mass": 0.05}, n=4, seed=4),
        measure="worst",
    ),
}

QUICK = ("match", "peak below", "mean square")


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in GOALS])
def test_gradients_are_those_of_the_values(name):
    m = mount()
    goal = GOALS[name](m)
    value, slope = goal.both(m, NAMES)
    sizes = np.array([abs(float(m.value(n))) for n in NAMES])
    other = differences(goal, m)
    assert value > 0.0 and np.all(np.abs(slope * sizes).max() > 0.0)
    assert np.abs((slope - other) * sizes).max() < 2e-6 * np.abs(slope * sizes).max()


def test_the_peak_of_an_oscillator():
    """|H|max = 1 / (2 zeta sqrt(1 - zeta^2) k) of a receptance; the ends of the band where it does not peak inside."""
    k, c, mass = 731.0, 3.7, 1.93
    m = oscillator(k, c, mass)
    zeta = c / (2.0 * math.sqrt(k * mass))
    ports = m["p"].force(AXIS), m["p"].motion(AXIS)
    value, slope = mb.Peak(*ports, (0.5, 20.0)).both(m, ["rail.k", "rail.c", "p.mass"])
    top = 1.0 / (2.0 * zeta * math.sqrt(1.0 - zeta**2) * k)
    assert value == pytest.approx(top, rel=1e-11)

    def height(k, c, mass):
        z = c / (2.0 * np.sqrt(k * mass))
        return 1.0 / (2.0 * z * np.sqrt(1.0 - z**2) * k)

    by_hand = [height(k + 1e-30j, c, mass), height(k, c + 1e-30j, mass), height(k, c, mass + 1e-30j)]
    assert np.allclose(slope, np.imag(by_hand) / 1e-30, rtol=1e-8)
    low = mb.Peak(*ports, (8.0, 20.0)).both(m, ["rail.k"])[0]
    w = 16.0 * math.pi
    assert low == pytest.approx(1.0 / abs(k - mass * w**2 + 1j * c * w), rel=1e-12)


def test_the_mean_square_of_an_oscillator():
    k, c, mass = 731.0, 0.037, 1.93
    m = oscillator(k, c, mass)
    found = mb.MeanSquare(m["p"].force(AXIS), m["p"].motion(AXIS), (0.5, 20.0)).both(m, ["rail.k"])[0]

    def square(f):
        w = 2.0 * math.pi * f
        return 1.0 / ((k - mass * w**2) ** 2 + (c * w) ** 2)

    f0 = math.sqrt(k / mass) / (2.0 * math.pi)
    near = [f0 + s * 10.0**e for s in (-1, 1) for e in range(-5, 1)]
    wanted = quad(square, 0.5, 20.0, points=[*near, f0], epsrel=1e-12, limit=500)[0] / 19.5
    assert found == pytest.approx(wanted, rel=1e-9)


def test_an_absorber_in_white_noise():
    """Least mean square response of the main mass: Warburton, Earthquake Eng. Struct. Dyn. 10 (1982) 381-401, table II."""
    mu, omega = 0.083, 41.3
    m = absorber(mu, omega)
    goal = mb.MeanSquare(m["a"].force(AXIS), m["a"].motion(AXIS), (0.0, 4e3))
    best = mb.problem(m, goal, ["tuned.k", "tuned.c"], bounds={"tuned.k": (10.0, 1e4), "tuned.c": (0.1, 50.0)})
    found = best.solve(tol=1e-10)
    small = mu * 7.1
    ratio = math.sqrt(1.0 + mu / 2.0) / (1.0 + mu)
    zeta = math.sqrt(mu * (1.0 + 0.75 * mu) / (4.0 * (1.0 + mu) * (1.0 + 0.5 * mu)))
    k = small * (ratio * omega) ** 2
    assert found.status == "converged"
    assert found.x == pytest.approx([k, 2.0 * zeta * math.sqrt(k * small)], rel=2e-4)


def best_peak(mu):
    """The least possible peak of a main mass with absorber, over the static deflection: O. Nishihara and T. Asami, J. Vib. Acoust.
    124 (2002) 576-582."""
    root = math.sqrt(4.0 + 3.0 * mu)
    inner = (8.0 + 9.0 * mu) ** 2 * (16.0 + 9.0 * mu) - 128.0 * root**3
    return math.sqrt(inner / (3.0 * (32.0 + 27.0 * mu))) / (3.0 * mu)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["penalty", "limit"])
def test_peaks_of_an_absorber_below_a_limit(how):
    """A limit just above the least possible peak is met, and one just below it is not."""
    mu, omega = 0.083, 41.3
    least = best_peak(mu) / (7.1 * omega**2)
    bounds = {"tuned.k": (100.0, 5e3), "tuned.c": (0.5, 50.0)}
    for factor, possible in ((1.002, True), (0.99, False)):
        m = absorber(mu, omega)
        ports = m["a"].force(AXIS), m["a"].motion(AXIS), (1.0, 20.0)
        if how == "penalty":
            p = mb.problem(m, mb.Peak(*ports, below=factor * least), ["tuned.k", "tuned.c"], bounds=bounds)
            best = p.solve(tol=1e-15)
            assert (best.value < 1e-12) == possible
        else:
            small = mb.MeanSquare(*ports)
            limit = mb.Bounded(mb.Peak(*ports), upper=factor * least)
            p = mb.problem(m, small, ["tuned.k", "tuned.c"], bounds=bounds, constraints=[limit])
            assert (p.solve().status != "infeasible") == possible
        if possible:
            w = np.linspace(2.0, 120.0, 20001)
            k, c, s = m.value("tuned.k"), m.value("tuned.c"), mu * 7.1
            z = k + 1j * c * w
            h = (z - s * w**2) / ((7.1 * (omega**2 - w**2) + z) * (z - s * w**2) - z**2)
            assert np.abs(h).max() < 1.0023 * least


def test_a_mode_is_followed_through_a_crossing():
    """Two sliders that do not know each other: the lower one is to become the higher one."""
    m = mb.Model("two")
    for name, at, k in (("a", AT, 400.0), ("b", (5, 6, 7), 900.0)):
        p = m.body(name, mass=1.7, inertia=(1, 1, 1), at=at)
        m.prismatic(f"{name}rail", m.ground, p, at=at, axis=AXIS, k=k, c=0.3)
    modes = mb.modes(m)
    wanted = 1.9 * modes.frequency[1]
    goal = mb.Match(modes, frequency=wanted, shape=modes.shape[:, 0])
    best = mb.problem(m, goal, ["arail.k"], bounds={"arail.k": (10.0, 1e5)}).solve(tol=1e-15)
    assert best.x[0] == pytest.approx(1.7 * (2.0 * np.pi * wanted) ** 2, rel=1e-5)
    assert mb.modes(m).frequency == pytest.approx([modes.frequency[1], wanted], rel=1e-5)


@pytest.mark.exact  # noise on the numbers of the legs parts the group
def test_modes_of_a_repeated_group():
    m = mb.examples.cubic_hexapod()
    modes = mb.modes(m)
    assert modes.groups
    goal = mb.Match(modes, frequency=12.0, shape=modes.shape[:, 0])
    slope = goal.both(m, ["k_leg"])[1]
    assert slope == pytest.approx(differences(goal, m, ["k_leg"]), rel=1e-7)


def test_modes_at_an_equilibrium():
    g = mb.Model("pendulum", gravity=(0, -9.81, 0))
    p = g.body("p", mass=1.3, inertia=(0.1, 0.12, 0.15), at=(0.9, 0.1, 0))
    g.revolute("A", g.ground, p, at=(0, 0, 0), axis="z", k=3.0, c=0.1)
    modes = mb.modes(g, at=mb.equilibrium(g))
    goal = mb.Match(modes, frequency=0.9, damping=0.02, shape=modes.shape[:, 0])
    names = ["A.k", "p.mass", "A.c"]
    assert goal.both(g, names)[1] == pytest.approx(differences(goal, g, names), rel=1e-6)


def test_the_worst_and_the_spread_of_a_sample():
    m = oscillator()
    ports = m["p"].force(AXIS), m["p"].motion(AXIS)
    goal = mb.Peak(*ports, (0.5, 20.0))
    sample = mb.design.from_table({"rail.c": [-0.4, 0.0, 0.7], "p.mass": [1.9, 2.0, 1.7]})
    heights = []
    for dc, mass in ((-0.4, 1.9), (0.0, 2.0), (0.7, 1.7)):
        zeta = (3.7 + dc) / (2.0 * math.sqrt(731.0 * mass))
        heights.append(1.0 / (2.0 * zeta * math.sqrt(1.0 - zeta**2) * 731.0))
    found = mb.Robust(goal, sample, spread=0.7).both(m, ["rail.c"])[0]
    assert found == pytest.approx(np.mean(heights) + 0.7 * np.std(heights), rel=1e-10)
    worst = mb.Robust(goal, sample, measure="worst").both(m, ["rail.c"])[0]
    assert worst == pytest.approx(max(heights), rel=1e-10)
    assert (m.value("rail.c"), m.value("p.mass")) == (3.7, 1.93)
    both = mb.problem(m, [goal, goal], ["rail.c"])
    assert both.fun(both.x0) == pytest.approx(2.0 * goal.both(m, ["rail.c"])[0], rel=1e-14)


def test_motions_and_linear_results_in_one_problem():
    m = oscillator()
    m.set({"p.velocity[0]": 0.36, "p.velocity[1]": -0.48, "p.velocity[2]": 0.8})
    ports = m["p"].force(AXIS), m["p"].motion(AXIS)
    swing = mb.Integral(lambda s: s.velocity("p") @ s.velocity("p"))
    limit = mb.Bounded(mb.Peak(*ports, (0.5, 20.0)), upper=4e-3)
    p = mb.problem(m, swing, ["rail.k", "rail.c"], t=0.3, step=0.01, constraints=[limit, mb.Bounded(swing, upper=9.0)])
    z = p.x0 * [1.03, 0.95]
    for c in p.constraints:
        e = 1e-5
        slope = [(c["fun"](z + e * u) - c["fun"](z - e * u)) / (2 * e) for u in np.eye(2)]
        assert np.allclose(c["jac"](z), slope, rtol=1e-6)
    assert p.fun(z) > 0.0 and len(p.history) > 1


BAD = [
    (lambda m: mb.Match(mb.modes(m), frequency=2.0), "shape= of mb.Match takes 12 numbers"),
    (lambda m: mb.Match(mb.modes(m), shape=mb.modes(m).shape[:, 0]), "needs frequency="),
    (lambda m: mb.Match(mb.modes(m), frequency=-2.0, shape=mb.modes(m).shape[:, 0]), "positive number"),
    (lambda m: mb.Match(m, frequency=2.0, shape=[1.0]), "takes modes of a mb.Model"),
    (lambda m: mb.Peak([], "a.motion.x", (1.0, 2.0)), "needs inputs and outputs"),
    (lambda m: mb.Peak("a.force.x", "a.motion.x", (2.0, 1.0)), "is not a range"),
    (lambda m: mb.Peak("a.force.x", "a.motion.x", (2.0, 3.0), below=0.0), "below= of mb.Peak must be a positive number"),
    (lambda m: mb.MeanSquare("a.force.x", "a.motion.x", (2.0, 3.0), at="there"), "there is no at 'there'"),
    (lambda m: mb.Robust(mb.Integral(lambda s: 0.0), mb.design.from_table({"a.mass": [1.0]})), "mb.Robust takes"),
    (lambda m: mb.problem(m, mb.Peak("a.force.x", "a.motion.x", (2.0, 3.0)), ["a.mass"], t=1.0), "t= belongs to motions"),
    (lambda m: mb.problem(m, mb.Final(lambda s: 0.0), ["a.mass"]), "t= is missing"),
    (lambda m: mb.problem(m, [], ["a.mass"]), "objective= takes"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "message"), BAD, ids=range(len(BAD)))
def test_wrong_objectives_are_named(make, message):
    with pytest.raises(mb.errors.ModelError, match=message):
        make(mount())


def test_objectives_that_have_no_value_are_named():
    m = mount(damping=False)
    with pytest.raises(mb.errors.ModelError, match="is infinite: there is no damping at"):
        mb.Peak("a.force.x", "a.motion.x", (1.0, 30.0)).both(m, ["a.mass"])
    modes = mb.modes(m)
    strange = np.zeros(12)
    strange[0] = 1.0
    other = oscillator()
    with pytest.raises(mb.errors.ModelError, match="compute them anew"):
        mb.Match(modes, frequency=2.0, shape=strange).both(other, ["rail.k"])
