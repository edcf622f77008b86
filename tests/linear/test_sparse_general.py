"""Large models with followers, torques, cross-coupled bearings, drives, couplers, functions, rolling and flexible bodies: the sparse route
against the dense one and against closed forms. All data are invented."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import cycle

import mbrs as mb
import numpy as np
import pytest
from constraint_models import frame
from mbrs.flexible import beam
from mbrs.linear import sparse_modes
from mbrs.linear.sparse_modes import model_modes
from random_models import random_tree
from scipy.optimize import brentq

# length and mass of a metre and a kilogram; time is in seconds
UNITS = {"m, kg": (1.0, 1.0), "mm, t": (1e3, 1e-3)}
units = pytest.mark.parametrize("unit", list(UNITS.values()), ids=list(UNITS))
seeds = pytest.mark.parametrize("seed", range(3))
KINDS = ("revolute", "spherical", "bushing", "prismatic", "cylindrical", "universal")


class Chain:
    """A chain of bodies in arbitrary axes, bent in space, on joints with springs and dampers in turn."""

    def __init__(self, seed, unit, n=30, kinds=KINDS, gravity=True, c=0.0):
        self.rng, (self.length, self.mass), self.turn = np.random.default_rng(seed), unit, frame(seed)
        g = 9.81 * self.length * self.turn @ np.array([0.1, -0.3, -0.95])
        self.model = mb.Model("chain", gravity=tuple(g) if gravity else None)
        self.c, self.kinds = c, kinds
        self.end, self.bodies = self.point(0.3, -0.2, 0.1), []
        for kind, i in zip(cycle(kinds), range(n), strict=False):
            self.link(kind, i, self.bodies[-1] if self.bodies else self.model.ground)

    def point(self, *p):
        return self.length * self.turn @ np.array(p)

    def body(self, name, at):
        axes = np.linalg.qr(self.rng.normal(size=(3, 3)))[0]
        inertia = self.mass * self.length**2 * (axes @ np.diag(self.rng.uniform(0.03, 0.05, size=3)) @ axes.T)
        com = 0.02 * self.length * self.rng.normal(size=3)
        return self.model.body(name, mass=self.mass * self.rng.uniform(0.5, 1.5), inertia=inertia, at=at, com=com)

    def stiffness(self, kind):
        straight, turned = self.mass * 2e5, self.mass * self.length**2 * 4e3
        return {
            "revolute": turned,
            "prismatic": straight,
            "spherical": [turned, 1.3 * turned, 0.8 * turned],
            "cylindrical": [straight, turned],
            "universal": [turned, 1.2 * turned],
            "planar": [straight, 1.4 * straight, turned],
            "bushing": np.array([straight, 2 * straight, 3 * straight, turned, 2 * turned, 1.5 * turned]),
        }[kind]

    def skew(self):
        """A stiffness that couples across, of a bearing."""
        k, turned = self.stiffness("bushing")[0] * 0.1, self.stiffness("bushing")[3] * 0.1
        full = np.diag([k, k, k, turned, turned, turned])
        full[0, 1], full[1, 0], full[3, 4] = 0.5 * k, -0.5 * k, 0.3 * turned
        return full

    def arm(self):
        """A flexible body that the chain carries by its root, and that carries a weight."""
        axes, second = frame(int(self.rng.integers(1000))), self.mass * self.length**3
        span = 0.7 * self.length
        one = beam(
            span,
            mass=2.0 * self.mass / self.length,
            EI_flap=900 * second,
            EI_edge=1500 * second,
            modes=4,
            attach=["tip"],
        )
        made = self.model.flexible_body("arm", one, at=self.end, orientation=axes)
        self.model.fixed("hold", "b20", made.node("root"), at=self.end)
        tip = self.end + axes @ [span, 0, 0]
        weight = self.body("weight", tip)
        self.model.bushing("load", made.node("tip"), weight, at=tip, k=self.stiffness("bushing"))

    def link(self, kind, i, last):
        m, step = self.model, self.point(*(self.rng.normal(size=3) * 0.05 + [0.12, 0.02, -0.05]))
        body = self.body(f"b{i}", self.end + 0.5 * step)
        k = self.stiffness(kind)
        options = {"at": self.end, "k": k, "c": self.c * np.asarray(k)}
        if kind == "bushing":
            a = self.rng.normal(size=(6, 6)) * np.sqrt(k)[:, None] * 0.2
            options["k"] = np.diag(k) + a @ a.T
            m.bushing(f"j{i}", last, body, **options)
        else:
            if kind != "spherical":
                options["axis"] = self.rng.normal(size=3)
            if kind == "universal":
                options["axis2"] = np.cross(options["axis"], self.rng.normal(size=3))
            getattr(m, kind)(f"j{i}", last, body, **options)
        self.bodies.append(body)
        self.end = self.end + step


def compare(m, at=None, n=8, tol=1e-9):
    """The n lowest roots of both routes."""
    dense = mb.modes(m, at=at)
    found = model_modes(m, at, n, (), time.perf_counter())
    assert found is not None
    s, t = found.eigenvalue, dense.eigenvalue[:n]
    error = np.abs(s - t) / np.abs(t)
    print(f"{error.max():.1e}, estimate {found.error.max():.1e}, {found.stats.route}, {found.stats.counts}")
    assert error.max() < tol
    assert list(found.kind) == list(dense.kind[:n])
    assert found.coordinates == dense.coordinates
    assert found.status == "converged"
    for i in (i for i in range(n) if len(dense.group_of(i)) == 1):
        a, b = dense.shape[:, i], found.shape[:, i]
        assert abs(np.vdot(a, b)) > (1 - 1e-7) * np.linalg.norm(a) * np.linalg.norm(b)
    for name in (m.bodies[0].name, m.bodies[-1].name):
        a, b = np.abs(found.body_shape(name)), np.abs(dense.body_shape(name)[:, :n])
        np.testing.assert_allclose(a, b, atol=1e-6 * b.max())
    np.testing.assert_allclose(found.energy().kinetic_body, dense.energy().kinetic_body[:, :n], atol=1e-6)
    np.testing.assert_allclose(found.energy().strain_element, dense.energy().strain_element[:, :n], atol=1e-6)
    return found


@pytest.mark.some(4)
@units
@seeds
@pytest.mark.parametrize("c", [0.0, 1e-4])
def test_followers_and_torques(seed, unit, c):
    made = Chain(seed, unit, c=c)
    newton = made.length * made.mass
    made.model.force("push", "b29", at=made.end, value=made.turn @ [40.0 * newton, 15.0 * newton, 0.0], frame="body")
    made.model.torque("twist", "b14", value=made.turn @ [0, 3.0 * newton * made.length, 0], frame="body")
    made.model.torque("turn", "b20", value=made.turn @ [2.0 * newton * made.length, 0, 0])
    found = compare(made.model, mb.equilibrium(made.model))
    assert "general" in found.stats.route


@pytest.mark.some(2)
@units
@seeds
def test_cross_coupled_bearings(seed, unit):
    made = Chain(seed, unit)
    k = made.mass * 3e4 * np.array([[1.0, 0.7, 0], [-0.7, 1.0, 0], [0, 0, 1.0]])
    full = np.zeros((6, 6))
    full[:3, :3] = k
    made.model.bushing("bearing", made.model.ground, "b12", at=made.end, k=full, orientation=made.turn)
    found = compare(made.model, mb.equilibrium(made.model))
    assert "general" in found.stats.route


@pytest.mark.some(2)
@units
@seeds
def test_drives_couplers_and_functions(seed, unit):
    made = Chain(seed, unit, kinds=("revolute", "bushing", "cylindrical"))
    m = made.model
    m.drive("held", "j6", 0.02)
    m.coupler("gear", "j9", "j15", 1.7)
    m.coupler("screw", "j2", "j5", 0.05 * made.length, first_coordinate="rz", second_coordinate="z")
    m.constraint(
        "tie", lambda t, u: u[0] + 0.5 * u[1] + 0.3 * u[0] * u[1] / made.length, ["b29.motion.x", "b20.motion.y"]
    )
    found = compare(m, mb.equilibrium(m))
    assert found.stats.route.startswith("sparse, undamped")


@units
@seeds
def test_rolling_and_knife_edges_at_rest(seed, unit):
    made = Chain(seed, unit, gravity=False)
    m = made.model
    normal, along = made.turn @ [0, 0, 1.0], made.turn @ [1.0, 0, 0]
    wheel = made.body("wheel", made.end)
    m.bushing("axle", "b29", wheel, at=made.end, k=made.stiffness("bushing"))
    radius = 0.2 * made.length
    m.rolling_disc(
        "roll",
        m.ground,
        wheel,
        at=(made.end - radius * normal, made.end),
        axis=normal,
        axis2=made.turn @ [0.6, 0.8, 0.0],
        radius=radius,
    )
    m.knife_edge("edge", m.ground, "b10", at=made.end, axis=along)
    compare(m)


@pytest.mark.some(2)
@units
@seeds
def test_velocity_constraints_at_rest(seed, unit):
    made = Chain(seed, unit)
    made.model.velocity_constraint("slip", lambda t, u: [1.0, -0.4], ["b29.motion.x", "b20.motion.y"])
    compare(made.model, mb.equilibrium(made.model))


@pytest.mark.some(3)
@units
@seeds
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("follower", [False, True])
def test_flexible_bodies(seed, unit, follower):
    made = Chain(seed, unit, n=12, kinds=("revolute", "bushing", "spherical"))
    m, (length, mass) = made.model, unit
    second = mass * length**3
    arm = beam(
        0.7 * length, mass=2.0 * mass / length, EI_flap=900.0 * second, EI_edge=1500.0 * second, modes=5, attach=["tip"]
    )
    for i, kind in enumerate(("fixed", "revolute", "fixed")):
        name = f"arm{i}"
        made_arm = m.flexible_body(name, arm, at=made.end, orientation=frame(seed + 10 + i))
        options = {} if kind == "fixed" else {"k": made.stiffness(kind)}
        if kind == "revolute":
            options["axis"] = made.rng.normal(size=3)
        getattr(m, kind)(f"hold{i}", f"b{3 * i + 2}", made_arm.node("root"), at=made.end, **options)
        tip = made.end + frame(seed + 10 + i) @ [0.7 * length, 0, 0]
        m.bushing(f"load{i}", made_arm.node("tip"), made.body(f"weight{i}", tip), at=tip, k=made.stiffness("bushing"))
    if follower:
        m.force("push", made_arm.node("tip"), value=made.turn @ [5.0 * length * mass, 0, 0], frame="body")
    compare(m, mb.equilibrium(m))


def test_a_free_body_of_the_model_keeps_its_joint():
    """Joints that carry bodies freely from body to body are no constraints, and their springs act."""
    made = Chain(4, (1.0, 1.0), n=20)
    last = made.bodies[-1]
    for i in range(4):
        body = made.body(f"f{i}", made.end + 0.1 * made.rng.normal(size=3))
        made.model.free(f"way{i}", last, body, at=made.end, k=made.stiffness("bushing"))
        last = body
    compare(made.model, mb.equilibrium(made.model))


@seeds
def test_bodies_that_nothing_holds_go_to_the_dense_route(seed, monkeypatch):
    """Rigid motions are double roots, whose number a search does not prove where matrices are not symmetric."""
    made = Chain(seed, (1.0, 1.0), gravity=False)
    made.model.bushing("bearing", made.model.ground, "b12", at=made.end, k=made.skew())
    one, other = (
        made.body(name, made.end + made.point(*p)) for name, p in (("one", (0, 0, 0)), ("two", (0.1, 0.1, 0)))
    )
    made.model.bushing("loose", one, other, at=made.end, k=made.stiffness("bushing"))
    assert model_modes(made.model, None, 8, (), time.perf_counter()) is None
    monkeypatch.setattr(sparse_modes, "_DENSE_AT_MOST", 10)
    with pytest.raises(mb.RouteError):
        model_modes(made.model, None, 8, (), time.perf_counter())


@pytest.mark.some(2)
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("seed", [*range(6), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(6, 12))])
def test_random_trees_that_move(seed):
    """With all elements and loads: the lowest roots are those of the dense route, which takes over where some are real."""
    rng = np.random.default_rng(seed)
    m = random_tree(rng, 14, ("revolute", "universal", "spherical"), each=True)
    at = mb.equilibrium(m).state
    at = replace(at, rate=0.3 * rng.normal(size=len(mb.linearize(m).coordinates)), kind="given")
    n = int(rng.integers(2, 5))
    found, dense = model_modes(m, at, n, (), time.perf_counter()), mb.modes(m, at=at)
    expected, real = dense.eigenvalue[:n], np.abs(dense.roots[dense.roots.imag == 0.0])
    if len(real) and real.min() <= np.abs(expected).max():
        assert found is None
    else:
        assert found is not None
        assert np.abs(found.eigenvalue - expected).max() < 1e-8 * np.abs(expected).max()


FEATURES = {
    "follower": lambda c, f: c.model.force("push", "b29", at=c.end, value=20 * f * c.rng.normal(size=3), frame="body"),
    "load": lambda c, f: c.model.force("dead", "b21", value=20 * f * c.rng.normal(size=3)),
    "torque": lambda c, f: c.model.torque("turn", "b17", value=2 * f * c.length * c.rng.normal(size=3)),
    "bearing": lambda c, f: c.model.bushing("bearing", c.model.ground, "b24", at=c.end, k=c.skew(), c=1e-4 * c.skew()),
    "drive": lambda c, f: c.model.drive("held", "j6", 0.02),
    "coupler": lambda c, f: c.model.coupler("gear", "j12", "j0", 1.7),
    "function": lambda c, f: c.model.constraint(
        "tie", lambda t, u: u[0] + 0.5 * u[1] + 0.3 * u[0] * u[1] / c.length, ["b29.motion.x", "b25.motion.y"]
    ),
    "edge": lambda c, f: c.model.knife_edge("edge", c.model.ground, "b10", at=c.end, axis=c.turn[:, 0]),
    "loop": lambda c, f: c.model.spherical("close", "b29", "b15", at=c.end),
    "redundant": lambda c, f: [c.model.fixed(name, "b29", "b15", at=c.end) for name in ("close", "again")],
    "point": lambda c, f: c.model.prismatic(
        "slide",
        "b29",
        c.model.body("point", mass=0.5 * c.mass, inertia=(0, 0, 0), at=c.end + c.point(0.1, 0, 0)),
        at=c.end,
        axis=c.turn[:, 1],
        k=1e4 * c.mass,
    ),
    "arm": lambda c, f: c.arm(),
}


@pytest.mark.some(4)
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("seed", [*range(8), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(8, 40))])
def test_features_in_any_company(seed):
    rng = np.random.default_rng(seed)
    made = Chain(seed, list(UNITS.values())[seed % 2], c=(0.0, 1e-4, 1e-3)[seed % 3], gravity=rng.random() < 0.7)
    chosen = [name for name in FEATURES if rng.random() < 0.35 and (name != "loop" or rng.random() < 0.5)]
    if "redundant" in chosen and "loop" in chosen:
        chosen.remove("loop")
    for name in chosen:
        FEATURES[name](made, made.length * made.mass)
    print(chosen)
    compare(made.model, mb.equilibrium(made.model), n=int(rng.integers(3, 8)))


def swirl(n, k=1e4, cross=30.0):
    """Points in a row, each held to the last by equal lateral springs and to ground by a cross-coupled bearing."""
    m, turn = mb.Model("swirl"), frame(3)
    last, at = m.ground, np.array([0.4, -0.3, 0.2])
    full = np.zeros((6, 6))
    full[0, 1], full[1, 0] = cross, -cross
    for i in range(n):
        body = m.body(f"b{i}", mass=2.0, inertia=(1, 1, 1), at=at)
        m.bushing(f"e{i}", last, body, at=at, k=(k, k, 1e4 * k, 1e4 * k, 1e4 * k, 1e4 * k), orientation=turn)
        m.bushing(f"c{i}", m.ground, body, at=at, k=full, orientation=turn)
        last = body
    return m


def test_a_large_row_in_cross_coupled_bearings():
    """z = x + i y: m z" + K z - i q z = 0 has s^2 = -omega_j^2 +- i q/m, omega_j = 2 sqrt(k/m) sin((2j - 1) pi/(4n + 2))."""
    n, count, k, cross = 800, 10, 1e4, 3e-3
    found = mb.modes(swirl(n, k, cross), n=count)
    omega = 2 * np.sqrt(k / 2.0) * np.sin((2 * np.arange(1, count) - 1) * np.pi / (4 * n + 2))
    s = np.sqrt(-(omega[:, None] ** 2) + np.array([1j, -1j]) * cross / 2.0)
    s = np.where(s.imag > 0, s, -s).ravel()
    s = s[np.lexsort((-s.real, np.abs(s).round(12)))][:count]
    error = np.abs(found.eigenvalue - s) / np.abs(s)
    print(f"{error.max():.1e}, estimate {found.error.max():.1e}, {found.stats.wall_time:.2f} s, {found.stats.counts}")
    assert found.stats.route.startswith("sparse, general")
    assert np.all(found.unstable == (s.real > 0))
    assert error.max() < 1e-9
    assert np.all(error <= found.error + 1e-13)
    assert found.stats.counts["factorisations"] <= 3  # it is held: no shift is looked for


