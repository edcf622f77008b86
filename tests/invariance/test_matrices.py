"""Systems given as matrices: coordinates scaled one by one, noise of rounding added, a part that is not coupled."""

import mbrs as mb
import numpy as np
import pytest
from changes import noisy, scaled_system


def system(matrices, elements=()):
    return mb.MechanicalSystem(**{k: v for k, v in matrices.items() if v is not None}, elements=elements)


def random_matrices(rng, n=5, gyroscopic=True, circulatory=False):
    """A damped system with frequencies of about 1 rad/s."""
    A, B, D, E, F = (rng.normal(size=(n, n)) for _ in range(5))
    return {
        "M": A @ A.T / n + np.eye(n),
        "C": 0.05 * D @ D.T / n,
        "K": B @ B.T / n + np.eye(n),
        "G": 0.1 * (E - E.T) if gyroscopic else None,
        "N": 0.02 * (F - F.T) if circulatory else None,
    }


def scales(rng, n, decades):
    return 10.0 ** rng.uniform(-decades, decades, n)


def ordered(s):
    s = np.asarray(s)
    return s[np.lexsort((s.imag, np.round(np.abs(s), 6)))]


KINDS = {"damped": (False, False), "gyroscopic": (True, False), "circulatory": (True, True)}


@pytest.mark.parametrize("decades", [1, 3, 6])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_roots_in_scaled_coordinates(seed, kind, decades):
    rng = np.random.default_rng([seed, decades])
    A = random_matrices(rng, 5, *KINDS[kind])
    expected = ordered(mb.modes(system(A)).roots)
    found = mb.modes(system(scaled_system(A, scales(rng, 5, decades))))
    assert found.status == "converged"
    assert np.abs(ordered(found.roots) - expected).max() < 1e-10


@pytest.mark.parametrize("decades", [1, 3, 6])
@pytest.mark.parametrize("seed", range(3))
def test_transfer_functions_in_scaled_coordinates(seed, decades):
    rng = np.random.default_rng([seed, decades, 1])
    A, omega = random_matrices(rng, 5, True, True), np.array([0.2, 0.9, 1.3, 5.0])
    D = scales(rng, 5, decades)
    expected = mb.frf(system(A), list(range(5)), list(range(5)), omega=omega).value
    found = mb.frf(system(scaled_system(A, D)), list(range(5)), list(range(5)), omega=omega).value
    back = found * np.outer(D, D)[:, :, None]
    assert np.abs(back - expected).max() < 1e-10 * np.abs(expected).max()


def with_a_rigid_direction(rng, noise):
    """An undamped chain that nothing holds, some of it without a coordinate's spring, beside a damped pair."""
    K = np.diag([0.0, *rng.uniform(2, 7, 1), 3.0, 5.0])
    K[2, 3] = K[3, 2] = -1.0
    C = np.zeros((4, 4))
    C[2:, 2:] = [[0.1, -0.05], [-0.05, 0.05]]
    K[0, 1] = K[1, 0] = noise * rng.choice([-1, 1])
    return mb.MechanicalSystem(np.eye(4), C, K), K, C


@pytest.mark.parametrize("noise", [0.0, 1e-17, 3e-17, 1e-16, 5e-16])
def test_rounding_beside_a_rigid_direction(noise):
    for seed in range(4):
        s, K, C = with_a_rigid_direction(np.random.default_rng(seed), noise)
        modes = mb.modes(s)
        K = K.copy()
        K[0, 1] = K[1, 0] = 0.0
        companion = np.block([[np.zeros((4, 4)), np.eye(4)], [-K, -C]])
        expected = np.sort(np.abs(np.linalg.eigvals(companion)))
        assert np.all(np.isfinite(modes.shape)) and np.all(np.isfinite(modes.error))
        assert list(modes.kind).count("rigid") == 1
        assert np.sort(np.abs(modes.roots))[2:] == pytest.approx(expected[2:], rel=1e-9)


