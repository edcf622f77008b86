"""Branches of periodic solutions: folds, stability and events against published values, the NumPy reference and
shooting."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from mbrs.errors import ConvergenceError, ModelError
from mbrs.examples import duffing, two_mass_cubic
from mbrs.linear.matrices import MechanicalSystem
from mbrs.model.laws import Cubic, Gap, Jenkins, VanDerPol, VaryingStiffness
from mbrs.nonlinear.branch import Branch
from mbrs.nonlinear.frequency_response import frequency_response
from mbrs.nonlinear.options import Fourier
from mbrs.nonlinear.periodic import harmonic_balance
from mbrs.reference import hbm_shooting
from oracles import hbm_continuation


@pytest.fixture(scope="module")
def curve():
    return frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), harmonics=7)


def test_folds_of_the_duffing_oscillator(curve):
    # docs/theory.md (23.5), folds with 5 and 4 decimals
    assert curve.status == "converged"
    assert [event.kind for event in curve.events] == ["fold", "fold"]
    high, low = curve.events
    assert high.omega == pytest.approx(1.26960, abs=6e-6) and np.hypot(*high.X[0, 1:3]) == pytest.approx(
        2.8250, abs=6e-5
    )
    assert low.omega == pytest.approx(1.11570, abs=6e-6) and np.hypot(*low.X[0, 1:3]) == pytest.approx(1.0819, abs=6e-5)


def test_folds_equal_the_reference(curve):
    for event in curve.events:
        z = np.append(event.X.T.ravel(), event.omega)
        reference = hbm_continuation.fold(duffing(), [0.18], z + 1e-3, range(1, 8), 32)
        assert abs(reference[-1] - event.omega) < 1e-10
        assert np.max(np.abs(reference[:-1] - z[:-1])) < 1e-7


def test_peak_of_the_duffing_oscillator(curve):
    # docs/theory.md (23.5), folds with 5 and 4 decimals
    peak = curve.peak()
    assert peak.amplitude() == pytest.approx(2.83020, abs=6e-6) and peak.omega == pytest.approx(1.2687, abs=6e-5)


def test_folds_and_peak_with_31_harmonics():
    # docs/theory.md (23.6): by shooting, rtol 1e-13
    system = duffing(1.0)
    fine = frequency_response(system, force=[0.3], omega=(0.5, 3.0), harmonics=31, stability=False)
    assert [event.kind for event in fine.events] == ["fold", "fold"]
    folds = [event.omega for event in fine.events]
    peak = fine.peak(harmonic=None)
    top = np.max(np.abs(peak.displacement(np.linspace(0, peak.period, 200001))))
    errors = [folds[0] - 2.3996492588, folds[1] - 1.3291743525, peak.omega - 2.3993334635, top - 2.5645599332]
    print("H = 31: errors of folds, peak frequency, peak:", errors)
    assert np.max(np.abs(errors)) < 1e-8


def test_stability_changes_at_the_folds_only(curve):
    folds = sorted(event.index for event in curve.events)
    expected = np.ones(len(curve), bool)
    expected[folds[0] : folds[1]] = False
    assert curve.stable.dtype == bool and np.array_equal(curve.stable, expected)


def test_points_lie_on_the_branch_of_the_reference(curve):
    points = hbm_continuation.branch(duffing(), [0.18], (0.5, 1.6), range(1, 8), 32, 0.05)
    amplitude = np.hypot(points[:, 1], points[:, 2])
    assert amplitude.max() == pytest.approx(curve.amplitude().max(), rel=1e-2)
    for i in range(0, len(curve), 7):  # each point solves the reference's equations
        from mbrs.reference import hbm_balance

        R, _, _ = hbm_balance.residual(duffing(), curve.X[i].T.ravel(), [0.18], curve.omega[i], range(1, 8), 32)
        assert np.max(np.abs(R)) < 1e-10


@pytest.mark.parametrize("predictor", ["tangent", "secant", "lagrange"])
@pytest.mark.parametrize("corrector", ["pseudo-arclength", "arclength", "moore-penrose"])
def test_all_predictors_and_correctors(predictor, corrector, curve):
    other = frequency_response(
        duffing(),
        force=[0.18],
        omega=(0.5, 1.6),
        harmonics=7,
        predictor=predictor,
        corrector=corrector,
        stability=False,
    )
    assert other.status == "converged"
    assert [event.omega for event in other.events] == pytest.approx([event.omega for event in curve.events], abs=1e-10)
    assert other.omega[-1] == 1.6 and np.allclose(other.X[-1], curve.X[-1], atol=1e-9)


def test_lagrange_predictors_of_orders_one_to_five(curve):
    def stepped(predictor, corrector="pseudo-arclength"):
        found = frequency_response(
            duffing(),
            force=[0.18],
            omega=(0.5, 1.6),
            harmonics=7,
            predictor=predictor,
            corrector=corrector,
            max_step=0.05,
            stability=False,
        )
        assert found.status == "converged"
        assert [e.omega for e in found.events] == pytest.approx([e.omega for e in curve.events], abs=1e-10)
        return found

    orders = [stepped(f"lagrange{order}") for order in range(1, 6)]
    assert np.array_equal(orders[2].omega, stepped("lagrange").omega)
    # the order 1 is the secant, and every other one goes a way of its own
    assert np.allclose(orders[0].omega, stepped("secant").omega, rtol=1e-12)
    assert len({tuple(one.omega) for one in orders}) == 5
    # equal steps: a better guess needs fewer corrections
    per_point = [one.stats.counts["corrections"] / len(one) for one in orders]
    assert min(per_point[1:]) < per_point[0]
    with pytest.raises(ModelError, match=r"there is no predictor 'lagrange6'.*\"lagrange5\""):
        stepped("lagrange6")


def test_downward_sweep_meets_the_same_folds(curve):
    down = frequency_response(duffing(), force=[0.18], omega=(1.6, 0.5), harmonics=7)
    assert [event.omega for event in down.events] == pytest.approx(
        [event.omega for event in curve.events][::-1], abs=1e-10
    )
    assert down.omega[0] == 1.6 and down.omega[-1] == 0.5


def test_hertz_and_work_counts():
    a = frequency_response(duffing(), force=[0.18], frequency=(0.5 / 2 / np.pi, 1.6 / 2 / np.pi), stability=False)
    b, c = (frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), stability=False) for _ in range(2))
    assert np.allclose(a.omega, b.omega, rtol=1e-12) and b.stats.counts == c.stats.counts
    assert b.stats.counts["corrections"] < 5 * len(b)
    assert a.frequency[0] == pytest.approx(0.5 / 2 / np.pi)
    assert a.stable is None and a.exponents is None and a.stats.counts["monodromies"] == 0


def test_a_fold_is_closed_in_by_few_corrections():
    given = dict(force=[0.18], omega=(0.5, 1.6), harmonics=7, stability=False)
    found, plain = (frequency_response(duffing(), events=events, **given) for events in (True, False))
    more = found.stats.counts["corrections"] - plain.stats.counts["corrections"]
    print(f"{len(found.events)} folds by {more} corrections")
    assert len(found.events) == 2 and len(found) == len(plain) and more <= 30


def test_multipliers_equal_shooting(curve):
    for i in (0, len(curve) // 3, len(curve) // 2, len(curve) - 1):
        one = curve.point(i)
        state = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
        state, phi = hbm_shooting.shoot(duffing(), [0.18], one.omega, state)
        assert state[0] == pytest.approx(one.displacement(0.0)[0, 0], abs=3e-7)
        expected = np.sort_complex(np.linalg.eigvals(phi))
        found = np.sort_complex(np.exp(curve.exponents[i] * one.period))
        assert np.max(np.abs(found - expected)) < 1e-6


def test_neimark_sacker_points_are_crossings_of_the_shooting_multipliers():
    system = two_mass_cubic()
    response = frequency_response(system, force=[0.11, 0.0], omega=(0.8, 1.4), harmonics=9)
    found = [event for event in response.events if event.kind == "neimark-sacker"]
    assert response.status == "converged" and len(found) == 2
    for event in found:
        one = harmonic_balance(system, force=[0.11, 0.0], omega=event.omega, harmonics=9, x0=event.X)
        state = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
        _, phi = hbm_shooting.shoot(system, [0.11, 0.0], event.omega, state)
        mu = np.linalg.eigvals(phi)
        largest = mu[np.argmax(np.abs(mu))]
        print("Neimark-Sacker at", event.omega, "| |mu| - 1 of shooting:", abs(largest) - 1)
        assert abs(abs(largest) - 1) < 1e-5 and abs(largest.imag) > 0.01
        assert event.exponent.real == pytest.approx(0, abs=1e-9)
        # the second frequency is how fast the perturbation turns, up to whole periods
        turn = abs(np.angle(largest)) * event.omega / (2 * np.pi)
        assert event.second_frequency == pytest.approx(turn, rel=1e-4)
    assert {e.second_frequency for e in response.events if e.kind != "neimark-sacker"} <= {None}


def test_what_leaves_a_neimark_sacker_point_is_refused_with_its_frequency():
    branch = Branch(two_mass_cubic(), force=[0.11, 0.0], omega=(0.8, 1.4), harmonics=9)
    while not (found := [e for e in branch.events if e.kind == "neimark-sacker"]):
        branch.run(20)
    with pytest.raises(ModelError, match=f"{found[0].second_frequency:.6g} rad/s.*mb.quasi_periodic finds it"):
        branch.switch(found[0])


def test_hill_and_monodromy_agree():
    from mbrs.nonlinear import balance

    system = two_mass_cubic()
    one = harmonic_balance(system, force=[0.11, 0.0], omega=1.0, harmonics=15)
    setup = balance.prepare(system, [0.11, 0.0], Fourier(15))
    told = setup.core.floquet(setup.start(one), [1.0], monodromy=True)
    by_hill = np.sort_complex(np.exp(told["exponents"] * one.period))
    assert np.max(np.abs(by_hill - np.sort_complex(np.linalg.eigvals(told["monodromy"])))) < 1e-7


@pytest.mark.parametrize("name", ["duffing", "two masses", "van der Pol spring"])
def test_stability_along_a_branch_is_that_of_hill(name):
    # the monodromy matrix takes over where it agrees with Hill's problem at the first point; here Hill's is solved at others
    from mbrs.nonlinear import balance

    system, force, span = {
        "duffing": (duffing(), [0.18], (0.5, 1.6)),
        "two masses": (two_mass_cubic(), [0.11, 0.0], (0.8, 1.4)),
        "van der Pol spring": (
            MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[Cubic(0.1, w=[1.0]), VanDerPol(0.3, w=[1.0])]),
            [0.18],
            (0.5, 1.6),
        ),
    }[name]
    response = frequency_response(system, force=force, omega=span, harmonics=11)
    assert response.stats.counts["monodromies"] >= len(response) - 1
    worst = 0.0
    for i in range(0, len(response), 7):
        one = response.point(i)
        setup = balance.prepare(system, force, Fourier(11), one.omega)
        hill = setup.core.floquet(setup.start(one), [one.omega])
        theirs = np.exp(hill["exponents"] * one.period)
        ours = np.exp(response.exponents[i] * one.period)
        worst = max(worst, float(np.max(np.min(np.abs(ours[:, None] - theirs), axis=1))))
        # H = 11 leaves a truncation in Hill's roots, as large as the trace lets pass
    print(f"{name}: multipliers differ from those of Hill's problem by {worst:.1e}")
    assert worst < 2e-6


def test_mathieu_tongue_is_bounded_by_period_doubling():
    # x" + c x' + (1 + e cos(w t)) x = 0 loses stability near w = 2 by period doubling; first order: w = 2 +-
    # sqrt(e^2/4 - c^2)
    e, c = 0.02, 0.002
    system = MechanicalSystem([[1.0]], [[c]], [[1.0]], elements=[VaryingStiffness(e, w=[1.0])])
    response = frequency_response(system, force={0: [1e-3]}, omega=(1.8, 2.2), harmonics=5, max_step=0.02)
    found = [event for event in response.events if event.kind == "period-doubling"]
    expected = 2 + np.array([-1, 1]) * np.sqrt(e**2 / 4 - c**2)
    assert [event.omega for event in found] == pytest.approx(expected, abs=2e-4)
    for event in found:
        _, phi = hbm_shooting.flow(system, {0: [1e-3]}, event.omega, np.zeros(2), 2 * np.pi / event.omega)
        assert np.min(np.abs(np.linalg.eigvals(phi) + 1)) < 1e-6


def test_branch_point_of_a_symmetric_system():
    # two equal masses with cubic springs, driven in phase: the in-phase motion loses its symmetry
    system = MechanicalSystem(
        np.eye(2),
        0.02 * np.eye(2),
        [[0.9, 0.1], [0.1, 0.9]],
        elements=[Cubic(1.0, w=[1.0, 0.0]), Cubic(1.0, w=[0.0, 1.0])],
    )
    response = frequency_response(system, force=[0.2, 0.2], omega=(0.6, 2.2), harmonics=5)
    points = [event for event in response.events if event.kind == "branch-point"]
    assert points and np.allclose(response.X[:, 0], response.X[:, 1], atol=1e-7)
    for event in points:
        state = np.zeros(4)
        one = harmonic_balance(system, force=[0.2, 0.2], omega=event.omega, harmonics=15, x0=event.X)
        state = np.concatenate([one.displacement(0.0)[:, 0], one.velocity(0.0)[:, 0]])
        _, phi = hbm_shooting.flow(system, [0.2, 0.2], event.omega, state, 2 * np.pi / event.omega)
        assert np.min(np.abs(np.linalg.eigvals(phi) - 1)) < 1e-3


def test_branch_switching():
    # the antisymmetric branch that leaves the in-phase motion of two equal masses; both sides are mirror images
    system = MechanicalSystem(
        np.eye(2),
        0.02 * np.eye(2),
        [[0.9, 0.1], [0.1, 0.9]],
        elements=[Cubic(1.0, w=[1.0, 0.0]), Cubic(1.0, w=[0.0, 1.0])],
    )
    branch = Branch(system, force=[0.2, 0.2], omega=(0.6, 2.2), harmonics=5, stability=False)
    branch.run(1000)
    event = next(e for e in branch.chunks.events if e.kind == "branch-point")
    sides = []
    for side in (1, -1):
        other = branch.switch(event, side=side)
        assert other.run(15) == 15
        point = other.point(14)
        assert np.max(np.abs(point.X[0] - point.X[1])) > 0.05  # the masses move apart
        sides.append(point)
        one = harmonic_balance(system, force=[0.2, 0.2], omega=point.omega, harmonics=5, x0=point.X)
        assert np.allclose(one.X, point.X, atol=1e-8)
    again = harmonic_balance(system, force=[0.2, 0.2], omega=sides[0].omega, harmonics=5, x0=sides[0].X[::-1])
    assert np.allclose(again.X[::-1], sides[0].X, atol=1e-8)
    with pytest.raises(ModelError, match="branch points only"):
        branch.switch(replace(event, kind="fold"))


def test_force_level_as_parameter():
    # at omega = 1.2 the force-response of the hardening oscillator is S-shaped: two folds in the level
    response = frequency_response(duffing(), force=[1.0], omega=1.2, level=(0.01, 0.6), harmonics=7)
    assert response.status == "converged" and [event.kind for event in response.events] == ["fold", "fold"]
    assert response.level[-1] == 0.6 and np.all(response.omega == 1.2)
    one = response.point(len(response) // 2)
    assert one.verify() < 1e-5
    i = np.argmin(np.abs(response.level - 0.18))
    again = harmonic_balance(duffing(), force=[response.level[i]], omega=1.2, harmonics=7, x0=one.X * 0 + response.X[i])
    assert np.allclose(again.X, response.X[i], atol=1e-9)


def test_a_set_of_frequencies():
    w = [0.5, 0.8, 0.9, 1.0, 1.5]
    response = frequency_response(duffing(), force=[0.18], omega=w, harmonics=7)
    assert response.omega.tolist() == w
    expected = [0.23850991, 0.47487205, 0.75793394, 1.30534547, 0.14391972]  # docs/theory.md (23.5)
    assert response.amplitude()[:4] == pytest.approx(expected[:4], abs=5e-9)
    assert response.stable.all()


def test_automatic_harmonics_keep_the_error_below_the_tolerance():
    system = duffing(1.0)
    response = frequency_response(system, force=[0.3], omega=(0.2, 3.0), harmonics="auto", tol=1e-6)
    assert response.status == "converged" and np.max(response.error) <= 1e-6
    assert response.omega[0] == 0.2 and response.omega[-1] == 3.0
    folds = [event.omega for event in response.events if event.kind == "fold" and event.omega > 1.3]
    assert max(folds) == pytest.approx(2.3996492588, abs=1e-6)
    one = harmonic_balance(system, force=[0.3], omega=0.4, harmonics="auto", tol=1e-8)
    assert one.error <= 1e-8 and one.verify() < 1e-7


def test_iterator_and_resume():
    branch = Branch(duffing(), force=[0.18], omega=(0.5, 1.6))
    first, second = next(branch), next(branch)
    assert first.omega == 0.5 and second.omega > 0.5 and first.X.shape == (1, 15) and first.stable == 1.0
    assert sum(1 for _ in branch) > 50 and branch.status == "converged"
    whole = frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6))
    part = frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), max_points=20)
    assert part.status == "max-points" and len(part) == 20
    full = part.resume()
    assert full.status == "converged" and np.array_equal(full.omega, whole.omega)


def test_result_reads_saves_plots(curve, tmp_path, capsys):
    twin = pickle.loads(curve.save(tmp_path / "curve.pkl").read_bytes())
    assert np.array_equal(twin.X, curve.X) and twin.events[0].omega == curve.events[0].omega
    assert twin.peak().amplitude() == pytest.approx(curve.peak().amplitude(), rel=1e-9)
    assert len(twin.resume()) == len(curve)  # it has ended
    assert "fold" in str(curve) and "the end of the range" in str(curve)
    data = curve.to_xarray()
    assert data.X.sel(coefficient="a1").shape == (len(curve), 1)
    import matplotlib

    matplotlib.use("Agg")
    assert len(curve.plot().axes[0].lines) == 3
    curve.plot(harmonic=None)
    frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), progress=True)
    line = capsys.readouterr().err
    assert "Hz" in line and "H 7" in line and "events" in line


def test_memory_laws_have_no_known_stability():
    system = MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[Jenkins(0.5, 0.2, w=[1.0])])
    response = frequency_response(system, force=[0.18], omega=(0.8, 1.6), harmonics=5)
    assert response.status == "converged" and np.all(np.isnan(response.stable))


def test_stick_slip_through_full_stick():
    # far from resonance the slider sticks and the system is linear with k + k_t; near it, it slips
    system = MechanicalSystem([[1.0]], [[0.02]], [[1.0]], elements=[Jenkins(0.5, 0.2, w=[1.0])])
    response = frequency_response(system, force=[0.05], omega=(0.6, 1.6), harmonics=9)
    stuck = 0.05 / np.abs(1.5 - response.omega**2 + 0.02j * response.omega)
    slipping = response.amplitude(harmonic=None) > 0.999 * 0.2 / 0.5
    assert response.status == "converged" and slipping.any() and not slipping.all()
    assert np.max(np.abs(response.amplitude()[~slipping] / stuck[~slipping] - 1)) < 1e-6
    assert np.all(response.amplitude()[slipping] < 1.0001 * stuck[slipping])


def test_light_damping_peak():
    # zeta = 1e-6 with a small cubic term: on the backbone, a = F / (c omega), omega^2 = 1 + 3/4 k3 a^2 at first order
    system = MechanicalSystem([[1.0]], [[2e-6]], [[1.0]], elements=[Cubic(1e-3, w=[1.0])])
    response = frequency_response(system, force=[2e-7], omega=(0.9999, 1.0001), harmonics=3)
    assert response.status == "converged"
    peak = response.peak()
    print("damping ratio 1e-6: peak", peak.amplitude(), "at", peak.omega)
    assert peak.amplitude() == pytest.approx(0.1, rel=1e-4) and peak.omega == pytest.approx(1 + 0.375e-5, abs=1e-8)


def test_imperfect_pitchfork_is_not_jumped_over():
    # force response of a buckled-like symmetric well with a static imperfection of 1e-6: the branch bends, it does not
    # branch
    system = MechanicalSystem([[1.0]], [[0.3]], [[-0.2]], elements=[Cubic(1.0, w=[1.0])])
    response = frequency_response(
        system, force={0: [1e-6], 1: [1.0]}, omega=2.0, level=(3.0, 0.5), harmonics=5, stability=False, max_step=0.05
    )
    assert response.status in ("converged", "left-at-start")
    assert not [event for event in response.events if event.kind == "branch-point"]
    assert np.max(np.abs(response.X[:, 0, 0])) > 0.1  # the motion left the symmetric one


def test_unilateral_spring():
    # docs/theory.md (23.8), third example of NLvib: stop stiffness 100, gap 1, H = 21, N = 1024
    K = np.array([[1.0, -1.0], [-1.0, 2.0]])
    system = MechanicalSystem(np.eye(2), 0.03 * K, K, elements=[Gap(100.0, 1.0, w=[1.0, 0.0])])
    response = frequency_response(
        system, force=[0.0, 0.1], omega=(0.3, 0.9), harmonics=21, n_samples=1024, stability=False, max_points=3000
    )
    assert response.status == "converged"
    top = response.amplitude(harmonic=None)
    assert top.max() > 1.0
    i = int(np.argmax(top))
    print("unilateral spring: error estimated", response.error[i], "integrated", response.point(i).verify())


def test_first_point_that_does_not_exist():
    free = MechanicalSystem([[1.0]], [[0.1]], [[0.0]])
    with pytest.raises(ConvergenceError, match="first point"):
        frequency_response(free, force={0: [1.0], 1: [1.0]}, omega=(0.5, 1.0))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (dict(omega=(0.5, 0.5)), "empty"),
        (dict(omega=(0.5, 1.0, 2.0)), "one range"),
        (dict(omega=1.0), "one range"),
        (dict(omega=(0.5, 1.0), level=(0.1, 1.0)), "one range"),
        (dict(omega=(0.5, 1.0), level=np.nan), "finite"),
        (dict(omega=(0.5, 1.0), level="x"), "level must"),
        (dict(omega=(0.5, -1.0)), "positive"),
        (dict(omega=(0.5, 1.0), predictor="x"), "no predictor"),
        (dict(omega=(0.5, 1.0), corrector="x"), "no corrector"),
        (dict(omega=(0.5, 1.0), step=-1.0), "step must be"),
        (dict(omega=(0.5, 1.0), step=1.0), "min_step <= step"),
        (dict(omega=(0.5, 1.0), harmonics="many"), '"auto"'),
        (dict(omega=(0.5, 1.0), max_points=0), "max_points"),
        (dict(omega=(0.5, 1.0), tol=0.0), "tol must be"),
        (dict(omega=[0.5, 1.0, np.nan]), "positive"),
        (dict(omega=[]), "positive"),
    ],
)
def test_bad_input(changes, text):
    with pytest.raises(ModelError, match=text):
        frequency_response(duffing(), force=[0.18], **changes)