def beck(p, guess):
    """The first root of p^2 + 2 w^2 + p w sin b sinh a + 2 w^2 cos b cosh a = 0, a^2, b^2 = -+p/2 + sqrt(p^2/4 + w^2)."""

    def rest(w):
        root = np.sqrt(p * p / 4 + w * w)
        a, b = np.sqrt(root - p / 2), np.sqrt(root + p / 2)
        return p * p + 2 * w * w + p * w * np.sin(b) * np.sinh(a) + 2 * w * w * np.cos(b) * np.cosh(a)

    return brentq(rest, *guess, xtol=1e-13)


def column(n, p):
    """Beck's column of unit length, mass and stiffness as links on hinges, under a follower p at its end."""
    m, turn = mb.Model("column"), frame(9)
    last, h = m.ground, 1.0 / n
    for i in range(n):
        at = turn @ np.array([i * h, 0, 0])
        body = m.body(f"b{i}", mass=h, inertia=np.eye(3) * h**3 / 12, at=at + turn @ np.array([h / 2, 0, 0]))
        m.revolute(f"j{i}", last, body, at=at, axis=turn[:, 1], k=n * (2.0 if i == 0 else 1.0))
        last = body
    m.force("push", last, at=turn @ np.array([1.0, 0, 0]), value=-p * turn[:, 0], frame="body")
    return m


