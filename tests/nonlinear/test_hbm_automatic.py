"""harmonics="auto" in every function: .error <= tol, and an estimate that is honest; samples that do not alias."""

import mbrs as mb
import numpy as np
import pytest
from mbrs.examples import duffing, van_der_pol


def random_case(seed):
    """A chain of one to three masses with one law, a force, a frequency and a number of harmonics."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    M = np.diag(rng.uniform(0.5, 2, n))
    k = rng.uniform(0.5, 2, n + 1)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    C = rng.uniform(0.01, 0.2) * K
    w = np.zeros(n)
    w[rng.integers(n)] = 1.0
    if n > 1 and rng.random() < 0.4:
        w[(np.argmax(w) + 1) % n] = -1.0
    s = 10 ** rng.uniform(-1, 0.3)
    law = [
        lambda: mb.Cubic(s, w=w),
        lambda: mb.Polynomial1D([0.0, 0.0, 0.5 * s, s], w=w),
        lambda: mb.Gap(5 * s, 0.1, w=w),
        lambda: mb.Gap(5 * s, 0.1, smoothing=0.05, bilateral=True, w=w),
        lambda: mb.Hertz(3 * s, 1.5, 0.05, w=w),
        lambda: mb.CoulombTanh(0.2 * s, 0.1, w=w),
        lambda: mb.Jenkins(s, 0.1 * s, w=w),
        lambda: mb.VanDerPol(s, w=w),
    ][int(rng.integers(8))]()
    f = np.zeros(n)
    f[rng.integers(n)] = 10 ** rng.uniform(-0.5, 0.7)
    return mb.MechanicalSystem(M, C, K, elements=[law]), f, rng.uniform(0.3, 3.0), int(rng.integers(1, 12))


@pytest.mark.slow
def test_estimate_is_honest_over_200_random_cases():
    ratios, seed = [], 0
    while len(ratios) < 200:
        system, force, omega, harmonics = random_case(seed)
        seed += 1
        assert seed < 400  # else the cases are not what they should be
        try:
            one = mb.harmonic_balance(system, force=force, omega=omega, harmonics=harmonics)
            samples = None if system.elements[0].code in (0, 1, 8) else 8192
            fine = mb.harmonic_balance(
                system, force=force, omega=omega, harmonics=4 * harmonics + 40, n_samples=samples, x0=one
            )
        except mb.ConvergenceError:
            continue
        t = np.linspace(0, one.period, 400)
        true = np.max(np.abs(fine.displacement(t) - one.displacement(t))) / np.max(np.abs(one.X))
        if true > 1e-11:  # below, rounding is what is left
            ratios.append(true / one.error)
    inside = np.mean((np.array(ratios) >= 0.01) & (np.array(ratios) <= 10))
    print(f"{seed} cases: true / estimated {np.quantile(ratios, [0, 0.025, 0.5, 0.975, 1])}, {inside:.1%} in [.01, 10]")
    assert inside >= 0.95


@pytest.mark.parametrize("tol", [1e-3, 1e-6, 1e-9])
def test_harmonic_balance(tol):
    one = mb.harmonic_balance(duffing(1.0), force=[0.3], omega=0.4, harmonics="auto", tol=tol)
    assert one.status == "converged" and 0 < one.error <= tol and one.verify(rtol=1e-11) < 10 * tol


def test_samples_follow_the_law():
    # a stiff contact that lasts for a small part of the period: 512 samples would miss it; a sharp one would not be sampled
    system = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Gap(1e3, 0.3, smoothing=1e-5, w=[1.0])])
    one = mb.harmonic_balance(system, force=[0.5], omega=0.4, harmonics=31)
    fixed = mb.harmonic_balance(system, force=[0.5], omega=0.4, harmonics=31, n_samples=128, x0=one)
    more = mb.harmonic_balance(system, force=[0.5], omega=0.4, harmonics=31, n_samples=16384, x0=one)
    size = np.max(np.abs(more.X))
    aliased, chosen = (np.max(np.abs(a.X - more.X)) / size for a in (fixed, one))
    print(
        f"aliasing with 128 samples {aliased:.1e}, with the {one.n_samples} chosen {chosen:.1e}, error {one.error:.1e}"
    )
    assert one.n_samples > 512 and fixed.n_samples == 128
    assert chosen < one.error and aliased > 10 * chosen
    assert fixed.error > 0.1 * aliased  # what was given is kept, and the estimate says so


def test_contact_along_a_branch():
    system = mb.MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[mb.Gap(20.0, 0.5, w=[1.0])])
    curve = mb.frequency_response(system, force=[0.1], omega=(0.6, 1.8), harmonics="auto", tol=1e-4, stability=False)
    assert curve.status == "converged" and np.max(curve.error) <= 1e-4
    assert curve.omega[0] == 0.6 and curve.omega[-1] == 1.8 and np.all(np.diff(curve.omega) != 0)
    i = int(np.argmax(curve.amplitude()))
    assert curve.point(i).verify() < 2e-3


def test_automatic_branch_has_the_events_of_a_fine_one():
    auto = mb.frequency_response(duffing(1.0), force=[0.3], omega=(0.2, 3.0), harmonics="auto", tol=1e-8)
    fine = mb.frequency_response(duffing(1.0), force=[0.3], omega=(0.2, 3.0), harmonics=41)
    assert auto.status == "converged" and np.max(auto.error) <= 1e-8
    assert [e.kind for e in auto.events] == [e.kind for e in fine.events]
    off = max(abs(a.omega - b.omega) for a, b in zip(auto.events, fine.events, strict=True))
    print(f"{len(auto.events)} events of the automatic branch, largest difference {off:.1e}")
    assert off < 1e-8
    assert all(0 <= e.index <= len(auto) for e in auto.events)


def test_iterator_gives_each_point_once_while_harmonics_grow():
    branch = mb.Branch(duffing(1.0), force=[0.3], omega=(0.2, 3.0), harmonics="auto", tol=1e-8)
    points = list(branch)
    assert len(points) == len(branch.chunks) and branch.status == "converged"
    assert max(p.error for p in points) <= 1e-6
    assert np.all(np.abs(np.diff([p.omega for p in points])) > 0)


@pytest.mark.slow
def test_limit_cycle():
    for mu, tol in ((1.0, 1e-10), (5.0, 1e-8)):
        one = mb.limit_cycle(van_der_pol(mu), harmonics="auto", tol=tol)
        assert one.status == "converged" and one.error <= tol and one.stats.route != "collocation"
    hard = mb.limit_cycle(van_der_pol(20.0), harmonics="auto")
    print(f"mu = 20: {hard.stats.route}, H = {hard.harmonics[-1]}, period {hard.period:.9f}, error {hard.error:.1e}")
    # docs/theory.md (23.10)
    assert hard.status == "converged" and hard.error <= 1e-6 and hard.period == pytest.approx(34.68232331, abs=1e-6)


@pytest.mark.some(1)
@pytest.mark.parametrize("tol", [1e-4, 1e-8])
def test_quasi_periodic(tol):
    forces = [dict(force=[-0.25j], omega=1.5), dict(force=[-0.25j], omega=1.5 * np.sqrt(2))]
    system = duffing(1.5, 0.1)
    one = mb.quasi_periodic(system, forces, harmonics="auto", tol=tol)
    fine = mb.quasi_periodic(system, forces, harmonics=17, x0=one)
    t = np.linspace(0, 200, 2000)
    true = np.max(np.abs(one.displacement(t) - fine.displacement(t))) / np.max(np.abs(fine.X))
    print(f"tol {tol:.0e}: {len(one.indices)} terms, estimated {one.error:.1e}, true {true:.1e}")
    assert one.status == "converged" and one.error <= tol and 0.01 < true / one.error < 10


def test_quasi_periodic_contact_gets_samples():
    system = mb.MechanicalSystem([[1.0]], [[0.2]], [[1.0]], elements=[mb.Gap(5.0, 0.1, w=[1.0])])
    forces = [dict(force=[0.2], omega=1.5), dict(force=[0.2], omega=1.5 * np.sqrt(2))]
    one = mb.quasi_periodic(system, forces, harmonics=9)
    off = one.verify(cycles=10)
    print(f"contact, samples {one.n_samples}: estimated {one.error:.1e}, integrated {off:.1e}")
    assert 0.01 < off / one.error < 10


def test_a_model_with_ports():
    m = mb.Model("mount")
    b = m.body("b", mass=10.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=1e5, c=20.0, law=mb.Cubic(1e9))
    curve = mb.frequency_response(m, inputs=b.force("x"), amplitude=20.0, frequency=(1, 40), harmonics="auto", tol=1e-6)
    same = mb.MechanicalSystem([[10.0]], [[20.0]], [[1e5]], elements=[mb.Cubic(1e9, w=[1.0])])
    plain = mb.frequency_response(same, force=[20.0], frequency=(1, 40), harmonics="auto", tol=1e-6)
    assert curve.status == "converged" and np.max(curve.error) <= 1e-6
    assert [e.omega for e in curve.events] == pytest.approx([e.omega for e in plain.events], rel=1e-10)
    with pytest.raises(mb.ModelError, match="exactly one of force"):
        mb.frequency_response(m, inputs=b.force("x"), force=[1.0], frequency=(1, 40))
    with pytest.raises(mb.ModelError, match="ports of a model"):
        mb.frequency_response(same, inputs="b.force.x", frequency=(1, 40))
    both = [dict(inputs=b.force("x"), amplitude=20.0, omega=w) for w in (80.0, 80.0 * np.sqrt(2))]
    vectors = [dict(force=[20.0], omega=w) for w in (80.0, 80.0 * np.sqrt(2))]
    assert np.allclose(mb.quasi_periodic(m, both).X, mb.quasi_periodic(same, vectors).X, rtol=1e-9, atol=1e-15)
