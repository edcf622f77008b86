"""Modes of graded systems against 60-digit arithmetic: soft springs under stiff ones, light and heavy masses.

A model knows its springs and has to be right. Matrices alone may have lost what is asked: there the stated error has to cover
the true one.
"""

import jitter
import mbrs as mb
import mpmath as mp
import numpy as np
import pytest
from oracles import precise

DIGITS = 60


def springs_matrix(k, number=float):
    """Stiffness of ground - k0 - m0 - k1 - m1 ..., entries by ``number``: of mpmath's numbers the sums keep all digits."""
    n = len(k)
    K = [[number(0)] * n for _ in range(n)]
    with mp.workdps(DIGITS):
        for i in range(n):
            K[i][i] = number(k[i]) + (number(k[i + 1]) if i + 1 < n else 0)
            if i + 1 < n:
                K[i][i + 1] = K[i + 1][i] = -number(k[i + 1])
    return K


def exact_roots(K, masses):
    """sqrt of the eigenvalues of diag(masses)^-1 K, ascending."""
    with mp.workdps(DIGITS):
        n = len(masses)
        root = [mp.sqrt(mp.mpf(float(m))) for m in masses]
        A = mp.matrix(n, n)
        for i in range(n):
            for j in range(n):
                A[i, j] = mp.mpf(K[i][j]) / root[i] / root[j]
        values = mp.eigsy(A, eigvals_only=True)
        return np.array(sorted(float(mp.sqrt(abs(v))) for v in values))


def rails(k, masses):
    """The chain as a model, on rails in one random direction."""
    direction = np.random.default_rng(1).normal(size=3)
    direction /= np.linalg.norm(direction)
    m, before = mb.Model("rails"), None
    for i, (spring, mass) in enumerate(zip(k, masses, strict=True)):
        at = tuple((1.0 + i) * direction)
        b = m.body(f"b{i}", mass=mass, inertia=(mass, mass, mass), at=at)
        m.prismatic(f"rail{i}", before or m.ground, b, at=at, axis=tuple(direction), k=spring)
        before = b
    return m


def honest(modes, exact):
    """The true error of every root is covered by the stated one; "converged" is said of small errors only.

    Errors are relative; those of a rigid mode are frequencies, which rounding of the matrix may hide, far below the others.
    """
    order = np.argsort(modes.omega)
    found, stated = modes.omega[order], np.broadcast_to(modes.error, modes.omega.shape)[order]
    rigid = modes.kind[order] == "rigid"
    true = np.abs(found - exact) / np.where(rigid, 1.0, exact)
    if modes.status == "converged":
        assert np.all(stated < np.where(rigid, 1e-6 * exact.max(), 1e-3))
        assert np.all(true <= 30 * stated + 1e-13)
    else:
        assert modes.status == "unresolved"


def graded(rng, decades, n=5):
    """Numbers over so many decades, one soft spring at the ground."""
    k = rng.uniform(1, 3, n) * 10.0 ** np.concatenate([[0], rng.uniform(decades - 1, decades, n - 1)])
    return k, rng.uniform(0.5, 2.0, n)


@pytest.mark.parametrize("decades", [2, 5, 8, 12, 14, 16])
def test_a_model_with_a_soft_spring_under_stiff_ones(decades):
    for seed in range(4):
        k, masses = graded(np.random.default_rng([seed, decades]), decades)
        exact = exact_roots(springs_matrix(k, mp.mpf), masses)
        found = np.sort(mb.modes(rails(k, masses)).omega)
        assert found == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("decades", [2, 5, 8, 12, 14, 16])
def test_a_chain_that_hangs_on_a_soft_spring_above_stiff_ones(decades):
    """Each spring carries the weight below it; no direction counts as free, and the roots are those without weight."""
    for seed in range(4):
        k, masses = graded(np.random.default_rng([seed, decades]), decades)
        m, g = rails(k, masses), 0.013
        before = np.array([m.value(f"b{i}.at") for i in range(len(k))])
        down = before[0] / np.linalg.norm(before[0])
        m.gravity = tuple(g * down)
        eq = mb.equilibrium(m)
        sag = np.cumsum(g * np.cumsum(masses[::-1])[::-1] / k)
        found = (eq.poses["position"] - before) @ down
        # the last digit of a place makes this force in the stiffest spring, over the weight
        rounding = np.finfo(float).eps * np.max(np.abs(eq.poses["position"])) * k.max() / (g * masses.sum())
        assert eq.status == "converged" or 1e-9 < eq.residual < 8 * rounding
        assert eq.free_directions == () and eq.stable
        assert found == pytest.approx(sag, rel=1e-9)
        exact = exact_roots(springs_matrix(k, mp.mpf), masses)
        assert np.sort(mb.modes(m, at=eq).omega) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("decades", [2, 5, 8, 12, 14, 15])
def test_matrices_with_a_soft_spring_under_stiff_ones(decades):
    for seed in range(4):
        k, masses = graded(np.random.default_rng([seed, decades]), decades)
        k = np.round(k)  # sums of integers below 2^53 are exact: the matrix is the one that was meant
        K = springs_matrix(k)
        honest(mb.modes(mb.MechanicalSystem(np.diag(masses), K=K)), exact_roots(K, masses))