@pytest.mark.slow
def test_a_large_column_under_a_follower():
    """Hinges lose accuracy with the square of their distance."""
    exact = [beck(10.0, (1.0, 8.0)), beck(10.0, (12.0, 25.0))]
    found = mb.modes(column(4200, 10.0), n=2)
    error = np.abs(found.eigenvalue.imag / exact - 1)
    print(error, found.error, found.stats.route, found.stats.wall_time)
    assert found.stats.route.startswith("sparse, general")
    assert error.max() < 1e-5
    coarse = mb.modes(column(20, 10.0)).eigenvalue[:2]
    fine = mb.modes(column(40, 10.0)).eigenvalue[:2]
    order = np.log2(np.abs(coarse.imag - exact) / np.abs(fine.imag - exact))
    assert np.all(np.abs(order - 2) < 0.3)


@pytest.mark.slow
def test_a_large_model_of_flexible_bodies():
    """Cantilevers clamped end to end are one cantilever, whose modes are w_j = (beta_j/L)^2 sqrt(EI/m)."""
    n, each = 520, 0.5
    m, turn = mb.Model("long"), frame(6)
    one = beam(each, mass=3.0, EI_flap=200.0, EI_edge=800.0, modes=8, attach=["tip"])
    last = m.ground
    for i in range(n):
        at = turn @ np.array([i * each, 0, 0])
        made = m.flexible_body(f"beam{i}", one, at=at, orientation=turn)
        m.fixed(f"f{i}", last, made.node("root"), at=at)
        last = made.node("tip")
    found = mb.modes(m, n=6)
    beta = np.array([1.8751040687119611, 4.694091132974175, 7.854757438237613, 10.995540734875467])
    w = (beta[:, None] / (n * each)) ** 2 * np.sqrt(np.array([200.0, 800.0]) / 3.0)
    w = np.sort(w.ravel())[:6]
    print(np.abs(found.omega / w - 1), found.error, found.stats.route, found.stats.wall_time)
    assert found.stats.route.startswith("sparse, undamped")
    assert np.abs(found.omega / w - 1).max() < 1e-4


