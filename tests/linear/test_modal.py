"""Modes: closed forms, hard cases, conventions, bad input. Reference values are derived or carry their source."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from matrix_systems import EPS, lapack_ratio, parts, skew, spd, state_matrix, system
from mbrs.errors import ModelError, NameNotFoundError, SingularError
from mbrs.linear.mac import mac
from mbrs.linear.matrices import MechanicalSystem
from mbrs.linear.modes import modes
from oracles.precise import exact_roots, relative_errors
from problems import hexapod_matrices

# --- closed forms


def test_cubic_hexapod_closed_form():
    isolator, mass = hexapod_matrices(), 20.0
    r = modes(isolator.model)
    assert np.allclose(r.omega, isolator.answer["omega"], rtol=1e-13)
    assert np.allclose(r.damping, isolator.answer["damping"], rtol=1e-12)
    assert r.groups == ((0, 1, 2), (3, 4))
    assert np.allclose(r.frequency, [15.9155] * 3 + [18.3776] * 2 + [36.7553], atol=5e-5)
    assert r.stats.route == "proportional" and not np.iscomplexobj(r.shape)
    assert np.allclose(r.shape[:3, :3], np.eye(3) / np.sqrt(mass), atol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3, 30])
def test_chain_of_equal_masses(n):
    k, m = 7.0, 0.3
    K = k * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    r = modes(system(m * np.eye(n), None, K))
    j = np.arange(1, n + 1)
    assert np.allclose(r.omega, 2 * np.sqrt(k / m) * np.sin(j * np.pi / 2 / (n + 1)), rtol=1e-13)
    assert np.allclose(r.shape.T @ r.shape * m, np.eye(n), atol=1e-13)
    assert r.stats.counts == {"cholesky factorisations": 1, "symmetric eigensolutions": 1}


def test_one_degree_of_freedom_of_each_kind():
    def kind(c, k):
        return modes(system([[1.0]], [[c]], [[k]])).kind[0]

    assert [kind(0.1, 1), kind(0, 0), kind(3, 1), kind(-0.1, 1), kind(0, -1), kind(1, 0)] == [
        "vibration", "rigid", "overdamped", "flutter", "divergence", "rigid",
    ]  # fmt: skip
    r = modes(system([[1.0]], [[3.0]], [[1.0]]))
    assert np.allclose(r.roots, [(-3 + 5**0.5) / 2, (-3 - 5**0.5) / 2], rtol=1e-15)
    assert r.damping[0] == 1.0 and r.frequency_damped[0] == 0.0


@pytest.mark.parametrize("g", [0.3, 30.0, 1e6])
def test_gyroscopic_rotor_splits_into_forward_and_backward_whirl(g):
    k = 4.0
    r = modes(system(np.eye(2), None, k * np.eye(2), G=[[0, g], [-g, 0]]))
    forward = g / 2 + np.sqrt(g * g / 4 + k)
    assert r.stats.route == "gyroscopic conservative"
    assert np.all(r.eigenvalue.real == 0.0)
    error = np.abs(r.omega / [k / forward, forward] - 1)
    print(f"g = {g}: relative errors {error}")
    assert error.max() < 1e-14
    assert np.allclose(np.abs(r.shape), np.sqrt(0.5), rtol=1e-12)  # circular orbits


def test_gyroscopically_stabilised_top():
    # K < 0: s^4 + (g^2 - 2) s^2 + 1 = 0 for M = 1, K = -1
    r = modes(system(np.eye(2), None, -np.eye(2), G=[[0, 3.0], [-3.0, 0]]))
    assert np.allclose(r.omega, [(3 - 5**0.5) / 2, (3 + 5**0.5) / 2], rtol=1e-14)
    assert np.all(r.eigenvalue.real == 0.0) and not r.unstable.any()


@pytest.mark.parametrize("load", [1.0, 2.08, 2.09, 4.0, 4.92])
def test_flutter_of_zieglers_column(load):
    # masses 2 and 1, unit links and springs, follower force P: the determinant is 2 w^2 + (2 P - 7) w + 1, w = -s^2,
    # hence flutter between P = 7/2 - sqrt 2 and 7/2 + sqrt 2
    S = np.array([[2 - load, load - 1], [-1, 1]])
    r = modes(system([[3.0, 1.0], [1.0, 1.0]], None, (S + S.T) / 2, N=(S - S.T) / 2))
    w = np.roots([2, 2 * load - 7, 1]).astype(complex)
    expected = np.sqrt(-w)
    got = np.concatenate([r.roots, -r.roots])
    assert all(np.abs(got - e).min() < 1e-12 for e in expected)
    inside = abs(load - 3.5) < np.sqrt(2)
    assert (("flutter" in r.kind) == inside) and (("divergence" in r.kind) == (load > 4.9))
    assert r.left is not None


# --- real roots, rigid modes, near-defective roots


def test_overdamped_modes_keep_one_pair_for_each_degree_of_freedom():
    C, K = np.diag([5.0, 5.0, 6.0, 0.1]), np.diag([1.0, 1.0, 2.0, 4.0])
    q = np.linalg.qr(np.random.default_rng(0).standard_normal((4, 4)))[0]
    r = modes(system(np.eye(4), q @ C @ q.T, q @ K @ q.T))
    assert list(r.kind) == ["overdamped"] * 3 + ["vibration"]
    pairs = r.roots.reshape(-1, 2)
    assert np.allclose(pairs[:2].sum(axis=1), -5) and np.allclose(pairs[2].sum(), -6)
    assert r.groups == ((0, 1),)


def test_overdamped_roots_of_coupled_damping_pair_by_shape():
    C, K = np.array([[5.0, 0.1, 0], [0.1, 6, 0.3], [0, 0.3, 4]]), np.diag([1.0, 2.0, 1.0])
    r = modes(system(np.eye(3), C, K))
    pairs = r.roots.reshape(-1, 2).real
    # each pair stays near the root pair of its own diagonal entry
    for c, k in zip(np.diag(C), np.diag(K), strict=True):
        own = np.roots([1, c, k])
        assert np.abs(pairs - np.sort(own)[::-1]).sum(axis=1).min() < 0.3
    assert np.allclose(np.sort(r.roots.real), np.sort(np.linalg.eigvals(state_matrix(r.system)).real), rtol=1e-12)
    # roots of positive sign come first in each pair
    for i, x in enumerate(r.shape.real.T):
        assert x @ (2 * pairs[i, 0] * np.eye(3) + C) @ x > 0


def free_beam(damped: bool) -> MechanicalSystem:
    """Three bodies in space in a row, joined by two bushings: six rigid modes."""

    def cross(v):
        return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0.0]])

    def at(r):
        return np.block([[np.eye(3), -cross(r)], [np.zeros((3, 3)), np.eye(3)]])

    M = np.kron(np.eye(3), np.diag([2.0, 2.0, 2.0, 0.01, 0.02, 0.025]))
    rows = np.zeros((12, 18))
    for i in range(2):
        rows[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = -at(np.array([0.1, 0.02, 0.0]))
        rows[6 * i : 6 * i + 6, 6 * i + 6 : 6 * i + 12] = at(np.array([-0.1, 0.02, 0.0]))
    k = np.array([1e5, 1e5, 2e5, 30.0, 40.0, 50.0] * 2)
    c = np.array([10.0, 0, 0, 0, 0.1, 0] * 2)
    return system(M, rows.T @ np.diag(c) @ rows if damped else None, rows.T @ np.diag(k) @ rows)


@pytest.mark.parametrize("damped", [False, True])
def test_free_free_system_has_exactly_six_rigid_modes(damped):
    s = free_beam(damped)
    r = modes(s)
    assert list(r.kind[:6]) == ["rigid"] * 6 and "rigid" not in r.kind[6:]
    assert np.all(r.eigenvalue[:6] == 0) and np.all(r.roots[:12] == 0) and np.all(np.isnan(r.damping[:6]))
    assert r.groups[0] == (0, 1, 2, 3, 4, 5)
    x = r.shape[:, :6]
    assert np.allclose(x.conj().T @ s.M @ x, np.eye(6), atol=1e-12)
    assert np.abs(s.K @ x).max() < 1e-9 * np.abs(s.K).max()
    assert np.all(r.error[6:] < 1e-10)


def test_free_body_on_a_damper_has_one_zero_root():
    s = system(np.eye(2), np.diag([0.5, 0.0]), [[1.0, -1.0], [-1.0, 1.0]])
    r = modes(s)
    assert list(r.kind) == ["rigid", "vibration"]
    assert r.roots[0] == 0 and r.roots[1].imag == 0 and r.roots[1].real < 0
    assert np.isclose(r.roots.sum().real, -0.5, rtol=1e-14)


def test_particle_in_a_magnetic_field():
    r = modes(system(np.eye(2), None, np.zeros((2, 2)), G=[[0, 3.0], [-3.0, 0]]))
    assert list(r.kind) == ["rigid", "vibration"] and np.allclose(r.roots, [0, 0, 3j, -3j])
    r = modes(system(np.eye(2), None, np.diag([0.0, 1.0]), G=[[0, 3.0], [-3.0, 0]]))
    assert list(r.kind) == ["rigid", "vibration"] and np.allclose(r.roots, [0, 0, 10**0.5 * 1j, -(10**0.5) * 1j])


def test_rigid_direction_under_a_follower_force():
    S = np.array([[0, 1.0, 0], [0, 2, -1], [0, -1, 2]])
    for C in (None, np.diag([0.1, 0, 0.2])):
        s = system(np.eye(3), C, (S + S.T) / 2, N=(S - S.T) / 2)
        r = modes(s)
        assert list(r.kind) == ["rigid", "vibration", "vibration"]
        expected = np.linalg.eigvals(state_matrix(s))
        assert all(np.abs(expected - root).min() < 1e-7 for root in r.roots)


@pytest.mark.parametrize("excess", [0.0, 1e-15, -1e-15, 1e-13])
def test_critical_damping_is_flagged(excess):
    for s in (
        system([[1.0]], [[2.0 * (1 + excess)]], [[1.0]]),
        system(np.eye(2), [[2.0 * (1 + excess), 0.0], [0.0, 0.1]], [[1.0, 1e-9], [1e-9, 3.0]]),
    ):
        r = modes(s)
        assert r.near_defective[0] and not r.near_defective[1:].any()
        print(f"critical damping {excess:+.0e}: |s + 1| = {abs(r.eigenvalue[0] + 1):.1e}")
        assert abs(r.eigenvalue[0] + 1) < 1e-6
        for a in (r.eigenvalue, r.roots, r.shape, r.frequency, r.damping, r.error, r.condition):
            assert not np.any(np.isnan(a))
    assert not modes(system([[1.0]], [[2.0 * (1 - 1e-6)]], [[1.0]])).near_defective[0]


# --- hard cases


def test_stiffness_ratio_of_1e12():
    springs = np.array([1.0, 1e12, 1.0, 1e6, 2.0])
    rows = np.array([[1.0, 0, 0, 0], [-1, 1, 0, 0], [0, -1, 1, 0], [0, 0, -1, 1], [0, 0, 0, 1]])
    factor = np.sqrt(springs)[:, None] * rows
    exact = system(np.eye(4), None, rows.T @ np.diag(springs) @ rows)
    r = modes(exact, stiffness_factor=factor)
    errors = relative_errors(r.roots[::2], exact_roots(*parts(exact)))
    print(f"stiffness ratio 1e12: with factor {errors}, estimated {r.error}")
    assert errors.max() < 1e-9
    assembled = modes(exact)
    plain = relative_errors(assembled.roots[::2], exact_roots(*parts(exact)))
    print(f"   assembled {plain}, estimated {assembled.error}")
    assert np.all(plain <= 10 * assembled.error + 10 * EPS)
    assert assembled.condition[0] > 1e11  # the result says what the assembled matrix has lost


def test_damped_system_with_stiffness_ratio_of_1e12():
    K = np.diag([1.0, 1e12, 1e6]) + 0.1
    s = system(np.eye(3), np.diag([0.1, 0, 0]), K)
    r = modes(s)
    errors = relative_errors(r.roots, exact_roots(*parts(s)))
    print(f"graded stiffness 1e12, damped: {errors}")
    assert errors.max() < 1e-13


@pytest.mark.parametrize("damping", [None, np.diag([1e-3, 0.1, 0.0])])
@pytest.mark.parametrize("light", [True, False])
def test_mass_ratio_of_1e9(light, damping):
    M = np.diag([1e-9, 1.0, 1.0]) if light else np.diag([1e9, 1.0, 1.0])
    s = system(M, damping, [[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])
    r = modes(s)
    errors = relative_errors(r.roots, exact_roots(*parts(s)))
    print(f"mass ratio 1e9, light {light}: {errors}")
    assert errors.max() < 1e-12


@pytest.mark.parametrize("c", [1e2, 1e5, 1e8])
def test_heavy_damping_keeps_small_roots(c):
    for s in (
        system(np.eye(2), c * np.array([[1, -0.5], [-0.5, 2]]), [[3.0, -1], [-1, 2]]),
        system(np.eye(3), np.diag([c, 0.1, 0]), [[3.0, -1, 0], [-1, 2, -1], [0, -1, 3]]),
    ):
        r = modes(s)
        errors = relative_errors(r.roots, exact_roots(*parts(s)))
        print(f"damping {c:.0e}: {errors.max():.1e}")
        assert errors.max() < 1e-12


def test_units_do_not_matter():
    """The same system in metres, in millimetres and in mixed units has the same roots and groups."""
    rng = np.random.default_rng(5)
    s = free_beam(True)
    base = modes(s)
    for unit in (np.full(18, 1e-3), 10.0 ** rng.uniform(-4, 4, 18)):
        scale = np.outer(unit, unit)
        r = modes(system(s.M * scale, s.C * scale, s.K * scale))
        assert np.allclose(r.eigenvalue, base.eigenvalue, rtol=1e-11, atol=0)
        assert list(r.kind) == list(base.kind) and [len(g) for g in r.groups] == [len(g) for g in base.groups]


# --- conventions


def test_signs_and_bases_do_not_depend_on_rounding():
    s = hexapod_matrices().model
    base = modes(s)
    rng = np.random.default_rng(2)
    for _ in range(5):
        noise = 1 + 1e-15 * rng.standard_normal((6, 6))
        r = modes(system(s.M, s.C, s.K * (noise + noise.T) / 2))
        assert np.allclose(r.shape, base.shape, atol=1e-8)
    for x in base.shape.T:
        size = np.abs(x)
        assert x[np.argmax(size >= (1 - 1e-6) * size.max())] > 0


def test_repeated_complex_roots_have_orthogonal_shapes():
    """Two equal copies of a non-proportionally damped pair of masses, mixed by a rotation that no solver expects."""
    c, k = np.array([[0.3, 0], [0, 0]]), np.array([[3.0, -1], [-1, 2]])
    q = np.linalg.qr(np.random.default_rng(3).standard_normal((4, 4)))[0]
    s = system(np.eye(4), q @ np.kron(np.eye(2), c) @ q.T, q @ np.kron(np.eye(2), k) @ q.T)
    r = modes(s)
    assert r.groups == ((0, 1), (2, 3)) and r.stats.route == "general damping"
    for group in r.groups:
        x, e = r.shape[:, list(group)], r.eigenvalue[group[0]]
        assert np.allclose(x.T @ (2 * e * s.M + s.C) @ x, 2j * e.imag * np.eye(2), atol=1e-10)
    assert lapack_ratio(r, s) < 30


def test_number_of_modes():
    s = hexapod_matrices().model
    r = modes(s, n=2)
    assert r.n == 2 and r.shape.shape == (6, 2) and r.roots.shape == (12,)
    assert r.groups == ((0, 1),) and r.cut_group == (0, 1)
    assert modes(s, n=3).cut_group == () and modes(s, n=99).n == 6


def test_effects_are_left_out():
    rng = np.random.default_rng(1)
    s = system(spd(rng, 3), spd(rng, 3), spd(rng, 3), G=skew(rng, 3), N=skew(rng, 3))
    full = modes(s)
    assert full.stats.effects == ("damping", "gyroscopic", "circulatory")
    r = modes(s, without=("damping", "gyroscopic", "circulatory"))
    assert r.stats.route == "undamped" and "general eigensolutions" not in r.stats.counts
    assert not np.allclose(r.frequency, full.frequency)
    assert modes(s, without=("damping", "circulatory")).stats.route == "gyroscopic conservative"
    zero = np.zeros((3, 3))
    assert modes(system(s.M, zero, s.K, G=zero, N=zero)).stats.route == "undamped"


def test_result_prints_saves_and_labels(tmp_path):
    import pickle

    r = modes(hexapod_matrices().model)
    text = str(r)
    assert "15.9155" in text and "zeta" in text and "residual" in text and "proportional" in text
    assert "<table" in r._repr_html_()
    general = modes(system(np.eye(2), np.diag([0.3, 0]), [[2.0, -1], [-1, 2]]))
    assert "only for underdamped proportional damping" in str(general)
    back = pickle.loads(r.save(tmp_path / "r.pkl").read_bytes())
    assert np.array_equal(back.shape, r.shape) and back.stats.route == r.stats.route
    data = r.to_xarray()
    assert dict(data.sizes) == {"mode": 6, "coordinate": 6, "root": 12}
    assert np.allclose(data["frequency"], r.frequency) and data["group"].values.tolist() == [1, 1, 1, 2, 2, 0]
    energy = r.energy()
    assert np.allclose(energy.kinetic.sum(axis=0), 1) and np.allclose(energy.strain.sum(axis=0), 1)
    assert "kinetic" in str(energy)


def test_body_shapes_and_energy_through_the_maps_of_a_linearisation():
    s = hexapod_matrices().model
    s.bodies, s.T = ("payload",), np.eye(6)
    s.body_mass_matrices = s.M[None]
    r = modes(s)
    assert np.array_equal(r.body_shape("payload"), r.shape.astype(complex))
    assert np.allclose(r.energy().kinetic_body, 1) and "payload" in str(r)
    with pytest.raises(NameNotFoundError, match="payload"):
        r.body_shape("load")


def test_mac():
    r = modes(hexapod_matrices().model)
    assert np.allclose(r.mac(r, weight=r.system.M), np.eye(6), atol=1e-12)
    assert np.allclose(np.diag(mac(r.shape * 2j, r)), 1)
    with pytest.raises(ModelError, match="coordinates"):
        mac(r, np.eye(3))
    with pytest.raises(ModelError, match="finite"):
        mac(np.full((2, 2), np.nan), np.eye(2))


# --- bad input


def test_massless_coordinates_are_named():
    names = ["a", "b", "c"]
    with pytest.raises(SingularError, match="coordinate 'b'"):
        modes(MechanicalSystem(np.diag([1.0, 0, 1]), None, np.eye(3), coordinates=names))
    with pytest.raises(SingularError, match="coordinate 'c'"):
        modes(MechanicalSystem([[1.0, 0, 1], [0, 1, 0], [1, 0, 1]], None, np.eye(3), coordinates=names))
    with pytest.raises(SingularError, match="not positive definite"):
        modes(MechanicalSystem([[1.0, 2], [2, 1.0]], None, np.eye(2)))


def test_wrong_input_is_refused():
    eye = np.eye(2)
    unsymmetric = [[1.0, 2.0], [0.0, 1.0]]
    with pytest.raises(ModelError, match="NaN"):
        modes(system(eye, None, [[np.nan, 0], [0, 1]]))
    with pytest.raises(ModelError, match=r"K is not symmetric.*skew part as N"):
        modes(system(eye, None, unsymmetric))
    with pytest.raises(ModelError, match=r"C is not symmetric.*skew part as G"):
        modes(system(eye, unsymmetric, eye))
    with pytest.raises(ModelError, match="G is not skew"):
        modes(system(eye, None, eye, G=eye))
    with pytest.raises(ModelError, match="mass matrix must be symmetric"):
        modes(system(unsymmetric, None, eye))
    for n in (0, -1, 1.5, True, "3"):
        with pytest.raises(ModelError, match="positive number of modes"):
            modes(system(eye, None, eye), n=n)
    with pytest.raises(ModelError, match="effects of a MechanicalSystem"):
        modes(system(eye, None, eye), without="gravity")
    with pytest.raises(ModelError, match="at="):
        modes(system(eye, None, eye), at=object())
    for factor in (np.ones((2, 3)), np.array([[np.nan, 1.0]]), "x", []):
        with pytest.raises(ModelError, match="factor"):
            modes(system(eye, None, eye), stiffness_factor=factor)


@pytest.mark.parametrize("rod_first", [True, False])
def test_the_coordinate_without_inertia_is_named(rod_first):
    """A rod without axial inertia behind a hub that has some: the rod is to blame, in any order of definition."""
    m = mb.Model("rod")

    def add(what):
        if what == "rod":
            return m.body("rod", mass=0.7, inertia=(0, 0.05, 0.05), at=(0.3, 0, 0), com=(0.3, 0, 0))
        hub = m.body("hub", mass=1.3, inertia=(0.013, 0.011, 0.012))
        m.revolute("spin", m.ground, hub, at=(0, 0, 0), axis="x")
        return hub

    for what in ("rod", "hub") if rod_first else ("hub", "rod"):
        add(what)
    m.bushing("k", "hub", "rod", at=(0.3, 0, 0), k=(1e5, 1.1e5, 1.2e5, 1e3, 1.3e3, 1.4e3))
    with pytest.raises(mb.SingularError, match=r"'rod\.rx' carries no inertia"):
        mb.modes(m)


def test_the_dominant_body_comes_with_its_direction():
    modes = mb.modes(mb.examples.cubic_hexapod())
    columns, rows = modes.rows()
    named = [row[columns.index("dominant")] for row in rows]
    assert sorted(named[:3]) == ["payload x", "payload y", "payload z"] and named[5] == "payload rz"


def work(C, K):
    """What modes of unit masses count."""
    return modes(MechanicalSystem(np.eye(len(K)), C, K)).stats.counts


@pytest.mark.parametrize("coupling, tried", [(1e-9, True), (1e-7, False)])
def test_damping_that_does_not_commute_is_not_tried_as_proportional(coupling, tried):
    counts = work([[0.1, coupling], [coupling, 0.3]], np.diag([1.0, 2.0]))
    assert ("symmetric eigensolutions" in counts) == tried


@pytest.mark.parametrize("coupling, proportional", [(1e-9, True), (1e-8, False)])
def test_damping_between_modes_counts_by_its_square_over_their_distance(coupling, proportional):
    counts = work([[0.1, coupling], [coupling, 0.1]], np.diag([1.0, 1.0001]))
    assert counts["symmetric eigensolutions"] == 1 and ("general eigensolutions" not in counts) == proportional


@pytest.mark.parametrize("apart, asked", [(1e-9, True), (1e-7, False)])
def test_pivots_of_rounding_leave_the_rank_to_an_eigenproblem(apart, asked):
    counts = work([[0.1, 0.05], [0.05, 0.3]], [[1.0, 1.0 - apart], [1.0 - apart, 1.0]])
    assert ("rank tests" in counts) == asked


@pytest.mark.parametrize("apart, together", [(1e-7, True), (1e-5, False)])
def test_roots_that_nearly_meet_are_told(apart, together):
    """Damping that is critical but for half the square of the distance between the two roots from their mean."""
    for damping in (2.0 - apart**2, 2.0 + apart**2):
        assert modes(MechanicalSystem([[1.0]], [[damping]], [[1.0]])).near_defective.tolist() == [together]


@pytest.mark.parametrize("apart, groups", [(1e-9, ((0, 1),)), (1e-7, ())])
def test_roots_are_repeated_within_a_hundred_millionth_at_most(apart, groups):
    """Two oscillators beside two that are 1e9 times stiffer: as far as norms tell, rounding moves the slow roots by 1e-6."""
    C = np.zeros((4, 4))
    C[2:, 2:] = [[1e3, 4e2], [4e2, 7e3]]
    assert modes(MechanicalSystem(np.eye(4), C, np.diag([1.0, (1.0 + apart) ** 2, 1e9, 2e9]))).groups == groups


@pytest.mark.parametrize("slow, problems", [(1e-5, 1), (1e-7, 2)])
def test_roots_a_million_times_slower_than_others_come_from_the_reversed_problem(slow, problems):
    K = np.diag([slow**2, 1.0, 2.0])
    K[0, 1] = K[1, 0] = 0.1 * slow**2
    counts = work([[0.1 * slow, 0.0, 0.0], [0.0, 0.1, 0.05], [0.0, 0.05, 0.3]], K)
    assert counts["general eigensolutions"] == problems


@pytest.mark.parametrize(("coupling", "kind"), [(1e-14, "divergence"), (5e-16, "rigid")])
def test_a_weak_coupling_of_what_nothing_holds_lets_it_diverge(coupling, kind):
    """K = [[1, c], [c, 0]] is indefinite: s^2 = c^2, unless c is a last digit of the one."""
    found = modes(MechanicalSystem(np.eye(2), None, [[1.0, coupling], [coupling, 0.0]]))
    assert list(found.kind) == [kind, "vibration"]
    assert found.eigenvalue[0] == pytest.approx(coupling if kind == "divergence" else 0.0, rel=1e-3, abs=0.0)
