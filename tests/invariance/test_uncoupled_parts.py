"""Response curves beside linear parts that nothing connects with them: the same points, stability and events, whatever those parts are."""

import mbrs as mb
import numpy as np
import pytest

BENT = (np.array([[1.0, 0.2], [0.2, 1.5]]), np.array([[2.0, -0.7], [-0.7, 3.0]]))
DIRECTION = np.array([1.0, 0.3])
FORCE = np.array([0.15, 0.05])


def part(rng, kind):
    """M, C, K of one or two coordinates that are soft, stiff, light, heavy or overdamped."""
    mass, omega, damping = 1.0, 10.0 ** rng.uniform(-1.5, -0.5), 10.0 ** rng.uniform(-3, -1)
    if kind == "stiff":
        omega = 10.0 ** rng.uniform(2, 4)
    elif kind == "light":
        mass, omega, damping = 10.0 ** rng.uniform(-9, -5), 10.0 ** rng.uniform(4, 6), 10.0 ** rng.uniform(-9, -6)
    elif kind == "heavy":
        mass = 10.0 ** rng.uniform(5, 9)
    elif kind == "overdamped":
        damping = 10.0 ** rng.uniform(3, 6)
    elif kind == "undamped":
        omega, damping = 10.0 ** rng.uniform(0.7, 1.5), 0.0
    n = int(rng.integers(1, 3))
    A, B = (np.eye(n) + 0.2 * rng.normal(size=(n, n)) for _ in range(2))
    M, K = mass * A @ A.T, mass * omega**2 * B @ B.T
    return M, 2 * damping * (omega * M + K / omega), K


def beside(rng, parts, C, elements):
    """The two coordinates of the curve and these parts in any order of their coordinates: the system, the force, the places of the two."""
    matrices = [(BENT[0], C, BENT[1]), *parts]
    n = sum(len(own[0]) for own in matrices)
    order = rng.permutation(n)
    blocks, first = [np.zeros((n, n)) for _ in range(3)], 0
    for own in matrices:
        at = order[first : first + len(own[0])]
        for whole, block in zip(blocks, own, strict=True):
            whole[np.ix_(at, at)] = block
        first += len(at)
    w, force = np.zeros(n), np.zeros(n)
    w[order[:2]], force[order[:2]] = DIRECTION, FORCE
    return mb.MechanicalSystem(*blocks, elements=[element(w) for element in elements]), force, order[:2]


def gap(w):
    return mb.Gap(3.0, 0.1, w=w)


def cubic(w):
    return mb.Cubic(2.0, w=w)


def response(rng, parts, law):
    span, C, harmonics = {gap: ((1.9, 0.9), 0.01 * BENT[1], 9), cubic: ((0.9, 1.9), 0.02 * BENT[1], 5)}[law]
    system, force, places = beside(rng, parts, C, [law])
    return mb.frequency_response(system, force=force, omega=span, harmonics=harmonics), places


def check(rng, parts, law):
    alone, own = response(rng, [], law)
    curve, places = response(rng, parts, law)
    told = [(e.kind, e.status, e.index) for e in alone.events]
    assert alone.status == "converged" and told
    assert (curve.status, curve.reason) == (alone.status, alone.reason)
    assert [(e.kind, e.status, e.index) for e in curve.events] == told
    assert [e.omega for e in curve.events] == pytest.approx([e.omega for e in alone.events], rel=1e-8)
    assert curve.omega == pytest.approx(alone.omega, rel=1e-8)
    assert np.array_equal(np.asarray(curve.stable, float), np.asarray(alone.stable, float), equal_nan=True)
    assert np.allclose(curve.X[:, places], alone.X[:, own], rtol=0, atol=1e-8 * np.abs(alone.X).max())
    return curve


KINDS = ["soft", "stiff", "light", "heavy", "overdamped", "undamped"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_linear_part_changes_no_curve(kind):
    rng = np.random.default_rng([41, KINDS.index(kind)])
    for law in (gap, cubic):
        check(rng, [part(rng, kind)], law)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_linear_parts_change_no_curve(seed):
    rng = np.random.default_rng([42, seed])
    parts = [part(rng, str(rng.choice(KINDS))) for _ in range(int(rng.integers(1, 4)))]
    check(rng, parts, (gap, cubic)[seed % 2])


def test_exponents_of_a_linear_part_are_its_eigenvalues():
    """Modulo i omega, to the accuracy of eigenvalues in balanced coordinates."""
    rng = np.random.default_rng(43)
    for kind in KINDS:
        parts = [part(rng, kind)]
        curve = check(rng, parts, cubic)
        M, C, K = parts[0]
        n, omega, found = len(M), curve.omega[0], curve.exponents[0]
        inverse = np.linalg.inv(M)
        size = np.sqrt(np.linalg.norm(inverse @ K))  # the unit of time
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K / size**2, -inverse @ C / size]])
        for s in np.linalg.eigvals(A) * size:
            turn = (found.imag - s.imag) / omega
            off = np.abs(found.real - s.real) + omega * np.abs(turn - np.round(turn))
            assert off.min() <= 1e-12 * np.linalg.norm(A) * size + 1e-9 * omega, (kind, s, found)