def cylinder_beside_a_chain(seed, gravity):
    """A body that slides and turns freely on an arbitrary axis under gravity, and two others on damped rails."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    down = rng.normal(size=3)
    m = mb.Model("pair", gravity=tuple(down) if gravity else None)
    b = m.body("b", mass=1.3, inertia=(0.2, 0.3, 0.4), at=(0, 0, 0))
    m.cylindrical("axle", m.ground, b, at=(0, 0, 0), axis=tuple(axis))
    before = m.ground
    for i in range(2):
        rail = m.body(f"r{i}", mass=1.0 + i, inertia=(1, 1, 1), at=(1.0 + i, 2.0, 0))
        m.prismatic(f"rail{i}", before, rail, at=(1.0 + i, 2.0, 0), axis=tuple(rng.normal(size=3)), k=30.0, c=0.3)
        before = rail
    return m


def test_a_free_cylindrical_joint_beside_a_damped_chain():
    for seed in range(25):
        expected = np.sort(mb.modes(cylinder_beside_a_chain(seed, False)).omega)
        modes = mb.modes(cylinder_beside_a_chain(seed, True))
        assert np.all(np.isfinite(modes.shape)) and np.all(np.isfinite(modes.error))
        assert list(modes.kind).count("rigid") == 2
        assert np.sort(modes.omega) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_noise_of_rounding(kind):
    for seed in range(6):
        rng = np.random.default_rng([seed, 3])
        A = random_matrices(rng, 5, *KINDS[kind])
        expected = ordered(mb.modes(system(A)).roots)
        assert np.abs(ordered(mb.modes(system(noisy(A, rng))).roots) - expected).max() < 1e-11


# --- nonlinear -----


def beside(A, entry):
    """The matrix with one more row and column, not coupled."""
    return np.block([[A, np.zeros((len(A), 1))], [np.zeros((1, len(A))), np.array([[entry]])]])


def duffing(scale=None, part=None):
    """Two coupled masses, a cubic spring on the first; in scaled coordinates, or with a linear part beside it."""
    M, C, K = np.diag([1.0, 1.4]), np.array([[0.06, -0.02], [-0.02, 0.05]]), np.array([[2.0, -0.7], [-0.7, 1.6]])
    w, force = np.array([1.0, 0.0]), np.array([0.2, 0.05])
    if scale is not None:
        D = np.diag(scale)
        M, C, K, w, force = D @ M @ D, D @ C @ D, D @ K @ D, D @ w, D @ force
    if part is not None:
        k = part
        M, C, K = beside(M, 1.0), beside(C, 0.02 * np.sqrt(k)), beside(K, k)
        w, force = np.append(w, 0.0), np.append(force, 1.0)
    return mb.MechanicalSystem(M, C, K, elements=[mb.Cubic(0.3, w=w)]), force


def linear(k, n=2):
    """Uncoupled oscillators of damping ratio .01 with stiffness 1, k, ... and their exact amplitudes at omega."""
    stiffness = np.geomspace(1.0, k, n)
    s = mb.MechanicalSystem(np.eye(n), np.diag(0.02 * np.sqrt(stiffness)), np.diag(stiffness))
    return s, lambda omega: 1 / np.abs(stiffness - omega**2 + 0.02j * np.sqrt(stiffness) * omega)


@pytest.mark.parametrize("k", [10.0, 300.0, 1e5, 1e6, 1e9])
@pytest.mark.parametrize("span", [(1.2, 1.5), (0.5, 1.5), (1.5, 0.7)])
def test_a_sweep_over_a_linear_system_is_its_transfer_function(k, span):
    s, exact = linear(k)
    curve = mb.frequency_response(s, force=[1.0, 1.0], omega=span, harmonics=1, stability=False)
    for i, omega in enumerate(curve.omega):
        found = [curve.point(i).amplitude(j) for j in range(2)]
        assert found == pytest.approx(exact(omega), rel=1e-6)


def test_a_sweep_over_two_decades_of_one_linear_oscillator():
    """From .001 to .1 of its frequency."""
    s, exact = linear(1.0, 1)
    curve = mb.frequency_response(s, force=[1.0], omega=(1e-3, 1e-1), harmonics=1, stability=False)
    found = [curve.point(i).amplitude(0) for i in range(len(curve.omega))]
    assert found == pytest.approx([exact(w)[0] for w in curve.omega], rel=1e-7)


@pytest.mark.some(2)
@pytest.mark.parametrize("part", [0.5, 40.0, 1e6, 1e8])
def test_a_sweep_beside_a_part_that_is_not_coupled(part):
    """Folds and their amplitudes stay; each point is a solution by itself."""
    alone, force = duffing()
    expected = mb.frequency_response(alone, force=force, omega=(0.8, 1.6), harmonics=3)
    both, force = duffing(part=part)
    found = mb.frequency_response(both, force=force, omega=(0.8, 1.6), harmonics=3)
    assert [e.kind for e in found.events] == [e.kind for e in expected.events]
    assert [e.omega for e in found.events] == pytest.approx([e.omega for e in expected.events], rel=1e-6)
    at = len(found.omega) // 2
    again = mb.harmonic_balance(alone, force=[0.2, 0.05], omega=found.omega[at], harmonics=3, x0=found.X[at][:2])
    assert found.point(at).amplitude(0) == pytest.approx(again.amplitude(0), rel=1e-6)


@pytest.mark.parametrize("decades", [1, 2, 4])
def test_a_sweep_in_scaled_coordinates(decades):
    alone, force = duffing()
    expected = mb.frequency_response(alone, force=force, omega=(0.8, 1.6), harmonics=3)
    scale = np.array([10.0**-decades, 10.0**decades])
    s, force = duffing(scale)
    found = mb.frequency_response(s, force=force, omega=(0.8, 1.6), harmonics=3)
    assert [e.omega for e in found.events] == pytest.approx([e.omega for e in expected.events], rel=1e-6)
    top = max(found.amplitude(dof=0, harmonic=1)) * scale[0]
    assert top == pytest.approx(max(expected.amplitude(dof=0, harmonic=1)), rel=3e-3)


def test_a_sweep_down_finds_what_a_sweep_up_finds():
    s, force = duffing()
    up = mb.frequency_response(s, force=force, omega=(0.8, 1.6), harmonics=3)
    down = mb.frequency_response(s, force=force, omega=(1.6, 0.8), harmonics=3)
    assert sorted(e.omega for e in up.events) == pytest.approx(sorted(e.omega for e in down.events), rel=1e-7)
    assert max(up.amplitude(dof=0)) == pytest.approx(max(down.amplitude(dof=0)), rel=3e-3)


@pytest.mark.parametrize("decades", [1, 3, 6])
def test_harmonic_balance_in_scaled_coordinates(decades):
    alone, force = duffing()
    expected = mb.harmonic_balance(alone, force=force, omega=1.05, harmonics=5)
    scale = np.array([10.0**-decades, 10.0**decades])
    s, force = duffing(scale)
    found = mb.harmonic_balance(s, force=force, omega=1.05, harmonics=5)
    for i in range(2):
        assert found.amplitude(i) * scale[i] == pytest.approx(expected.amplitude(i), rel=1e-8)


@pytest.mark.parametrize("part", [1e-6, 0.5, 1e6, 1e10])
def test_harmonic_balance_beside_a_part_that_is_not_coupled(part):
    alone, force = duffing()
    expected = mb.harmonic_balance(alone, force=force, omega=1.05, harmonics=5)
    both, force = duffing(part=part)
    found = mb.harmonic_balance(both, force=force, omega=1.05, harmonics=5)
    assert [found.amplitude(i) for i in range(2)] == pytest.approx([expected.amplitude(i) for i in range(2)], rel=1e-8)


TONES = (0.9, 0.9 * np.sqrt(2))


@pytest.mark.parametrize("decades", [1, 4])
def test_quasi_periodic_in_scaled_coordinates(decades):
    def solve(s, force):
        return mb.quasi_periodic(s, [{"force": force, "omega": w} for w in TONES], harmonics=3)

    alone, force = duffing()
    expected = solve(alone, force)
    scale = np.array([10.0**-decades, 10.0**decades])
    s, force = duffing(scale)
    found = solve(s, force)
    assert np.abs(found.X * scale[:, None] - expected.X).max() < 1e-8 * np.abs(expected.X).max()


@pytest.mark.parametrize("part", [0.5, 1e6, 1e10])
def test_quasi_periodic_beside_a_part_that_is_not_coupled(part):
    def solve(s, force):
        return mb.quasi_periodic(s, [{"force": force, "omega": w} for w in TONES], harmonics=3)

    expected, found = solve(*duffing()), solve(*duffing(part=part))
    assert np.abs(found.X[:2] - expected.X).max() < 1e-8 * np.abs(expected.X).max()


def oscillator(scale=(1.0, 1.0), part=None):
    """Van der Pol's, coupled to a passive mass."""
    D = np.diag(scale)
    M, C, K = np.eye(2), np.diag([-0.4, 0.15]), np.array([[1.3, -0.3], [-0.3, 2.1]])
    M, C, K, w = D @ M @ D, D @ C @ D, D @ K @ D, D @ [1.0, 0.0]
    if part is not None:
        M, C, K = beside(M, 1.0), beside(C, 0.1 * np.sqrt(part)), beside(K, part)
        w = np.append(w, 0.0)
    return mb.MechanicalSystem(M, C, K, elements=[mb.VanDerPol(0.4, w=w)])


@pytest.mark.parametrize("decades", [1, 3])
def test_limit_cycle_in_scaled_coordinates(decades):
    expected = mb.limit_cycle(oscillator(), harmonics=9)
    scale = np.array([10.0**-decades, 10.0**decades])
    found = mb.limit_cycle(oscillator(scale), harmonics=9)
    assert found.period == pytest.approx(expected.period, rel=1e-8)
    assert found.amplitude(0) * scale[0] == pytest.approx(expected.amplitude(0), rel=1e-7)


@pytest.mark.parametrize("part", [0.5, 30.0, 1e4])
def test_limit_cycle_beside_a_part_that_is_not_coupled(part):
    expected, found = mb.limit_cycle(oscillator(), harmonics=9), mb.limit_cycle(oscillator(part=part), harmonics=9)
    assert found.period == pytest.approx(expected.period, rel=1e-8)
    assert found.amplitude(0) == pytest.approx(expected.amplitude(0), rel=1e-7)
