"""Models with many bodies: the sparse route against the dense one and against closed forms. All data are invented."""

from __future__ import annotations

import time

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import MbrsWarning
from mbrs.linear import sparse_modes
from mbrs.linear.sparse_modes import model_modes

INERTIA = ((0.02, 0.001, 0.002), (0.001, 0.03, 0.0), (0.002, 0.0, 0.025))


def sparse(m, n, at=None, without=()):
    """The sparse route whatever the size."""
    return model_modes(m, at, n, without, time.perf_counter())


def joint_chain(kinds, *, gravity=None, k=50.0, c=None, step=(0.1, 0.02, -0.2), grounded=True, n=24, seed=7):
    """Bodies on joints of the given types in turn, bent in space, every joint with a spring."""
    rng = np.random.default_rng(seed)
    m = mb.Model("chain", gravity=gravity)
    last, p = m.ground, np.zeros(3)
    for i in range(n):
        size = np.array(step) * (1 + 0.1 * np.sin(i))
        body = m.body(f"b{i}", mass=1.0 + 0.1 * (i % 3), inertia=INERTIA, at=p + size / 2)
        kind = kinds[i % len(kinds)]
        if i > 0 or grounded:
            options = {} if kind == "spherical" else {"axis": rng.normal(size=3)}
            free = {"spherical": 3, "cylindrical": 2}.get(kind, 1)
            options["k"] = k if free == 1 else [k * (1 + j) for j in range(free)]
            if c is not None:
                options["c"] = c if free == 1 else [c] * free
            getattr(m, kind)(f"j{i}", last, body, at=p, **options)
        last, p = body, p + size
    return m


def bushing_chain(n=24, *, grounded=True, full=False, c=None, seed=7):
    rng = np.random.default_rng(seed)
    m = mb.Model("bushings")
    last, p = m.ground, np.zeros(3)
    for i in range(n):
        body = m.body(f"b{i}", mass=1.0, inertia=(0.02, 0.03, 0.025), at=p + np.array([0.05, 0, 0]))
        k = np.diag([1e5, 2e5, 3e5, 2e2, 1e2, 3e2])
        if full:
            a = rng.normal(size=(6, 6)) * np.sqrt(np.diag(k))[:, None] * 0.3
            k = k + a @ a.T
        if i > 0 or grounded:
            m.bushing(f"e{i}", last, body, at=p, k=k, **({} if c is None else {"c": c * k}))
        last, p = body, p + np.array([0.1, 0.01 * (i % 2), 0])
    return m


def check(m, n=12, *, at=None, tol=1e-8, without=(), energies=True):
    dense = mb.modes(m, at=at, without=without)
    found = sparse(m, n, at, without)
    s, t = found.eigenvalue, dense.eigenvalue[:n]
    scale = np.maximum(np.abs(t), 1e-6 * np.abs(t[-1]))
    error = np.max(np.abs(s - t) / scale)
    print(f"{m.name}: {error:.1e}, estimate {found.error.max():.1e}, {found.stats.route}, {found.stats.counts}")
    assert error < tol
    assert list(found.kind) == list(dense.kind[:n])
    assert found.coordinates == dense.coordinates
    assert found.status == "converged"
    kept = [i for i in range(n) if found.kind[i] != "rigid" and len(dense.group_of(i)) == 1]
    for i in kept:
        assert abs(np.vdot(dense.shape[:, i], found.shape[:, i])) > (1 - 1e-8) * np.linalg.norm(
            dense.shape[:, i]
        ) * np.linalg.norm(found.shape[:, i])
        assert np.linalg.norm(found.shape[:, i]) == pytest.approx(np.linalg.norm(dense.shape[:, i]), rel=1e-6)
    name = m.bodies[-1].name
    np.testing.assert_allclose(
        np.abs(found.body_shape(name)[:, kept]), np.abs(dense.body_shape(name)[:, kept]), rtol=1e-5, atol=1e-7
    )
    if energies:
        for part in ("kinetic_body", "strain_element"):
            a, b = getattr(found.energy(), part), getattr(dense.energy(), part)
            np.testing.assert_allclose(a[:, kept], b[:, kept], rtol=1e-5, atol=1e-7)
    return found


@pytest.mark.parametrize(
    "kinds",
    [
        ("revolute",),
        ("prismatic", "revolute"),
        ("cylindrical",),
        ("spherical",),
        ("spherical", "prismatic", "revolute"),
    ],
)
def test_joint_chains(kinds):
    check(joint_chain(kinds))


@pytest.mark.parametrize("full", [False, True])
def test_bushing_chains(full):
    check(bushing_chain(full=full))