@pytest.mark.some(4)
@units
@seeds
@pytest.mark.parametrize("c", [0.0, 1e-4])
def test_trees_that_move(seed, unit, c):
    """Rates of all joints, with a follower: gyroscopic terms, velocity terms, joints whose axes turn."""
    made = Chain(seed, unit, c=c)
    m = made.model
    m.force("push", "b29", at=made.end, value=made.turn @ [9.0 * made.length * made.mass, 0, 0], frame="body")
    at = mb.equilibrium(m).state
    n = len(mb.linearize(m, at=at).coordinates)
    size = np.abs(mb.modes(m, at=at).eigenvalue[0])
    scale = np.array(
        [made.length if name.endswith((".x", ".y", ".z")) else 1.0 for name in mb.linearize(m, at=at).coordinates]
    )
    at = replace(at, rate=0.02 * size * scale * made.rng.normal(size=n), kind="given")
    found = compare(m, at)
    assert found.stats.route.startswith("sparse, general")


def spinning(n, spin, k=10.0):
    """Discs at one place, each held to the last by equal springs of tilt, all spinning about one axis."""
    m, turn, at = mb.Model("spinning"), frame(2), np.array([0.2, 0.5, -0.3])
    last = m.ground
    for i in range(n):
        inertia = turn @ np.diag([1.0, 1.0, 1.6]) @ turn.T
        body = m.body(f"b{i}", mass=1.0, inertia=inertia, at=at, angular_velocity=spin * turn[:, 2])
        m.bushing(f"e{i}", last, body, at=at, k=(1e6, 1e6, 1e6, k, k, 1e6), orientation=turn)
        last = body
    return m


