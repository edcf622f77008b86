"""Models updated by measurements: truths that are known, covariance by differences, coverage of intervals, what data do not see."""

from __future__ import annotations

import warnings

import mbrs as mb
import numpy as np
import pytest
from hexapods import covered, hexapod, moved, noisy, transfer
from scipy.stats import binom

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
AXIS = np.array([0.36, -0.48, 0.8])


def sliders(k=(400.0, 900.0), c=(0.9, 1.7)):
    """Two masses in a row along an oblique axis."""
    m = mb.Model("sliders")
    a = m.body("a", mass=1.7, inertia=(1, 1, 1), at=(0.3, 0.1, -0.2))
    b = m.body("b", mass=0.9, inertia=(1, 1, 1), at=(0.9, -0.4, 0.6))
    m.prismatic("first", m.ground, a, at=(0, 0, 0), axis=AXIS, k=k[0], c=c[0])
    m.prismatic("second", a, b, at=(0, 0, 0), axis=AXIS, k=k[1], c=c[1])
    return m


NAMES = ["first.k", "first.c", "second.k", "b.mass"]


def measured(m, n=40):
    return mb.frf(m, m["a"].force(AXIS), [m["a"].motion(AXIS), m["b"].motion(AXIS)], frequency=np.linspace(0.7, 9.0, n))


def by_hand(values, omega):
    """H of `sliders` written out, displacements of both masses by a force on the first."""
    k1, c1, k2, m2 = values
    z1, z2 = k1 + 1j * c1 * omega, k2 + 1j * 1.7 * omega
    lower = z2 - m2 * omega**2
    det = (z1 + z2 - 1.7 * omega**2) * lower - z2**2
    return np.array([lower / det, z2 / det])[:, None]


def test_without_noise_the_truth_comes_back():
    m, names = hexapod()
    h = transfer(m, 30)
    true = moved(m, names, 3)
    fit = mb.update(m, h, names)
    assert fit.status == "converged"
    assert fit.x == pytest.approx(true, rel=1e-8)
    assert [m.value(n) for n in names] == fit.x.tolist()


def test_a_model_that_is_its_own_measurement_is_there_already():
    """Residuals are zero, and known to rounding: so are the parameters, without a warning of NumPy's."""
    m = sliders()
    h = measured(m)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        fit = mb.update(m, h, NAMES)
    assert fit.status == "converged" and fit.x.tolist() == fit.start.tolist()
    assert np.all(fit.sd < 1e-13 * fit.x) and np.all(fit.sd > 1e-18 * fit.x)


def test_covariance_and_noise_are_those_of_the_formula():
    """The model written out by hand, its Jacobian by complex steps, and the normal equations."""
    m = sliders()
    true = np.array([float(m.value(n)) for n in NAMES])
    test, sd = noisy(measured(m), 11, 0.02)
    moved(m, NAMES, 4)
    fit = mb.update(m, test, NAMES, noise={"frf": sd})
    w = test.omega

    def residual(p):
        miss = ((by_hand(p, w) - test.value) / sd[..., None]).ravel()
        return np.concatenate([miss.real, miss.imag])

    from scipy.optimize import least_squares

    best = least_squares(residual, true, x_scale=true, method="lm", xtol=1e-14, ftol=1e-14)
    assert fit.x == pytest.approx(best.x, rel=1e-6)
    steps = 1e-6 * true
    jac = np.array([(residual(fit.x + e) - residual(fit.x - e)) for e in np.diag(steps)]).T / (2.0 * steps)
    assert fit.covariance == pytest.approx(np.linalg.inv(jac.T @ jac), rel=1e-5)
    assert np.allclose(np.diff(fit.interval(0.95), axis=1)[:, 0], 2 * 1.959963985 * fit.sd, rtol=1e-8)
    assert np.abs((fit.x - true) / fit.sd).max() < 4.5

    again = mb.update(m, test, NAMES)
    assert again.freedom == 2 * test.value.size - 4
    miss = (by_hand(again.x, w) - test.value)[:, 0]
    spread = np.sqrt(np.sum(np.abs(miss) ** 2, axis=1) / (2 * len(w) * (1.0 - 4.0 / (2 * test.value.size))))
    assert again.noise == pytest.approx(spread, rel=1e-2)


@pytest.mark.slow
def test_intervals_of_twelve_parameters_cover_the_truth():
    """Twelve intervals each of some repetitions; benches/update_coverage.py runs 400 (94 to 96 % of 4,800)."""
    hits, total = covered(16)
    low, high = binom.ppf([1e-4, 1.0 - 1e-4], total, 0.95)
    print(hits, total)
    assert low <= hits <= high


def test_what_the_data_do_not_see_is_named():
    """Two springs side by side: their sum alone is seen."""
    m = sliders()
    k = m.parameter("twin", 240.0)
    m.spring_damper("beside", m.ground, "a", at=((0.3, 0.1, -0.2) - AXIS, (0.3, 0.1, -0.2)), k=k, c=0.0)
    test, _ = noisy(measured(m), 12, 0.01)
    sum_before = m.value("first.k") + 240.0
    fit = mb.update(m, test, ["first.k", "twin", "second.k"])
    assert fit.status == "unidentified"
    assert np.all(np.isinf(fit.sd[:2])) and np.isfinite(fit.sd[2])
    (text,) = fit.unseen
    assert text == "twin - 0.6 first.k (relative changes): not seen at all"
    assert fit.x[0] + fit.x[1] == pytest.approx(sum_before, rel=0.01)
    assert "not seen: twin" in str(fit)

    held = mb.update(m, test, ["first.k", "twin", "second.k"], prior={"twin": (240.0, 3.0)})
    assert held.x[1] == pytest.approx(240.0, abs=1e-3) and held.sd[1] == pytest.approx(3.0, rel=1e-6)
    assert held.status == "unidentified" and np.all(np.isfinite(held.sd))