def test_universal_planar_and_fixed_joints_in_a_tree():
    m = mb.Model("tree")
    base = m.body("base", mass=5.0, inertia=(0.2, 0.2, 0.2), at=(0, 0, 0))
    m.planar("slab", m.ground, base, at=(0, 0, 0), axis="z", k=[1e3, 2e3, 50.0])
    for i in range(6):
        at = np.array([0.3 * np.cos(i), 0.3 * np.sin(i), 0.0])
        arm = m.body(f"arm{i}", mass=1.0, inertia=(0.02, 0.02, 0.01), at=at + np.array([0, 0, 0.2]))
        m.universal(f"u{i}", base, arm, at=at, axis=(1, 0.2 * i, 0), axis2=(0, 0, 1.0), k=[20.0 + i, 30.0])
        tip = m.body(
            f"tip{i}", mass=0.3, inertia=(0.01, 0.01, 0.01), at=at + np.array([0, 0, 0.4]), com=(0.01, 0.02, 0)
        )
        m.fixed(f"w{i}", tip, arm, at=at + np.array([0, 0, 0.4]))
        m.spring_damper(
            f"s{i}", tip, m.ground, at=(at + np.array([0, 0, 0.4]), 2 * at + np.array([0, 0, 0.6])), k=30.0 + i
        )
    check(m, 8)


def test_free_chains_have_six_rigid_modes():
    for m in (bushing_chain(grounded=False), joint_chain(("spherical",), grounded=False)):
        found = check(m, 14)
        assert np.sum(found.kind == "rigid") == 6


def test_hanging_chain_is_stiffened_by_its_weight():
    m = joint_chain(("spherical",), gravity=(0, 0, -9.81), k=0.3, step=(0, 0, -0.2))
    found = check(m)
    light = sparse(joint_chain(("spherical",), k=0.3, step=(0, 0, -0.2)), 12)
    assert found.frequency[0] > 2 * light.frequency[0]
    assert found.stats.counts["constraint-force stiffness"] > 0
    assert "constraint-force stiffness" not in light.stats.counts
    check(m, without=("constraint-force-stiffness",))
    check(m, without=("preload-stiffness",))


@pytest.mark.parametrize("kinds", [("revolute",), ("spherical", "prismatic", "revolute"), ("cylindrical", "revolute")])
def test_sagging_chain_at_its_equilibrium(kinds):
    m = joint_chain(kinds, gravity=(0, 1.0, -9.81), k=400.0)
    check(m, at=mb.equilibrium(m))


@pytest.mark.some(2)
@pytest.mark.parametrize("seed", range(4))
def test_loaded_bushings_at_equilibrium(seed):
    m = bushing_chain(full=True, seed=seed)
    m.force("tip", "b23", at=(2.4, 0, 0), value=(20.0, -30.0, 5.0))
    check(m, at=mb.equilibrium(m))


def ladder(n=10, gravity=None, axis="y"):
    """Two rails of hinged links and rungs that close loops."""
    m = mb.Model("ladder", gravity=gravity)
    rails = []
    for side in (0, 1):
        last, links = m.ground, []
        for i in range(n):
            body = m.body(f"l{side}_{i}", mass=1.0, inertia=(0.02, 0.02, 0.01), at=(side, 0, -0.4 * i - 0.2))
            m.revolute(f"j{side}_{i}", last, body, at=(side, 0, -0.4 * i), axis=axis, k=5.0 + side)
            last = body
            links.append(body)
        rails.append(links)
    for i in range(n):
        rung = m.body(f"r{i}", mass=0.5, inertia=(0.01, 0.05, 0.05), at=(0.5, 0, -0.4 * i - 0.3))
        m.revolute(f"p{i}", rails[0][i], rung, at=(0, 0, -0.4 * i - 0.3), axis=axis, k=2.0)
        m.revolute(f"q{i}", rung, rails[1][i], at=(1, 0, -0.4 * i - 0.3), axis=axis, k=2.0)
    return m


@pytest.mark.parametrize("gravity", [None, (0, 0, -9.81)])
def test_ladder_with_redundant_loops(gravity):
    check(ladder(gravity=gravity), 6)


def test_proportional_and_general_damping():
    check(bushing_chain(c=1e-4))
    m = joint_chain(("revolute",), c=0.02)
    m.spring_damper("d", "b20", m.ground, at=((2, 1, 1), (3, 1, 1)), k=1.0, c=3.0)
    check(m, 10)


def test_law_slopes_and_negative_stiffness():
    m = joint_chain(("revolute",))
    m.spring_damper("soft", "b8", "b12", at=((1, 0, 0), (1.5, 0.2, 0)), k=-2.0)
    m.torsion("t", "b3", "b5", at=(0.5, 0, 0), axis=(1, 2, 0), k=3.0)
    check(m, energies=False)