@pytest.mark.slow
def test_a_large_stack_of_spinning_discs():
    """I_t w^2 -+ I_p W w - k_j = 0, k_j = 4 k sin^2((2j - 1) pi/(4n + 2))."""
    n, count, spin, k = 700, 9, 0.01, 10.0
    found = mb.modes(spinning(n, spin, k), n=count)
    held = 4 * k * np.sin((2 * np.arange(1, count + 1) - 1) * np.pi / (4 * n + 2)) ** 2
    root = np.sqrt((1.6 * spin) ** 2 + 4 * held)
    w = np.sort(np.r_[root - 1.6 * spin, root + 1.6 * spin] / 2)[:count]
    error = np.abs(found.eigenvalue.imag / w - 1)
    print(f"{error.max():.1e}, estimate {found.error.max():.1e}, {found.stats.wall_time:.2f} s, {found.stats.counts}")
    assert found.stats.route.startswith("sparse, general")
    assert error.max() < 1e-9


@pytest.mark.some(1)
@pytest.mark.parametrize("growth", [3e-8, 3e-6])
def test_slow_growth_is_told_from_rounding(growth):
    """Whirls that nearly repeat: one of each pair grows by this part of its frequency, one decays."""
    n, k = 40, 1e4
    omega = 2 * np.sqrt(k / 2.0) * np.sin(np.pi / (4 * n + 2))
    m = swirl(n, k, cross=4.0 * omega**2 * growth)
    found = model_modes(m, None, 2, (), time.perf_counter())
    ratio = np.sort(found.eigenvalue.real / np.abs(found.eigenvalue))
    print(ratio, found.error, found.kind)
    assert sorted(found.kind) == ["flutter", "vibration"]
    assert ratio == pytest.approx([-growth, growth], rel=0.01)
    assert list(mb.modes(swirl(n, k, cross=0.0)).kind[:2]) == ["vibration"] * 2