def test_a_prior_weighs_as_much_as_its_width():
    """One frequency of an oscillator, f = sqrt(k/m)/2pi: the mean of two numbers by their variances, to first order."""
    m = mb.Model("one")
    p = m.body("p", mass=2.3, inertia=(1, 1, 1), at=(0.1, 0.2, 0.3))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis=AXIS, k=500.0, c=0.3)
    modes = mb.modes(m)
    truth = 500.0 * 1.0002**2
    test = mb.Measurement(
        node=np.array([7]), position=np.array([[0.1, 0.2, 0.3]]), node_name=("p",), lines=(), functions=(),
        eigenvalue=modes.eigenvalue * 1.0002, shape=np.r_[AXIS, 0, 0, 0].reshape(6, 1, 1).astype(complex),
    )  # fmt: skip
    fit = mb.update(m, test, "rail.k", data="frequency", noise=1e-4, prior={"rail.k": 0.2})
    from_data = 2.0 * 500.0 * 1e-4
    weight = (1 / from_data**2, 1 / 0.2**2)
    assert fit.x[0] == pytest.approx((weight[0] * truth + weight[1] * 500.0) / sum(weight), abs=2e-4)
    assert fit.sd[0] == pytest.approx(sum(weight) ** -0.5, rel=1e-3)
    alone = mb.update(m, test, "rail.k", data="frequency")
    assert alone.x[0] == pytest.approx(truth, rel=1e-8) and np.isinf(alone.sd[0]) and alone.freedom == 0


@pytest.mark.parametrize("data", ["frequency", ("frequency", "damping"), ("frequency", "shape"), "shape"])
def test_modes_from_a_universal_file(tmp_path, data):
    """Six digits in the file; frequencies and shapes see stiffnesses, damping ratios see dampers, shapes alone no common factor."""
    m, names = hexapod()
    chosen = [n for n in names if n[0] == "k" or "damping" in data]
    chosen = chosen[: {"frequency": 3, ("frequency", "damping"): 6}.get(data, 12)]
    if "damping" not in data:
        m.set({n: 0.0 for n in names if n[0] == "c"})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mb.modes(m).save(tmp_path / "modes.uff")
    test = mb.load(tmp_path / "modes.uff")
    true = moved(m, chosen, 8, 0.02)
    # a file has no rotations of complex shapes: three coordinates do not tell six modes apart
    fit = mb.update(m, test, chosen, data=data, partner=range(6) if "damping" in data else None)
    if data == "shape":
        assert fit.status == "unidentified" and len(fit.unseen) == 1
        assert np.all(np.isinf(fit.sd))
        assert fit.x / fit.x.mean() == pytest.approx(true / true.mean(), rel=1e-3)
    else:
        assert fit.x == pytest.approx(true, rel=3e-4)


def test_bounds_hold_and_designs_without_a_model_are_stepped_around():
    m = sliders()
    h = measured(m)
    m.set({"first.k": 420.0})
    fit = mb.update(m, h, ["first.k", "b.mass"], bounds={"first.k": (410.0, None)})
    assert fit.x[0] == 410.0 and fit.status == "converged"
    m.set({"b.mass": 0.8, "first.k": 400.0})
    fit = mb.update(m, h, ["b.mass", "first.c"], bounds={"first.c": (0.0, None)})
    assert fit.x == pytest.approx([0.9, 0.9], rel=1e-6)


@pytest.mark.slow
def test_the_page_and_the_pictures(tmp_path):
    m = sliders()
    test, _ = noisy(measured(m), 5)
    fit = mb.update(m, test, NAMES)
    page = fit.report(tmp_path / "fit.html").read_text()
    assert "first.k" in page and "Transfer functions" in page and "://" not in page.replace("http://www.w3.org", "")
    assert len(fit.plot().axes) == 1
    assert fit.to_xarray()["sd"].values.tolist() == fit.sd.tolist()


BAD = [
    ({"parameters": ["first.k", "first.k"]}, "named twice"),
    ({"parameters": "first.axis"}, "is a rotation"),
    ({"data": "colour"}, "data= takes some of frequency"),
    ({"data": "damping"}, "the measurement has no modes"),
    ({"data": ()}, "data= is empty"),
    ({"noise": {"shape": 1.0}}, "noise= names 'shape'"),
    ({"noise": -1.0}, "standard deviations above 0"),
    ({"noise": np.ones(7)}, "does not fit data"),
    ({"prior": {"first.k": -1.0}}, "takes a standard deviation above 0"),
    ({"prior": {"b.mass": 1.0}}, "not among the parameters"),
    ({"bounds": {"first.k": (500.0, None)}}, "not within its bounds"),
    ({"bounds": {"first.k": 3.0}}, r"are \(lower, upper\)"),
    ({"band": (20.0, 30.0)}, "nothing was measured from 20"),
    ({"partner": [0]}, "partner= takes"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "message"), BAD, ids=range(len(BAD)))
def test_wrong_updates_are_named(change, message):
    m = sliders()
    with pytest.raises(mb.errors.ModelError, match=message):
        mb.update(m, **{"test": measured(m, 5), "parameters": "first.k", **change})
