"""One system of the core behind a linearisation or a user's matrices: what is derived from it is computed once."""

from __future__ import annotations

import gc
import pickle
import resource
import sys
import warnings
import weakref

import mbrs as mb
import numpy as np
import pytest
import scipy.sparse

KINDS = ("undamped", "proportional", "general", "gyroscopic", "circulatory")


def _system(kind: str, n: int = 5, seed: int = 1) -> mb.MechanicalSystem:
    rng = np.random.default_rng(seed)
    X, Y, W, Q = rng.normal(size=(4, n, n))
    M, K = X @ X.T / n + np.eye(n), Y @ Y.T + np.eye(n)
    C = {"undamped": None, "proportional": 0.01 * K}.get(kind, 0.05 * W @ W.T / n)
    G = 0.3 * (Q - Q.T) if kind == "gyroscopic" else None
    N = 0.02 * (Q - Q.T) if kind == "circulatory" else None
    return mb.MechanicalSystem(M, C, K, G=G, N=N)


def _solutions(result) -> int:
    """Eigen-solutions that a result has cost."""
    return sum(n for name, n in result.stats.counts.items() if name.endswith("eigensolutions"))


def _direct(s: mb.MechanicalSystem, omega: np.ndarray) -> np.ndarray:
    D = sum((a for a in (s.C, s.G) if a is not None), np.zeros((s.n, s.n)))
    S = s.K if s.N is None else s.K + s.N
    return np.moveaxis(np.linalg.inv(S - omega[:, None, None] ** 2 * s.M + 1j * omega[:, None, None] * D), 0, 2)


@pytest.mark.parametrize("kind", KINDS)
def test_modes_are_computed_once(kind):
    s, omega, t = _system(kind), np.array([0.3, 1.1, 4.0]), np.linspace(0.0, 1.0, 5)
    first = mb.modes(s)
    after = [
        mb.frf(s, 0, 1, omega=omega),
        mb.response(s, t, {0: np.sin(t)}, 1),
        mb.modes(s),
        mb.frf(s, 2, 2, omega=omega),
    ]
    assert _solutions(first) >= 1 and [_solutions(r) for r in after] == [0, 0, 0, 0]
    other = _system(kind)  # the same numbers, another system: nothing is shared, whatever comes first
    begun = mb.frf(other, 0, 1, omega=omega)
    assert _solutions(begun) >= 1 and _solutions(mb.modes(other)) == 0
    assert np.array_equal(begun.value, after[0].value) and np.array_equal(mb.modes(other).eigenvalue, first.eigenvalue)


@pytest.mark.parametrize("kind", KINDS)
def test_transfer_functions_by_modes_are_those_of_direct_solves(kind):
    omega = np.linspace(0.1, 8.0, 40)
    for seed in range(5):
        s = _system(kind, n=8, seed=seed)
        whole = list(range(s.n))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mb.MbrsWarning)  # resonances between the points
            found = mb.frf(s, whole, whole, omega=omega)
        expected = _direct(s, omega)
        gap = np.abs(found.value - expected).max(axis=(0, 1)) / np.abs(expected).max(axis=(0, 1))
        assert found.stats.route == ("complex modes" if kind in KINDS[2:] else "real modes")
        assert gap.max() < 1e-10
        roots = np.sort_complex(mb.modes(s).roots)
        assert np.allclose(np.sort_complex(found.poles), roots, rtol=1e-12, atol=1e-12)


def test_a_damping_matrix_without_symmetry_has_transfer_functions():
    rng = np.random.default_rng(4)
    s = mb.MechanicalSystem(np.eye(4), 0.1 * rng.normal(size=(4, 4)), np.diag([1.0, 2.0, 3.0, 4.0]))
    omega = np.array([0.2, 0.9, 1.7])
    found = mb.frf(s, [0, 1, 2, 3], [0, 1, 2, 3], omega=omega)
    assert np.allclose(found.value, _direct(s, omega), rtol=1e-12)
    with pytest.raises(mb.ModelError, match="C is not symmetric"):
        mb.modes(s)