def scalar_chain(n, k=1e4, mass=2.0):
    m = mb.Model("row")
    last = m.ground
    for i in range(n):
        body = m.body(f"b{i}", mass=mass, inertia=(1, 1, 1), at=(i + 1.0, 0, 0))
        m.prismatic(f"j{i}", last, body, at=(i + 1.0, 0, 0), axis="x", k=k)
        last = body
    return m


def test_long_row_of_masses_against_its_closed_form():
    """Fixed-free chain: omega_j = 2 sqrt(k/m) sin((2j - 1) pi / (2 (2n + 1)))."""
    n, count = 2000, 20
    found = mb.modes(scalar_chain(n), n=count)
    expected = 2 * np.sqrt(1e4 / 2.0) * np.sin((2 * np.arange(1, count + 1) - 1) * np.pi / (2 * (2 * n + 1)))
    error = np.abs(found.omega / expected - 1)
    print(f"row of {n}: {error.max():.1e}, estimate {found.error.max():.1e}, {found.stats.wall_time:.2f} s")
    assert found.stats.route.startswith("sparse")
    assert error.max() < 1e-9
    assert np.all(error <= found.error + 1e-13)
    # shape of the first mode: sin of the position, mass-normalised, as absolute motion
    phi = np.array([found.system.body_motion(i)[0, 0].real for i in range(0, n, 400)])
    exact = np.sin(np.pi / (2 * n + 1) * (np.arange(0, n, 400) + 1))
    np.testing.assert_allclose(phi / phi[-1], exact / exact[-1], rtol=1e-8)


def long_bushings(n, ks=1e6, kr=1e2, h=0.2, mass=1.0, inertia=1e-2):
    """Bodies in a row on bushings halfway, both ends pinned by half cells."""
    m = mb.Model("beam")
    bodies = [m.body(f"b{i}", mass=mass, inertia=(inertia,) * 3, at=(i * h, 0, 0)) for i in range(n)]
    stiff = (1e6, ks, ks, 1e2, kr, kr)
    for i in range(n - 1):
        m.bushing(f"e{i}", bodies[i], bodies[i + 1], at=((i + 0.5) * h, 0, 0), k=stiff)
    half = tuple(2 * k for k in stiff)
    m.bushing("left", m.ground, bodies[0], at=(-h / 2, 0, 0), k=(*half[:3], 0, 0, 0))
    m.bushing("right", bodies[-1], m.ground, at=((n - 0.5) * h, 0, 0), k=(*half[:3], 0, 0, 0))
    return m


def test_long_beam_of_bushings_against_its_closed_form():
    """Pinned by half cells, standing waves of kappa = j pi/n solve the bending (y, theta) of every cell exactly.

    The two by two problem has the determinant 16 ks kr sin^4(kappa/2)/(m I); both planes bend alike.
    """
    n, pairs = 2000, 5
    ks, kr, h, mass, inertia = 1e6, 1e2, 0.2, 1.0, 1e-2
    s, c = (f(np.arange(1, 2 * pairs) * np.pi / n / 2) for f in (np.sin, np.cos))
    a, d = 4 * ks * s**2 / mass, (ks * h**2 * c**2 + 4 * kr * s**2) / inertia
    high = (a + d) / 2 + np.sqrt(((a - d) / 2) ** 2 + (2 * ks * s * h * c) ** 2 / (mass * inertia))
    expected = np.repeat(np.sqrt(16 * ks * kr * s**4 / (mass * inertia) / high), 2)[: 2 * pairs]
    m = long_bushings(n)
    # turning about its own axis is free but for the first rotation: one rigid mode
    found = mb.modes(m, n=2 * pairs + 1)
    assert list(found.kind[:1]) == ["rigid"]
    error = np.abs(found.omega[1:] / expected - 1)
    print(f"beam of {n}: {error.max():.1e}, estimate {found.error.max():.1e}, {found.stats.wall_time:.2f} s")
    assert error.max() < 1e-8


def test_dense_route_stays_for_small_models_and_for_all_modes():
    m = joint_chain(("revolute",))
    assert not mb.modes(m, n=3).stats.route.startswith("sparse")


def with_a_follower():
    m = joint_chain(("revolute",))
    m.force("follower", "b23", at=(1, 0, 0), value=(1, 0, 0), frame="body")
    return m


def with_a_skew_bushing():
    m = bushing_chain()
    k = np.diag([1e5] * 3 + [1e2] * 3)
    k[0, 1] = 5e4
    m.bushing("bearing", m.ground, "b3", at=(0.3, 0, 0), k=k)
    return m


