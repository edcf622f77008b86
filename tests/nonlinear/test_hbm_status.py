"""One rule for all that harmonic balance returns: "converged" up to the tolerance, whichever way a solution was read."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest

SEEDS = pytest.mark.parametrize("seed", range(3))


def oscillator(seed: int, n: int = 2) -> tuple[mb.MechanicalSystem, np.ndarray]:
    """A chain with a cubic spring to the ground and one inside it, coordinates of mixed units; and a force."""
    rng = np.random.default_rng(seed)
    k = rng.uniform(0.7, 1.6, n + 1)
    K = np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)
    M = np.diag(rng.uniform(0.7, 1.4, n))
    scale = np.exp(rng.uniform(-3, 3, n))
    S = np.diag(scale)
    laws = [mb.Cubic(rng.uniform(0.3, 0.6), w=w @ S) for w in (np.eye(n)[0], np.eye(n)[-1] - np.eye(n)[0])[:n]]
    force = 0.3 * rng.uniform(0.5, 1.0) * S @ np.eye(n)[0]
    return mb.MechanicalSystem(S @ M @ S, 0.04 * S @ M @ S, S @ K @ S, elements=laws), force


def judged(one, tol: float) -> bool:
    """Whether a result says what its error says; True where it is converged."""
    assert one.status == ("converged" if one.error <= tol else "unresolved"), (one.status, one.error, tol)
    assert ("unresolved" in str(one)) == (one.status == "unresolved")
    return one.status == "converged"


def medium(errors: np.ndarray) -> float:
    """A tolerance that some of the points keep."""
    return float(np.exp(0.5 * (np.log(np.min(errors)) + np.log(np.max(errors)))))


@SEEDS
@pytest.mark.parametrize("kind", ["range", "levels", "list", "auto"])
def test_what_is_read_from_a_curve_is_judged_as_its_points(seed, kind):
    system, force = oscillator(seed)
    given: dict = dict(force=force, harmonics=[1, 3], max_points=400)
    where: dict = {
        "range": dict(omega=(0.3, 2.0)),
        "levels": dict(omega=1.3, level=(0.05, 2.0)),
        "list": dict(omega=np.linspace(0.3, 0.8, 7)),
        "auto": dict(omega=(0.3, 2.0)),
    }[kind]
    if kind == "list":
        del given["max_points"]
    tol = medium(mb.frequency_response(system, **given, **where).error)
    if kind == "auto":
        given["harmonics"] = "auto"
    curve = mb.frequency_response(system, **given, **where, tol=tol)
    found = [judged(curve.point(i), tol) for i in range(len(curve))]
    assert found == (curve.error <= tol).tolist()
    if kind != "auto":
        assert not all(found) and any(found) and curve.status == "unresolved"
    for event in curve.events:
        one = curve.at(event)
        assert event.status != "converged" or judged(one, tol) in (True, False)
    if kind in ("range", "auto"):
        peak = curve.peak()
        judged(peak, tol)
        # the estimate is that of the peak itself
        again = mb.harmonic_balance(
            system, force=force, omega=peak.omega, x0=peak, harmonics=peak.harmonics, n_samples=peak.n_samples
        )
        assert peak.error == pytest.approx(again.error, rel=1e-3)
        near = curve.error[max(0, int(np.argmax(curve.amplitude())) - 1) :][:3]
        assert 0.3 * near.min() < peak.error < 3 * near.max()
    if kind == "range":
        doubled = mb.Branch(system, force=force, harmonics=[1, 3], omega=(0.3, 2.0), tol=tol)
        doubled.run(40)
        for i in range(5):
            judged(doubled.curve().point(i), tol)


def test_automatic_curves_judge_by_their_own_tolerance():
    """Without tol= that of harmonics="auto" is 1e-6: where 255 harmonics are too few, no point beyond it is converged."""
    stop = mb.MechanicalSystem([[1.3]], [[0.06]], [[1.0]], elements=[mb.Gap(1e5, 0.4, w=[1.0], bilateral=True)])
    curve = mb.frequency_response(stop, force=[0.5], omega=(0.9, 1.0), harmonics="auto", max_points=3)
    assert np.any(curve.error > 1e-6) and np.all(curve.error < 0.1)
    found = [judged(curve.point(i), 1e-6) for i in range(len(curve))]
    assert not all(found)


@SEEDS
def test_families(seed):
    system, force = oscillator(seed)
    K, M, C = system.K, system.M, system.C

    def member(value):
        return mb.MechanicalSystem(M, C, K, elements=[mb.Cubic(value * e.numbers()[0], w=e.w) for e in system.elements])

    given = dict(value=(0.2, 6.0), omega=0.6, force=force, harmonics=[1])
    tol = medium(mb.parameter_response(member, **given).error)
    curve = mb.parameter_response(member, **given, tol=tol)
    found = [judged(curve.point(i), tol) for i in range(len(curve))]
    assert any(found) and not all(found)
    judged(curve.peak(), tol)
    for event in curve.events:
        one = curve.at(event)
        judged(one, tol)
        again = mb.harmonic_balance(
            member(event.value), force=force, omega=one.omega, x0=one, harmonics=one.harmonics, n_samples=one.n_samples
        )
        assert one.error == pytest.approx(again.error, rel=0.02)


@SEEDS
def test_tori(seed):
    system, force = oscillator(seed, n=1)
    pair = [dict(force=force, omega=0.9), dict(force=0.4 * force, omega=0.9 * np.sqrt(2.0))]
    given = dict(scale=(0.6, 1.9), harmonics=3)
    tol = medium(mb.quasi_periodic_response(system, pair, **given).error)
    curve = mb.quasi_periodic_response(system, pair, **given, tol=tol)
    found = [judged(curve.point(i), tol) for i in range(len(curve))]
    assert any(found) and not all(found) and curve.status == "unresolved"
    for fold in curve.folds:
        judged(fold, tol)
    judged(mb.quasi_periodic(system, pair, harmonics=2, tol=1e-7), 1e-7)


def test_cycles():
    system = mb.MechanicalSystem([[1.7]], [[-1.1]], [[0.8]], elements=[mb.VanDerPol(1.1, w=[1.0])])
    for tol in (1e-1, 1e-3, 1e-9):
        judged(mb.limit_cycle(system, harmonics=9, tol=tol), tol)