def bearings(skew, apart):
    """Bodies on bearings of their own, each by a tenth stiffer than the first, whose stiffness across differs by ``apart`` and couples by
    ``skew``; it is not symmetric."""
    m = mb.Model("bearings")
    for i in range(30):
        at, k = (i, 0.2, 0.1), np.diag([100.0, 100.0 * (1 + apart), 300.0, 20.0, 30.0, 40.0])
        k[0, 1], k[1, 0], k[3, 4], k[4, 3] = 100 * skew, -100 * skew, 3.0, 1.0
        b = m.body(f"b{i}", mass=1.0, inertia=(0.1, 0.1, 0.1), at=at)
        m.bushing(f"k{i}", m.ground, b, at=at, k=k * (1 + 0.1 * i))
    return model_modes(m, None, 4, (), time.perf_counter())


@pytest.mark.parametrize(("apart", "groups"), [(1e-8, ((0, 1), (2, 3))), (1e-6, ())])
def test_roots_that_are_nearly_equal_are_repeated(apart, groups):
    found = bearings(0.0, apart)
    assert found.groups == groups
    assert found.eigenvalue[:2] == pytest.approx([10j, 10j * np.sqrt(1 + apart)], rel=1e-10)


@pytest.mark.exact
@pytest.mark.parametrize("skew", [3e-10, 1e-12])
def test_roots_that_circulation_hardly_parts_are_told_where_they_have_six_digits(skew):
    """s^2 = -100 (1 +- i skew): left and right vectors are orthogonal but for the skew part, over which rounding is divided."""
    found = bearings(skew, 0.0)
    if skew == 1e-12:
        assert found is None  # all modes are computed then
    else:
        assert np.max(found.error) < 1e-6 and np.abs(found.eigenvalue[:2] / 10j - 1).max() < 1e-6
