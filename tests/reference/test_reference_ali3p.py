"""The transcript of ALI3-P: order, values of docs/theory.md (23.12) and (23.13), tangent linear model against differences."""

import numpy as np
import pytest
from oracles.ali3p import Scheme, trapezoid
from oracles.ali3p_models import POINTS, FiveBar, NonholonomicPoint

# docs/theory.md (23.12) and (23.13): converged values, Runge-Kutta and DOP853 agree
FIVE_BAR_1 = (0.1144363742, np.array([-0.62560973, 0.47715465]))
POINT_5 = np.array([-0.85197359, 0.31079724, -0.49732820])
POINT_PSI = (3.89396846, np.array([-0.21521547, 0.02152155, 0.29491657]))


def five_bar_objective(motion, tangent, h):
    g = np.array([np.sum((i.q[2:4] - POINTS[1]) ** 2) for i in motion])
    dg = np.array([2 * (i.q[2:4] - POINTS[1]) @ d.q[2:4] for i, d in zip(motion, tangent, strict=True)])
    return trapezoid(g, h), trapezoid(dg, h)


def point_objective(motion, tangent, h):
    g = np.array([i.q @ i.q for i in motion])
    dg = np.array([2 * i.q @ d.q for i, d in zip(motion, tangent, strict=True)])
    return trapezoid(g, h), trapezoid(dg, h)


@pytest.mark.oracle
def test_five_bar_converges_to_the_known_gradient():
    errors = []
    for n in (50, 100, 200):
        psi, grad = five_bar_objective(*Scheme(FiveBar(), FiveBar.p, 1 / n).run_tangent(n), 1 / n)
        errors.append([abs(psi - FIVE_BAR_1[0]), np.abs(grad[:2] - FIVE_BAR_1[1]).max()])
        print(n, psi, grad[:2], errors[-1])
    ratio = np.divide(*np.array(errors)[-2:])
    print("ratios", ratio)
    assert np.all(np.abs(ratio - 4) < 0.3)  # second order
    assert np.all(np.array(errors)[-1] < [1e-4, 5e-4])


@pytest.mark.slow
@pytest.mark.oracle
@pytest.mark.parametrize(("h", "published"), [(1e-2, (-4.22937, 3.21102)), (5e-3, (-4.22895, 3.21146))])
def test_five_bar_repeats_the_published_digits(h, published):
    """The gradients over 5 s that docs/theory.md (23.12) gives for two steps, to their last digit."""
    n = round(5 / h)
    _, grad = five_bar_objective(*Scheme(FiveBar(), FiveBar.p, h).run_tangent(n), h)
    assert grad[:2] == pytest.approx(published, abs=6e-6)


@pytest.mark.oracle
def test_point_converges_to_the_known_gradient():
    errors = []
    for n in (400, 800):
        motion, tangent = Scheme(NonholonomicPoint(), NonholonomicPoint.p, 5 / n).run_tangent(n)
        psi, grad = point_objective(motion, tangent, 5 / n)
        errors.append(
            [np.abs(motion[-1].q - POINT_5).max(), abs(psi - POINT_PSI[0]), np.abs(grad - POINT_PSI[1]).max()]
        )
    ratio = np.divide(*np.array(errors))
    print(errors, "ratios", ratio)
    assert np.all(np.abs(ratio - 4) < 0.4)