@pytest.mark.parametrize("decades", [5, 6])
def test_soft_roots_of_exact_matrices_keep_their_digits(decades):
    """Sums of these entries cancel by as many digits, in a quotient of energies too."""
    for seed in range(4):
        k, masses = graded(np.random.default_rng([seed, 10 * decades]), decades)
        K = springs_matrix(np.round(k))
        found = mb.modes(mb.MechanicalSystem(np.diag(masses), K=K)).omega
        assert np.sort(found) == pytest.approx(exact_roots(K, masses), rel=1e-13)


def alternating(rng, r, n=5):
    """Unit springs between light and heavy masses."""
    size = np.array([1 / r, r] * n)[:n]
    size[-1] = 1.0
    return rng.uniform(0.5, 2.0, n), rng.uniform(0.5, 2.0, n) * size


@pytest.mark.parametrize("r", [10.0, 1e3, 1e6, 1e7, 1e8])
def test_matrices_of_light_and_heavy_masses(r):
    for seed in range(4):
        k, masses = alternating(np.random.default_rng([seed, int(np.log10(r))]), r)
        K = springs_matrix(k)
        honest(mb.modes(mb.MechanicalSystem(np.diag(masses), K=K)), exact_roots(K, masses))


@pytest.mark.parametrize("r", [10.0, 1e3, 1e5, 1e7, 1e8])
def test_a_model_of_light_and_heavy_masses(r):
    for seed in range(4):
        k, masses = alternating(np.random.default_rng([seed, int(np.log10(r))]), r)
        exact = exact_roots(springs_matrix(k, mp.mpf), masses)
        # noise tilts the rails, along which light bodies are then moved by heavy ones
        rel = 1e-10 + 1e3 * jitter.level()
        assert np.sort(mb.modes(rails(k, masses)).omega) == pytest.approx(exact, rel=rel)


@pytest.mark.exact
@pytest.mark.parametrize(("light", "refused"), [(1e-21, False), (1e-26, True)])
def test_a_body_too_light_to_be_told_from_rounding_is_refused(light, refused):
    """On a spring, carrying a heavy one: arms and axes are known to 1e-12 at best, masses of what they carry to 1e-24."""
    k, masses = np.array([1.0, 2.0]), np.array([light, 1.5])
    if refused:
        with pytest.raises(mb.SingularError, match="carries no inertia of its own"):
            mb.modes(rails(k, masses))
    else:
        exact = exact_roots(springs_matrix(k, mp.mpf), masses)
        assert np.sort(mb.modes(rails(k, masses)).omega) == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize("ratio", [1e4, 1e6])
def test_a_model_is_solved_from_its_springs_where_the_sum_of_them_is_not_enough(ratio):
    """Three bodies in a row, the first on a soft bushing: 1e-16 of the ratio is lost in the assembled stiffness."""
    m, before = mb.Model("row"), None
    for i in range(3):
        at = (0.3 * i, 0.2, 0.1 * i)
        b = m.body(f"b{i}", mass=1.0 + i, inertia=(1.0, 2.0, 2.5), at=at)
        m.bushing(f"k{i}", before or m.ground, b, at=at, k=(ratio if before else 1.0,) * 6)
        before = b
    modes = mb.modes(m)
    again = "jacobi singular value decompositions" in modes.stats.counts
    assert again == (ratio > 1e5) and np.max(modes.error) < (1e-13 if again else 1e-9)


# --- damped -----


def damped(rng, ratio, n=3):
    """A chain with dampers, one mass ``ratio`` times the others."""
    masses = rng.uniform(0.5, 2.0, n)
    masses[int(rng.integers(n))] *= ratio
    K = np.array(springs_matrix(rng.uniform(0.5, 2.0, n)))
    C = np.array(springs_matrix(rng.uniform(0.05, 0.2, n)))
    return masses, C, K


@pytest.mark.some(2)
@pytest.mark.parametrize(
    "ratio",
    [1e-3, 1e3, 1e6, 1e12, 1e15],
)
def test_a_damped_chain_with_one_mass_of_another_size(ratio):
    for seed in range(6):
        masses, C, K = damped(np.random.default_rng([seed, 77]), ratio)
        modes = mb.modes(mb.MechanicalSystem(np.diag(masses), C, K))
        exact = np.array([complex(v) for v in precise.exact_roots(np.diag(masses), C, K, DIGITS)])
        for s, stated in zip(modes.eigenvalue, np.broadcast_to(modes.error, modes.n), strict=True):
            true = np.min(np.abs(exact - s)) / abs(s)
            if modes.status == "converged":
                assert stated < 1e-3 and true <= 30 * stated + 1e-13


def test_harmonic_balance_beside_a_loose_body():
    """The loose one stays where it is, and the other one moves as the oscillator that it is; or an error names the loose one."""
    m = mb.Model("pair")
    held = m.body("held", mass=1.3, inertia=(1, 1, 1), at=(0, 0, 0))
    m.body("loose", mass=2.1, inertia=(1, 2, 2.5), at=(1, 2, 3))
    m.prismatic("rail", m.ground, held, at=(0, 0, 0), axis=(0.6, 0.0, 0.8), k=2.0, c=0.1, law=mb.Cubic(0.0))
    try:
        found = mb.harmonic_balance(m, inputs=held.force("x"), amplitude=0.5, omega=1.1, harmonics=3)
    except mb.MbrsError as reason:
        assert "loose" in str(reason)
        return
    assert np.all(np.isfinite(found.X))
    at = list(mb.System(m).coordinates).index("rail")
    assert found.amplitude(at) == pytest.approx(0.3 / abs(2.0 - 1.3 * 1.1**2 + 0.11j), rel=1e-9)