def test_a_linearisation_and_its_modes_serve_all_analyses():
    m = mb.examples.cubic_hexapod()
    lin = mb.linearize(m)
    body = lin.bodies[0]
    omega = np.array([10.0, 50.0])
    first = mb.modes(lin)
    after = mb.frf(lin, [f"{body}.force.z"], [f"{body}.motion.z"], omega=omega)
    assert _solutions(first) == _solutions(mb.modes(m)) >= 1 and _solutions(after) == 0
    # nothing that was derived from another linearisation is used
    assert _solutions(mb.frf(m, [f"{body}.force.z"], [f"{body}.motion.z"], omega=omega)) >= 1


def test_laws_that_relax_share_their_modes_too():
    m = mb.Model("slider")
    b = m.body("b", mass=2.0, inertia=(1, 1, 1))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=8.0, law=mb.Maxwell(3.0, 0.7))
    lin, t = mb.linearize(m), np.linspace(0.0, 2.0, 9)
    first = mb.modes(lin)
    after = mb.response(lin, t, {"b.force.x": np.sin(t)}, ["b.motion.x"])
    assert _solutions(first) >= 1 and _solutions(after) == 0


def test_leaving_out_is_a_system_of_its_own_made_once():
    s = _system("general")
    bare, omega = mb.modes(s, without="damping"), np.array([0.5, 2.0])
    assert bare.stats.route == "undamped" and mb.modes(s).stats.route == "general damping"
    after = mb.frf(s, 0, 0, omega=omega, without=("damping",))
    assert _solutions(after) == 0 and after.stats.effects == ()
    assert np.allclose(after.value[0, 0], _direct(mb.MechanicalSystem(s.M, K=s.K), omega)[0, 0], rtol=1e-12)


@pytest.mark.parametrize("made", [np.asarray, scipy.sparse.csr_matrix])
def test_matrices_stay_as_they_are(made):
    given = np.diag([1.0, 2.0])
    s = mb.MechanicalSystem(made(given), K=made(2.0 * given))
    given[0, 0] = 5.0  # what the caller does with the own array afterwards
    with pytest.raises(AttributeError, match="make another system"):
        s.K = made(given)
    values = s.M if made is np.asarray else s.M.data
    with pytest.raises(ValueError, match="read-only"):
        values[0] = 3.0
    assert np.allclose(mb.modes(s, n=2).omega, np.sqrt(2.0))


def test_a_linearisation_is_remade_from_its_matrices():
    lin = mb.linearize(mb.examples.cubic_hexapod())
    expected = mb.modes(lin).frequency
    again = pickle.loads(pickle.dumps(lin))
    assert all(np.array_equal(getattr(again, a), getattr(lin, a)) for a in "MK") and again.G is None
    assert np.array_equal(mb.modes(again).frequency, expected)
    core = pickle.loads(pickle.dumps(lin.core))
    assert np.array_equal(core.K, lin.K) and core.size == 6
    with pytest.raises(ValueError, match="read-only"):
        lin.M[0, 0] = 1.0


def test_what_is_derived_goes_with_its_system():
    s, omega, t = _system("general"), np.array([0.3, 1.1]), np.linspace(0.0, 1.0, 5)
    for without in ("damping", (), ("damping", "gyroscopic"), "damping"):
        made = (mb.frf(s, 0, 1, omega=omega, without=without), mb.response(s, t, {0: np.sin(t)}, 1), mb.modes(s))
    part, whole = weakref.ref(s.leaving_out(frozenset("C"))), weakref.ref(s)
    assert s.leaving_out(frozenset("CG")) is part()  # nothing acts in G: one system without damping
    del s, made
    gc.collect()
    assert whole() is None and part() is None


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_systems_that_are_gone_hold_no_memory():
    n, rng = 80, np.random.default_rng(3)
    X = rng.normal(size=(n, n))
    K, C, omega = X @ X.T + np.eye(n), 0.1 * np.diag(rng.random(n)), np.linspace(0.3, 9.0, 20)

    def resident():
        gc.collect()
        return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize()

    def one():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mb.MbrsWarning)  # resonances between the points
            mb.frf(mb.MechanicalSystem(np.eye(n), C, K), 0, 0, omega=omega)

    for _ in range(8):  # until the allocator has what it keeps
        one()
    before = resident()
    for _ in range(32):
        one()
    # a system with its modes holds some 35 square matrices: far less than those of 32 systems
    assert resident() - before < 10 * (35 * 8 * n * n)