@pytest.mark.some(1)
@pytest.mark.parametrize("weight", ["tangent", "mass"])
@pytest.mark.parametrize("h", [2e-2, 1e-3])
@pytest.mark.parametrize("mech", [NonholonomicPoint(), FiveBar()], ids=["point", "five-bar"])
def test_tangent_linear_model_is_the_derivative_of_the_discrete_solution(mech, h, weight):
    n, p = 8, mech.p
    motion, tangent = Scheme(mech, p, h, weight).run_tangent(n)
    end, d = motion[-1], tangent[-1]
    exact = np.concatenate([d.q, d.v, d.a, d.lam])

    def at(p):
        e = Scheme(mech, p, h, weight).run(n)[-1]
        return np.concatenate([e.q, e.v, e.a, e.lam])

    whole = np.array([at(p + 1j * 1e-40 * e).imag / 1e-40 for e in np.eye(len(p))]).T
    scale = np.concatenate([np.full_like(x, max(np.abs(x).max(), 1e-300)) for x in (d.q, d.v, d.a, d.lam)])
    complex_error = np.max(np.abs(exact - whole) / scale)
    differences = []
    for k, e in enumerate(np.eye(len(p))):
        s = 1e-3 * max(abs(p[k]), 1) * e
        slope = (8 * (at(p + s) - at(p - s)) - at(p + 2 * s) + at(p - 2 * s)) / (12 * s[k])
        differences.append(slope)
    difference_error = np.max(np.abs(exact - np.array(differences).T) / scale)
    print(f"h {h}: complex step {complex_error:.1e}, differences {difference_error:.1e}")
    B = mech.rows(end.t, end.q, p)
    velocity, acceleration = B @ end.v, B @ end.a + mech.bias(end.t, end.q, end.v, p)
    print("residuals", [np.abs(x).max(initial=0) for x in (mech.phi(end.t, end.q, p), velocity, acceleration)])
    assert complex_error < 1e-9
    assert difference_error < 1e-6
    assert np.abs(velocity).max() < 1e-12
    assert np.abs(acceleration).max() < 1e-11
    if mech.n_position:
        assert np.abs(mech.phi(end.t, end.q, p)).max() < 1e-12


def test_redundant_rows_change_nothing():
    class Doubled(FiveBar):
        n_position = 8

        def phi(self, t, q, p):
            one = super().phi(t, q, p)
            return np.concatenate([one, 2 * one])

        def rows(self, t, q, p):
            one = super().rows(t, q, p)
            return np.concatenate([one, 2 * one])

        def bias(self, t, q, v, p):
            one = super().bias(t, q, v, p)
            return np.concatenate([one, 2 * one])

    single, d1 = Scheme(FiveBar(), FiveBar.p, 0.01).run_tangent(30)
    double, d2 = Scheme(Doubled(), FiveBar.p, 0.01).run_tangent(30)
    error = np.abs(single[-1].q - double[-1].q).max(), np.abs(d1[-1].q - d2[-1].q).max()
    print("redundant", error)
    assert max(error) < 1e-9


def stepped(mech, p, h, n, **options):
    scheme = Scheme(mech, p, h, **options)
    last, steps = scheme.begin(), []
    for _ in range(n):
        steps.append(scheme.step(last))
        last = steps[-1].end
    return steps


@pytest.mark.parametrize("mech", [FiveBar(), NonholonomicPoint()], ids=["five-bar", "point"])
def test_the_penalty_decides_the_passes_and_not_the_motion(mech):
    """Each multiplier update leaves 1/(1 + alpha) of the residual: passes fall with the penalty, the motion stays."""
    runs = {alpha: stepped(mech, mech.p, 0.013, 6, penalty=alpha) for alpha in (1e2, 1e4, 1e7)}
    ends = [run[-1].end for run in runs.values()]
    passes = [sum(sum(step.passes) for step in run) for run in runs.values()]
    print(passes)
    assert passes[0] > passes[1] > passes[2]
    for end in ends[:-1]:
        for name in ("q", "v", "a"):
            assert getattr(end, name) == pytest.approx(getattr(ends[-1], name), abs=1e-9)


@pytest.mark.some(1)
@pytest.mark.parametrize("weight", ["tangent", "mass"])
def test_projections_remove_what_the_trapezoidal_rule_leaves(weight):
    """Before the projections the rows of velocities miss by an error of order 2, those of accelerations of order 1; then by rounding."""
    before = []
    for h in (0.02, 0.01, 0.005):
        steps = stepped(FiveBar(), FiveBar.p, h, round(0.4 / h), weight=weight)
        v, a = (np.array([step.residual[k] for step in steps]) for k in (0, 1))
        before.append([v[:, 0].max(), a[:, 0].max()])
        assert v[:, 1].max() < 1e-12 and a[:, 1].max() < 1e-10
        last = steps[-1]
        own = FiveBar().rows(0, last.end.q, FiveBar.p) @ last.v_star
        assert last.residual[0][0] == pytest.approx(np.abs(own).max(), rel=1e-12)
    ratio = np.divide(before[:-1], before[1:])
    print(before, ratio)
    assert ratio[-1] == pytest.approx([4.0, 2.0], rel=0.1)
