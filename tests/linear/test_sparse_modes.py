"""The sparse eigen-solver against closed forms and LAPACK; every hard case prints its measured error."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from mbrs import _core


def arrays(A):
    """The three arrays that the core takes."""
    A = sp.csc_matrix(A)
    A.sort_indices()
    return A.indptr.astype(np.int64), A.indices.astype(np.int64), A.data.astype(float)


def springs(n, fixed):
    """Stretches of unit springs between n masses in a row, the first tied to ground where fixed."""
    G = sp.diags([np.ones(n), -np.ones(n - 1)], [0, -1], format="csc")
    return G if fixed else G[1:]


def chain_eigenvalues(n, count, fixed):
    """lambda = 4 sin^2: fixed-free (2j - 1) pi / (2 (2n + 1)); free-free j pi / (2n)."""
    if fixed:
        return (2 * np.sin((2 * np.arange(1, count + 1) - 1) * np.pi / (2 * (2 * n + 1)))) ** 2
    return (2 * np.sin(np.arange(count) * np.pi / (2 * n))) ** 2


def augmented(G, compliance, geometric=None):
    n = G.shape[1]
    top = sp.csc_matrix((n, n)) if geometric is None else geometric
    return sp.bmat([[top, G.T], [G, -sp.diags(compliance)]])


def bushing_chain(n, free=False):
    """Bodies (y, theta) in a row joined halfway by bushings (shear ks, bending kr), pinned at both ends by half cells,
    or guided there and so free. Standing waves sin, cos of kappa = j pi / n solve it: the determinant of the two by two
    problem is 16 ks kr sin^4(kappa/2) / (m I). Invented data. The lowest eigenvalue falls like n^-4."""
    ks, kr, h, m, inertia = 1e6, 1e2, 0.2, 1.0, 1e-2
    entries, stiffness = [], []

    def row(*terms, k):
        entries.extend((len(stiffness), column, value) for column, value in terms)
        stiffness.append(k)

    if not free:
        row((0, 1.0), (n, -h / 2), k=2 * ks)
    for i in range(n - 1):
        row((i + 1, 1.0), (i, -1.0), (n + i, -h / 2), (n + i + 1, -h / 2), k=ks)
        row((n + i + 1, 1.0), (n + i, -1.0), k=kr)
    if not free:
        row((n - 1, 1.0), (2 * n - 1, h / 2), k=2 * ks)
    r, c, v = zip(*entries, strict=True)
    G = sp.csc_matrix((v, (r, c)), shape=(len(stiffness), 2 * n))
    M = sp.diags(np.r_[np.full(n, m), np.full(n, inertia)])
    s, c = (f(np.arange(1, n) * np.pi / n / 2) for f in (np.sin, np.cos))
    a, d = 4 * ks * s**2 / m, (ks * h**2 * c**2 + 4 * kr * s**2) / inertia
    high = (a + d) / 2 + np.sqrt(((a - d) / 2) ** 2 + (2 * ks * s * h * c) ** 2 / (m * inertia))
    low = np.sort(16 * ks * kr * s**4 / (m * inertia) / high)
    return G, np.array(stiffness), M, low


@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize("n", [1, 2, 30, 100, 10_000])
def test_scalar_chain_in_both_forms(n, fixed):
    if n == 1 and not fixed:
        return
    G, M = springs(n, fixed), sp.identity(n)
    count = min(20, n)
    expected = chain_eigenvalues(n, count, fixed)
    first = 0 if fixed else 1
    assembled = _core.sparse_modes(arrays(M), None, arrays(G.T @ G), count)
    mixed = _core.mixed_modes(arrays(M), arrays(augmented(G, np.ones(G.shape[0]))), count)
    for name, r, limit in (("assembled", assembled, 1e-8), ("mixed", mixed, 1e-12)):
        error = np.abs(r["lambda"][first:] / expected[first:] - 1).max(initial=0.0)
        print(f"chain n={n} fixed={fixed} {name}: {error:.1e}, verified by {r['verified']}, {r['counts']}")
        assert error < limit
        assert r["rigid"] == first and np.all(r["lambda"][:first] == 0.0)
        assert r["verified"] == ("inertia" if n >= 100 else "all computed")
        np.testing.assert_allclose(r["shape"].T @ r["shape"], np.eye(count), atol=1e-8)
        assert np.all(np.abs(r["shape"]).argmax(axis=0) == r["shape"].argmax(axis=0))


@pytest.mark.parametrize("n", [100, 1000, 10_000])
def test_bushing_chain_keeps_its_lowest_modes_in_the_mixed_form(n):
    G, k, M, low = bushing_chain(n)
    mixed = _core.mixed_modes(arrays(M), arrays(augmented(G, 1 / k)), 20)
    assembled = _core.sparse_modes(arrays(M), None, arrays(G.T @ sp.diags(k) @ G), 20)
    errors = [np.abs(r["lambda"] / low[:20] - 1) for r in (mixed, assembled)]
    print(f"bushing chain n={n}: mixed {errors[0].max():.1e}, assembled {errors[1].max():.1e} (of lambda)")
    assert errors[0].max() < 1e-10
    # the assembled form cannot be right here; it has to say so
    assert np.all(errors[1] < 10 * assembled["error"])


@pytest.mark.parametrize("n", [50, 2000])
def test_free_bushing_chain_has_two_rigid_modes(n):
    G, k, M, _ = bushing_chain(n, free=True)
    r = _core.mixed_modes(arrays(M), arrays(augmented(G, 1 / k)), 8)
    assert r["rigid"] == 2
    # free-free beam in the continuum limit: the ratio of (4.73004)^4 and (7.85320)^4, up to terms of order 1/n
    ratio = r["lambda"][3] / r["lambda"][2]
    assert abs(ratio / (7.853204624 / 4.730040745) ** 4 - 1) < 20 / n
    if n == 50:
        dense = scipy.linalg.eigvalsh((G.T @ sp.diags(k) @ G).toarray(), M.toarray())[2:8]
        np.testing.assert_allclose(r["lambda"][2:], dense, rtol=1e-6)


def test_constraints_are_rows_without_compliance():
    """Rigid links (x, y, theta) hinged in a row under torsion springs, the first to ground, against elimination."""
    rng = np.random.default_rng(3)
    n, h = 12, 0.3
    rows, springs_, kt = [], [], []
    for i in range(n):
        left = np.zeros((2, 3 * n))
        left[:, 3 * i : 3 * i + 3] = [[1, 0, 0], [0, 1, -h]]
        turn = np.zeros(3 * n)
        turn[3 * i + 2] = 1.0
        if i > 0:
            left[:, 3 * i - 3 : 3 * i] -= [[1, 0, 0], [0, 1, h]]
            turn[3 * i - 1] = -1.0
        rows.append(left)
        springs_.append(turn)
        kt.append(rng.uniform(1.0, 5.0))
    Phi, G, kt = np.vstack(rows), np.array(springs_), np.array(kt)
    M = np.diag(np.tile([2.0, 2.0, 0.1], n)) * rng.uniform(1, 2)
    B = rng.normal(size=(3 * n, 3 * n))
    geometric = 0.02 * (B + B.T)
    Z = scipy.linalg.null_space(Phi)
    K = G.T @ np.diag(kt) @ G + geometric
    expected = scipy.linalg.eigvalsh(Z.T @ K @ Z, Z.T @ M @ Z)
    both = np.vstack([G, Phi])
    A = augmented(sp.csc_matrix(both), np.r_[1 / kt, np.zeros(2 * n)], sp.csc_matrix(geometric))
    count = 5
    r = _core.mixed_modes(arrays(M), arrays(A), count)
    nearest = np.sort(expected[np.argsort(np.abs(expected - r["sigma"]))[:count]])
    np.testing.assert_allclose(r["lambda"], nearest, rtol=1e-9)
    assert np.abs(Phi @ r["shape"]).max() < 1e-10
    every = _core.mixed_modes(arrays(M), arrays(A), n)
    np.testing.assert_allclose(every["lambda"], expected, rtol=1e-8)
    with pytest.raises(_core.CoreModelError, match=f"leave {n}"):
        _core.mixed_modes(arrays(M), arrays(A), n + 1)


def test_full_compliance_blocks():
    rng = np.random.default_rng(5)
    n = 8
    G = sp.csc_matrix(np.kron(springs(n, True).toarray(), np.eye(2)))
    blocks = [np.linalg.inv(np.array([[3.0, 1.0], [1.0, 2.0]]) * rng.uniform(1, 2)) for _ in range(n)]
    W = scipy.linalg.block_diag(*blocks)
    K = G.T @ np.linalg.inv(W) @ G
    A = sp.bmat([[sp.csc_matrix((2 * n, 2 * n)), G.T], [G, -sp.csc_matrix(W)]])
    r = _core.mixed_modes(arrays(sp.identity(2 * n)), arrays(A), 4)
    np.testing.assert_allclose(r["lambda"], scipy.linalg.eigvalsh(K)[:4], rtol=1e-12)


def test_repeated_eigenvalues_are_all_found():
    """Each eigenvalue of a chain six times over, which one start vector cannot see."""
    n, copies = 200, 6
    G = sp.kron(springs(n, True), sp.identity(copies))
    r = _core.sparse_modes(arrays(sp.identity(n * copies)), None, arrays(G.T @ G), 20)
    expected = np.repeat(chain_eigenvalues(n, 4, True), copies)[:20]
    np.testing.assert_allclose(r["lambda"], expected, rtol=1e-10)
    assert r["verified"] == "inertia"


def test_consistent_mass_and_a_plate_like_grid():
    """A mass matrix that is not diagonal, a grid with double eigenvalues: against LAPACK."""
    n = 18
    T = sp.diags([2 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], [0, 1, -1])
    L = sp.kron(T, sp.identity(n)) + sp.kron(sp.identity(n), T)
    M = sp.identity(n * n) + L / 20
    r = _core.sparse_modes(arrays(M), None, arrays(L), 15)
    expected = scipy.linalg.eigvalsh(L.toarray(), M.toarray())[:15]
    np.testing.assert_allclose(r["lambda"], expected, rtol=1e-11)
    assert np.all(r["error"] < 1e-10)


def test_negative_eigenvalues_of_an_unstable_state():
    """Inverted pendulum-like: the modes of smallest |lambda - sigma| are given, signs included."""
    n = 60
    K = springs(n, True).T @ springs(n, True) - 0.01 * sp.identity(n)
    r = _core.sparse_modes(arrays(sp.identity(n)), None, arrays(K), 6)
    expected = chain_eigenvalues(n, n, True) - 0.01
    nearest = np.sort(expected[np.argsort(np.abs(expected - r["sigma"]))[:6]])
    np.testing.assert_allclose(r["lambda"], nearest, rtol=1e-9)


def test_stiffness_ratio_1e12():
    """A chain with one spring 1e12 times stiffer than the others: the soft modes, both forms."""
    n = 40
    k = np.ones(n)
    k[20] = 1e12
    G = springs(n, True)
    mixed = _core.mixed_modes(arrays(sp.identity(n)), arrays(augmented(G, 1 / k)), 5)
    # the stiff spring makes one double mass of two
    Z = np.zeros((n, n - 1))
    Z[np.arange(n), np.r_[np.arange(20), np.arange(19, n - 1)]] = 1.0
    K = (G.T @ sp.diags(np.where(k > 1, 0, k)) @ G).toarray()
    rigid = scipy.linalg.eigvalsh(Z.T @ K @ Z, Z.T @ Z)[:5]
    error = np.abs(mixed["lambda"] / rigid - 1).max()
    print(f"stiffness ratio 1e12, mixed: {error:.1e}")
    assert error < 1e-11  # the limit itself is 1e-12 away


@pytest.mark.parametrize("kind", ["damped", "gyroscopic", "both", "heavy", "circulatory"])
def test_general_systems_against_lapack(kind):
    rng = np.random.default_rng(7)
    n, count = 80, 8
    K = springs(n, True).T @ springs(n, True)
    M = sp.diags(rng.uniform(1, 2, n))
    C = sp.diags(rng.uniform(0, 0.05, n))
    g = sp.diags([0.01 * np.ones(n - 1), -0.01 * np.ones(n - 1)], [1, -1])
    D = {"damped": C, "gyroscopic": g, "both": C + g, "heavy": 200 * C, "circulatory": C}[kind]
    S = K + 0.1 * g if kind == "circulatory" else K
    r = _core.sparse_modes(arrays(M), arrays(D), arrays(S), count)
    invM = np.linalg.inv(M.toarray())
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-invM @ S.toarray(), -invM @ D.toarray()]])
    s = np.linalg.eigvals(A)
    s = s[s.imag >= 0]
    s = s[np.argsort(np.abs(s))][:count]
    error = np.abs(r["eigenvalue"] - s).max() / np.abs(s[0])
    print(f"{kind}: {error:.1e} from LAPACK, residual {r['residual'].max():.1e}")
    assert error < 1e-8  # LAPACK's own error of a state matrix of this size and condition
    assert r["residual"].max() < 1e-11
    for k in range(count):
        y = r["shape"][:, k]
        assert abs(np.vdot(y, M @ y) - 1) < 1e-10
        largest = y[np.abs(y).argmax()]
        assert largest.real > 0 and abs(largest.imag) < 1e-12


def test_free_damped_chain_has_one_zero_root_per_rigid_motion():
    n = 60
    K = springs(n, False).T @ springs(n, False)
    r = _core.sparse_modes(arrays(sp.identity(n)), arrays(0.01 * K), arrays(K), 4)
    lam = chain_eigenvalues(n, 4, False)
    expected = -0.005 * lam + 1j * np.sqrt(lam - (0.005 * lam) ** 2)
    assert r["rigid"] == 1 and r["eigenvalue"][0] == 0.0
    np.testing.assert_allclose(r["eigenvalue"][1:], expected[1:], rtol=1e-9)


def test_estimates_over_random_chains():
    """true/estimated of lambda in [.01, 10] in 95 % of 200 random chains, assembled, where the form loses digits."""
    rng = np.random.default_rng(13)
    good = 0
    for _ in range(200):
        n = int(rng.integers(20, 400))
        G, k, M, low = bushing_chain(n)
        r = _core.sparse_modes(arrays(M), None, arrays(G.T @ sp.diags(k) @ G), 3)
        true = abs(r["lambda"][0] / low[0] - 1)
        good += 0.01 <= true / r["error"][0] <= 10.0
    print(f"estimates within [.01, 10]: {good} of 200")
    assert good >= 190


@pytest.mark.parametrize(
    "call, error, text",
    [
        (lambda E, K: _core.sparse_modes(E, None, K, 0), _core.CoreModelError, "n = 0"),
        (lambda E, K: _core.sparse_modes(E, None, K, 99), _core.CoreModelError, "n = 99"),
        (lambda E, K: _core.sparse_modes(E, None, K, 2, float("nan")), _core.CoreModelError, "sigma"),
        (lambda E, K: _core.sparse_modes((E[0], E[1], E[2] * 0), None, K, 2), _core.CoreSingularError, "mass"),
        (lambda E, K: _core.sparse_modes((E[0], E[1], E[2] * np.nan), None, K, 2), _core.CoreModelError, "NaN"),
        (lambda E, K: _core.sparse_modes((E[0], E[1] + 100, E[2]), None, K, 2), _core.CoreModelError, "outside"),
        (lambda E, K: _core.sparse_modes((E[0][:-1], E[1], E[2]), None, K, 2), _core.CoreModelError, "M"),
        (lambda E, K: _core.mixed_modes((E[0], E[1], -E[2]), K, 2), _core.CoreSingularError, "positive definite"),
        (lambda E, K: _core.sparse_modes(E, arrays(np.eye(3)), K, 2), _core.CoreModelError, "D is 3 x 3"),
    ],
)
def test_wrong_input_is_named(call, error, text):
    K = arrays(springs(10, True).T @ springs(10, True))
    with pytest.raises(error, match=text):
        call(arrays(sp.identity(10)), K)


# --- at the bounds of what is told apart


def on_weak_spring(stiffness, n=200):
    """Stretches and stiffnesses of a chain of unit springs and masses, the first spring weak: lambda is nearly stiffness / n."""
    return springs(n, True), np.r_[stiffness, np.ones(n - 1)]


def test_a_chain_on_a_weak_spring_is_not_free():
    G, k = on_weak_spring(1e-12)
    r = _core.sparse_modes(arrays(sp.identity(200)), None, arrays(G.T @ sp.diags(k) @ G), 4)
    assert r["rigid"] == 0 and abs(r["lambda"][0] / (1e-12 / 200) - 1) < 3 * r["error"][0]


@pytest.mark.parametrize("stiffness", [1e-6, 3e-9])
def test_a_rigid_motion_beside_a_slow_one_is_one_zero_root(stiffness):
    """Two damped chains, one free, one on a weak spring: rounding splits the double zero by its root."""
    n = 40
    G, k = on_weak_spring(stiffness, n)
    both = sp.block_diag([G, springs(n, False)])
    damped = np.r_[0.0, 0.01 * (1 + np.arange(n - 1) % 3)]
    C = both.T @ sp.diags(np.r_[damped, damped[1:]]) @ both
    K = both.T @ sp.diags(np.r_[k, np.ones(n - 1)]) @ both
    r = _core.sparse_modes(arrays(sp.identity(2 * n)), arrays(C), arrays(K), 4)
    assert r["rigid"] == 1 and r["eigenvalue"][0] == 0.0
    assert r["eigenvalue"][1].imag == pytest.approx(np.sqrt(stiffness / n), rel=1e-4)


@pytest.mark.parametrize(("least", "refused"), [(-1e-11, True), (-1e-13, False)])
def test_a_mass_may_be_negative_by_rounding(least, refused):
    """The least eigenvalue of two masses that are one: rounding of the inertia of a rod about its axis is less than 1e-12 of its size."""
    n = 100
    M = sp.lil_matrix(sp.identity(n))
    M[0, 1] = M[1, 0] = 1.0 - least
    A = arrays(augmented(springs(n, True), np.ones(n)))
    if refused:
        with pytest.raises(_core.CoreSingularError, match="neither positive definite nor semidefinite"):
            _core.mixed_modes(arrays(M), A, 3)
        return
    L = np.linalg.cholesky((springs(n, True).T @ springs(n, True)).toarray())
    inverse = scipy.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, M.toarray()).T))[::-1]
    np.testing.assert_allclose(_core.mixed_modes(arrays(M), A, 3)["lambda"], 1 / inverse[:3], rtol=1e-9)


@pytest.mark.parametrize("sigma", [None, 0.0])
def test_a_stiff_mode_beside_a_constraint_is_a_mode(sigma):
    """All eleven modes of twelve masses in a row, two of them held together; the last spring is 1e10 times stiffer."""
    n, k = 12, np.r_[np.ones(11), 1e10]
    both = sp.vstack([springs(n, True), sp.csr_matrix(([1.0, -1.0], ([0, 0], [2, 3])), shape=(1, n))])
    A = arrays(augmented(both, np.r_[1 / k, 0.0]))
    assert _core.mixed_modes(arrays(sp.identity(n)), A, 11, sigma)["lambda"][-1] == pytest.approx(2e10, rel=1e-6)
    with pytest.raises(_core.CoreModelError, match="leave 11"):
        _core.mixed_modes(arrays(sp.identity(n)), A, 12, sigma)


@pytest.mark.parametrize("soft", [1e-12, 1e-16, 1e-20, 1e-22])
@pytest.mark.parametrize("n", [12, 60, 400])
def test_a_row_on_a_spring_of_any_softness(n, soft):
    """The first root is that of the whole mass on the soft spring, the others are those of the free row."""
    both = springs(n, True)
    r = _core.mixed_modes(arrays(sp.identity(n)), arrays(augmented(both, 1 / np.r_[soft, np.ones(n - 1)])), 4)
    exact = np.r_[soft / n, chain_eigenvalues(n, 4, False)[1:]]
    error = np.abs(r["lambda"] / exact - 1)
    print(f"{n}, {soft}: {error}, said {r['error']}, shift {r['sigma']:.1e}, {r['counts']}")
    # a soft spring changes the others by about itself over theirs
    assert r["rigid"] == 0 and np.all(error <= r["error"] + n**2 * soft) and r["error"].max() < 1e-5


@pytest.mark.parametrize("n", [30, 300])
def test_a_free_row_of_any_springs_has_one_rigid_motion(n):
    for seed in range(10):
        rng = np.random.default_rng([seed, n])
        k, m = np.exp(rng.uniform(-8, 8, n - 1)), np.exp(rng.uniform(-3, 3, n))
        r = _core.mixed_modes(arrays(sp.diags(m)), arrays(augmented(springs(n, False), 1 / k)), 3)
        B = np.sqrt(k)[:, None] * springs(n, False).toarray() / np.sqrt(m)
        exact = np.sort(scipy.linalg.svdvals(B))[:2] ** 2
        assert r["rigid"] == 1 and r["lambda"][0] == 0.0
        np.testing.assert_allclose(r["lambda"][1:], exact, rtol=1e-9)


@pytest.mark.parametrize("values", [[2.0], [1.0, 3.0]])
def test_oscillators_of_few_kinds(values):
    """A Krylov space of so few eigenvalues ends at once: what comes then is rounding of it."""
    K = sp.diags(np.resize(values, 300))
    r = _core.sparse_modes(arrays(sp.identity(300)), arrays(0.1 * sp.identity(300)), arrays(K), 4)
    np.testing.assert_allclose(r["eigenvalue"], -0.05 + 1j * np.sqrt(min(values) - 0.05**2), rtol=1e-7)


# --- through the public door


@pytest.mark.parametrize(("name", "text"), [
    ("M", "a mass matrix must be symmetric"), ("C", "skew part as G"), ("K", "skew part as N"), ("G", "skew-symmetric"),
])  # fmt: skip
@pytest.mark.parametrize("size", [3e-11, 3e-10])
def test_sparse_matrices_without_symmetry_are_refused(name, text, size):
    """Rounding of 1e-10 of the largest entry is none."""
    n = 1700
    K = sp.diags([np.full(n - 1, -1.0), np.full(n, 2.53), np.full(n - 1, -1.0)], [-1, 0, 1]).tocsr()
    parts = {"M": sp.identity(n).tocsr(), "C": 0.013 * K, "K": K, "G": None}
    if name == "G":
        parts["G"] = sp.csr_matrix(([1.0, -1.0], ([3, 71], [71, 3])), shape=(n, n))
    largest = abs(parts[name]).max()
    off = sp.csr_matrix(([size * largest], ([5], [9])), shape=(n, n))
    parts[name] = off + parts[name]
    system = mb.MechanicalSystem(parts["M"], parts["C"], parts["K"], G=parts["G"])
    if size > 1e-10:
        with pytest.raises(mb.ModelError, match=rf"{name} is not .*entries 5, 9 .*{text}|{name} is not skew-symmetric"):
            mb.modes(system, n=2)
    elif name in "MK":
        assert mb.modes(mb.MechanicalSystem(parts["M"], None, parts["K"]), n=2).n == 2


def test_eigen_sensitivity_of_a_large_model_tells_what_to_do():
    with pytest.raises(mb.RouteError, match="leave n= out"):
        mb.eigen_sensitivity(mb.modes(mb.examples.chain(450), n=2))


@pytest.mark.parametrize("damping", ["none", "proportional", "general"])
def test_modes_of_a_sparse_mechanical_system(damping):
    """mb.modes(m, n=20) of scipy.sparse matrices against all modes of the same dense ones."""
    n = 300
    K, M = sp.csc_array(springs(n, True).T @ springs(n, True)), sp.eye_array(n, format="csc")
    C = {"none": None, "proportional": 1e-3 * K, "general": sp.diags(0.02 * (np.arange(n) % 3), format="csc")}[damping]
    found = mb.modes(mb.MechanicalSystem(M, C, K), n=20)
    dense = mb.modes(mb.MechanicalSystem(M.toarray(), None if C is None else C.toarray(), K.toarray()), n=20)
    assert found.stats.route.startswith("sparse") and found.status == "converged" and found.n == 20
    true = np.abs(found.eigenvalue / dense.eigenvalue - 1)
    print(f"{damping}: error {true.max():.1e}, estimate {found.error.max():.1e}, {found.stats.route}")
    assert true.max() < 1e-9
    overlap = np.abs(np.einsum("ij,ij->j", found.shape.conj(), dense.shape))
    np.testing.assert_allclose(overlap, np.linalg.norm(found.shape, axis=0) * np.linalg.norm(dense.shape, axis=0))


def test_the_error_of_sparse_modes_is_the_solver_s_own():
    """Relative error of s: half of that of lambda = -s^2, zero for rigid modes."""
    K, M = sp.csc_array(springs(200, False).T @ springs(200, False)), sp.eye_array(200, format="csc")
    r = _core.sparse_modes(arrays(M), None, arrays(K), 6)
    found = mb.modes(mb.MechanicalSystem(M, None, K), n=6)
    assert found.kind[0] == "rigid" and 0.0 < found.error[0] < 1e-3 * found.omega[1]
    np.testing.assert_allclose(found.error[1:], 0.5 * r["error"][1:], rtol=1e-6)


@pytest.mark.slow
def test_estimates_of_damped_roots_over_random_chains():
    """true/estimated of the lowest root in [.01, 10] in 95 % of 200 chains with damping C = c (K + K^2 / 9), which is not proportional,
    and closed-form roots.
    """
    rng = np.random.default_rng(14)
    good = 0
    for _ in range(200):
        n, c = int(rng.integers(20, 300)), 10.0 ** rng.uniform(-5, -1)
        G = springs(n, True)
        K, M = sp.csc_array(G.T @ G), sp.eye_array(n, format="csc")
        found = mb.modes(mb.MechanicalSystem(M, c * (K + K @ K / 9), K), n=4)
        lam = chain_eigenvalues(n, 4, True)[0]
        half = c * (lam + lam**2 / 9) / 2
        exact = -half + 1j * np.sqrt(lam - half**2)
        assert "proportional" not in found.stats.route
        good += 0.01 <= abs(found.eigenvalue[0] / exact - 1) / found.error[0] <= 10.0
    print(f"estimates within [.01, 10]: {good} of 200")
    assert good >= 190


def test_damped_roots_of_a_longer_chain():
    """The lowest four of 1400 masses, where a mass norm of displacements lets rounding in fast motions stall the iteration."""
    n, c = 1400, 1e-3
    G = springs(n, True)
    K = sp.csc_array(G.T @ G)
    found = mb.modes(mb.MechanicalSystem(sp.eye_array(n, format="csc"), c * K, K), n=4)
    lam = chain_eigenvalues(n, 4, True)
    np.testing.assert_allclose(found.eigenvalue, -c * lam / 2 + 1j * np.sqrt(lam - (c * lam / 2) ** 2), rtol=1e-8)