def turning():
    m = joint_chain(("revolute",))
    m.set({"b0.angular_velocity": tuple(m.value("j0.axis"))})
    return m


def with_a_blade():
    m = joint_chain(("revolute",))
    shape = mb.flexible.beam(2.0, mass=0.75, EI_flap=1e3, EI_edge=2e3, modes=2)
    blade = m.flexible_body("blade", shape, at=(0, 0, -5))
    m.fixed("root", "b23", blade.node("root"))
    return m


@pytest.mark.some(2)
@pytest.mark.parametrize("seed", range(8))
def test_a_thin_beam_has_no_inertia_about_itself(monkeypatch, seed):
    """That of rounding may be negative."""
    rng = np.random.default_rng(seed)
    m = joint_chain(("revolute",))
    shape = mb.flexible.beam(rng.uniform(1, 3), mass=rng.uniform(0.3, 1), EI_flap=1.1e3, EI_edge=2.3e3, modes=2)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    m.fixed("root", "b23", m.flexible_body("blade", shape, at=(0, 0, -5), orientation=turn).node("root"))
    at = mb.equilibrium(m)
    known = mb.modes(m, at=at, n=2)
    monkeypatch.setattr(sparse_modes, "_LARGE", 4)
    found = mb.modes(m, at=at, n=2)
    assert found.stats.route.startswith("sparse")
    assert found.eigenvalue == pytest.approx(known.eigenvalue, rel=1e-9)
    # the first shift is sharp enough
    assert found.stats.counts["dense eigensolutions"] == known.stats.counts.get("dense eigensolutions", 1) == 1


def turning_with_a_drive():
    m = turning()
    m.drive("held", "j20", 0.0)
    return m


@pytest.mark.parametrize("scene", [with_a_follower, with_a_skew_bushing, turning, with_a_blade])
def test_what_is_not_symmetric_or_elastic_takes_the_sparse_route_too(monkeypatch, scene):
    m = scene()
    at = None if scene is turning else mb.equilibrium(m)
    dense = mb.modes(m, at=at, n=2)
    assert not dense.stats.route.startswith("sparse")
    monkeypatch.setattr(sparse_modes, "_LARGE", 4)
    found = mb.modes(m, at=at, n=2)
    assert found.stats.route.startswith("sparse")
    assert found.eigenvalue == pytest.approx(dense.eigenvalue, rel=1e-9)


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
def test_what_the_sparse_route_does_not_know_goes_to_the_dense_one(monkeypatch):
    m = turning_with_a_drive()
    known = mb.modes(m, n=2)
    assert not known.stats.route.startswith("sparse")
    monkeypatch.setattr(sparse_modes, "_LARGE", 4)
    assert sparse_modes.is_large(m, 2)
    assert mb.modes(m, n=2).eigenvalue == pytest.approx(known.eigenvalue, rel=1e-12)
    monkeypatch.setattr(sparse_modes, "_DENSE_AT_MOST", 10)
    with pytest.raises(mb.RouteError, match="open trees of rigid bodies"):
        mb.modes(m, n=2)


def test_off_balance_is_said():
    with pytest.warns(MbrsWarning, match="not in balance"):
        sparse(joint_chain(("revolute",), gravity=(0, 0, -9.81)), 3)


def test_results_of_large_models_print_and_save(tmp_path):
    found = sparse(joint_chain(("revolute",)), 4)
    assert "sparse" in str(found) and "b2" in str(found.energy())
    assert found.to_xarray().sizes["mode"] == 4
    found.save(tmp_path / "modes.pkl")


def test_sensitivities_of_sparse_modes_name_the_route_and_the_remedy():
    """The message spoke of matrices of a user, although the modes came from a model."""
    m = mb.Model("rail")
    last = m.ground
    for i in range(500):
        b = m.body(f"b{i}", mass=1.0 + 0.001 * i, inertia=(0.1, 0.1, 0.1), at=(i + 1.0, 0, 0))
        m.prismatic(f"j{i}", m.ground, b, at=(i + 1.0, 0, 0), axis=(1.0, 0.3, 0.2))
        m.bushing(f"k{i}", last, b, at=(i + 0.5, 0, 0), k=(1e4,) * 6)
        last = b
    with pytest.raises(mb.errors.RouteError, match=r"sparse matrices.*leave n= out"):
        mb.sensitivity(mb.modes(m, n=3), ["b7.mass"])
    assert np.isfinite(mb.sensitivity(mb.modes(m), ["b7.mass"]).eigenvalue).all()
