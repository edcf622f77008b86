"""Moments and indices against closed forms (Ishigami's function) and SALib."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
import sweep_scenes as scenes
from scipy import stats

A, B = 7.0, 0.1
RANGE = (-np.pi, np.pi)


def three():
    m = mb.Model("three numbers")
    for name in ("x1", "x2", "x3"):
        m.parameter(name, 0.0)
    return m


def ishigami(m):
    """sin x1 + A sin^2 x2 + B x3^4 sin x1, and its derivatives."""
    x, y, z = (m.value(f"x{i}") for i in (1, 2, 3))
    gradient = [(1 + B * z**4) * np.cos(x), 2 * A * np.sin(y) * np.cos(y), 4 * B * z**3 * np.sin(x)]
    return {"y": np.sin(x) + A * np.sin(y) ** 2 + B * z**4 * np.sin(x), "y_derivative": np.array(gradient)}


# Ishigami, Homma: An importance quantification technique in uncertainty analysis for computer models (1990)
V1, V2 = 0.5 * (1 + B * np.pi**4 / 5) ** 2, A**2 / 8
V13 = B**2 * np.pi**8 * (1 / 18 - 1 / 50)
V = V1 + V2 + V13
FIRST, TOTAL = np.array([V1, V2, 0.0]) / V, np.array([V1 + V13, V2, V13]) / V


@pytest.fixture(scope="module")
def runs():
    designs = mb.design.saltelli(dict.fromkeys(("x1", "x2", "x3"), RANGE), n=1024, seed=2)
    return mb.sweep(three(), designs, ishigami)


def test_sobol_indices_of_ishigami(runs):
    found = runs.sobol_indices("y")
    assert np.all(np.abs(found.first - FIRST) < 4 * found.first_error)
    assert np.all(np.abs(found.total - TOTAL) < 4 * found.total_error)
    assert found.first == pytest.approx(FIRST, abs=0.02) and found.total == pytest.approx(TOTAL, abs=0.02)
    assert np.all(found.first_error < 0.1) and "x1" in str(found)


def test_sobol_indices_equal_those_of_salib(runs):
    salib = pytest.importorskip("SALib.analyze.sobol")
    problem = {"num_vars": 3, "names": ["x1", "x2", "x3"], "bounds": [list(RANGE)] * 3}
    theirs = salib.analyze(problem, runs["y"], calc_second_order=False, num_resamples=100, seed=1)
    ours = runs.sobol_indices("y")
    # SALib takes the mean out over all rows, which moves its first-order estimate by its own sampling noise
    assert ours.total == pytest.approx(theirs["ST"], rel=1e-10)
    assert np.all(np.abs(ours.first - theirs["S1"]) < 0.2 * ours.first_error + 1e-10)
    # half of the width of a 95 % interval, from other resamplings
    assert 1.96 * ours.total_error == pytest.approx(theirs["ST_conf"], rel=0.35)


def test_failures_leave_whole_blocks_out():
    def fails(m):
        if m.value("x1") > 2.5:
            raise ValueError("too far")
        return {"y": m.value("x1") + 2.0 * m.value("x2")}

    designs = mb.design.saltelli({"x1": RANGE, "x2": RANGE}, n=64)
    found = mb.sweep(three(), designs, fails).sobol_indices("y")
    values = designs.values.reshape(64, 4, 2)
    assert found.used == int(np.sum(~np.any(values[:, :, 0] > 2.5, axis=1))) < 64


def test_derivative_measures_of_ishigami():
    designs = mb.design.sobol(dict.fromkeys(("x1", "x2", "x3"), RANGE), n=2048, seed=5)
    found = mb.sweep(three(), designs, ishigami).derivative_measures("y")
    # E((dy/dx_i)^2) over the cube, by integration of the formulas
    exact = np.array([0.5 * (1 + 2 * B * np.pi**4 / 5 + B**2 * np.pi**8 / 9), A**2 / 2, 8 * B**2 * np.pi**6 / 7])
    assert found.mean_square == pytest.approx(exact, rel=0.02)
    assert found.bound == pytest.approx(4.0 * exact / V, rel=0.03) and np.all(found.bound > TOTAL)


def test_measures_need_what_they_are_made_of(runs):
    plain = mb.sweep(three(), mb.design.latin_hypercube({"x1": RANGE}, 8), ishigami)
    with pytest.raises(mb.ModelError, match="saltelli"):
        plain.sobol_indices("y")
    with pytest.raises(mb.ModelError, match="by the numbers of the designs"):
        plain.derivative_measures("y")
    with pytest.raises(mb.ModelError, match="take 64 or 128"):
        mb.design.saltelli({"x1": RANGE}, 100)
    with pytest.raises(mb.ModelError, match="from 0 to 1"):
        runs.statistics([1.5])


def test_moments_of_a_linear_output_are_exact_to_first_order():
    """Statistics of the designs agree with those of the distribution, moments to first order with the closed form."""
    m = scenes.model()
    sd = {"k": 9.0, "b.mass": 0.02}
    designs = mb.design.normal({"k": 413.0, "b.mass": 1.7}, sd, 600, seed=3, correlation={("k", "b.mass"): -0.6})
    runs = mb.sweep(m, designs, mb.outputs.modes())
    found = runs.statistics(quantiles=[0.1, 0.9])
    assert found.entries == ("damping[0]", "frequency[0]") and found.units == ("1", "Hz")
    f = np.sqrt(413.0 / 1.7) / (2 * np.pi)
    by_k, by_m = 0.5 * f / 413.0, -0.5 * f / 1.7
    variance = (by_k * 9.0) ** 2 + (by_m * 0.02) ** 2 + 2 * by_k * by_m * -0.6 * 9.0 * 0.02
    assert found.linear_mean[1] == pytest.approx(f, rel=1e-11)
    assert found.linear_sd[1] == pytest.approx(np.sqrt(variance), rel=1e-9)
    values = runs["frequency[0]"]
    assert found.mean[1] == pytest.approx(values.mean(), rel=1e-14) and found.sd[1] == pytest.approx(values.std(ddof=1))
    # beside Monte Carlo: within five standard errors of the sample, the curvature being far smaller
    assert abs(found.mean[1] - f) < 5 * found.mean_error[1]
    assert found.sd[1] == pytest.approx(np.sqrt(variance), rel=5 / np.sqrt(2 * 600))
    low, high = f + np.sqrt(variance) * stats.norm.ppf([0.1, 0.9])
    assert found.quantile[1] == pytest.approx([low, high], abs=5 * 1.71 * np.sqrt(variance / 600))


def test_designs_know_the_moments_of_their_distribution():
    rng = np.random.default_rng(0)
    low, width = rng.normal(size=2), rng.uniform(1, 3, 2)
    ranges = {"a": (low[0], low[0] + width[0]), "b": stats.norm(low[1], width[1]), "c": stats.gamma(2.0)}
    for sampler in (mb.design.latin_hypercube, mb.design.sobol, mb.design.halton, mb.design.saltelli):
        designs = sampler(ranges, n=2048)
        about, values = designs.about, designs.values
        assert values.mean(axis=0) == pytest.approx(about["mean"], abs=0.05)
        assert values.var(axis=0) == pytest.approx(np.diag(about["covariance"]), rel=0.1)
        assert about["poincare"][:2] == pytest.approx([width[0] ** 2 / np.pi**2, width[1] ** 2])
        assert np.isnan(about["poincare"][2])
