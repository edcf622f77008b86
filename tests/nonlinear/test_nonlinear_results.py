"""Results of the nonlinear analyses read, draw, save and resume; figures show what they claim to."""

from __future__ import annotations

import pickle
import warnings

import matplotlib
import mbrs as mb
import numpy as np
import pytest
from mbrs.examples import duffing, two_mass_cubic, van_der_pol

matplotlib.use("Agg")


PAIR = [dict(force=[-0.25j], omega=1.5), dict(force=[-0.25j], omega=1.5 * 2**0.5)]


@pytest.fixture(scope="module")
def curve():
    return mb.frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), harmonics=7)


@pytest.fixture(scope="module")
def absorber():
    return mb.frequency_response(two_mass_cubic(), force=[0.11, 0], omega=(0.8, 1.4))


@pytest.fixture(scope="module")
def rail():
    m = mb.Model("mass on a rail")
    b = m.body("mass", mass=2.0, inertia=(1e-2, 1e-2, 1e-2))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=8e3, c=8.0, law=mb.Cubic(4e7))
    return m, b


def vertices(line):
    x, y = line.get_data()
    keep = np.isfinite(x) & np.isfinite(y)
    return np.column_stack([np.asarray(x)[keep], np.asarray(y)[keep]])


def test_stable_and_unstable_parts_meet_at_the_folds(curve):
    lines = {line.get_label(): line for line in curve.plot().axes[0].lines}
    assert {"stable", "unstable", "fold"} == set(lines)
    assert lines["unstable"].get_linestyle() == "--" and lines["stable"].get_linestyle() == "-"
    folds = vertices(lines["fold"])
    # docs/theory.md (23.5); the range was given in omega, so that is what is shown
    assert np.allclose(folds[:, 0], [1.26960, 1.11570], atol=1e-5)
    for part in ("stable", "unstable"):
        assert all(np.min(np.linalg.norm(vertices(lines[part]) - fold, axis=1)) < 1e-14 for fold in folds)
    inner = curve.omega[~curve.stable], curve.amplitude()[~curve.stable]
    drawn = {tuple(v) for v in vertices(lines["unstable"])}
    assert set(zip(*inner, strict=True)) < drawn and len(drawn) == len(inner[0]) + 2
    assert not set(zip(*inner, strict=True)) & {tuple(v) for v in vertices(lines["stable"])}


def test_every_kind_of_event_has_its_mark(absorber):
    names = [text.get_text() for text in absorber.plot("mass").axes[0].get_legend().get_texts()]
    assert names == ["stable", "unstable", "fold", "Neimark-Sacker"]


def test_unknown_stability_is_not_drawn_as_stable():
    friction = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Jenkins(0.5, 0.2, w=[1.0])])
    found = mb.frequency_response(friction, force=[0.18], omega=(0.8, 1.6), harmonics=5)
    assert not [line for line in found.plot().axes[0].lines if line.get_label() in ("stable", "unstable")]
    assert "unstable" not in str(found)
    with pytest.raises(mb.errors.ModelError, match="memory"):
        found.plot_multipliers()


def test_single_solutions_are_drawn_as_points():
    found = mb.frequency_response(duffing(), force=[0.18], omega=[0.6, 0.8, 1.0])
    (line,) = found.plot().axes[0].lines
    assert line.get_linestyle() == "None" and len(line.get_xdata()) == 3


def test_table_names_ends_peak_and_events(curve, absorber):
    text = str(curve)
    for word in ("the end of the range was reached", "first", "largest x0", "fold", "last", "1.269602", "1.115700"):
        assert word in text
    assert "neimark-sacker" in str(absorber) and "|absorber|" in str(absorber)
    assert "<table" in curve._repr_html_()


def test_peak_row_is_the_largest_point(curve):
    heads, rows = curve.rows()
    row = next(r for r in rows if str(r[1]).startswith("largest"))
    assert row[heads.index("|x0|")] == curve.amplitude().max()


def test_coordinates_by_name_and_their_errors(absorber):
    assert np.array_equal(absorber.amplitude("absorber"), absorber.amplitude(1))
    with pytest.raises(mb.errors.NameNotFoundError, match="did you mean 'absorber'"):
        absorber.amplitude("absorbr")
    with pytest.raises(mb.errors.ModelError, match="no coordinate 2"):
        absorber.amplitude(2)
    with pytest.raises(mb.errors.ModelError, match="dof must be"):
        absorber.amplitude(1.5)
    with pytest.raises(mb.errors.ModelError, match="harmonic must be"):
        absorber.amplitude(0, -1)


def test_motion_of_a_body_is_a_displacement_too(rail):
    m, b = rail
    found = mb.frequency_response(m, inputs=b.force("x"), amplitude=20.0, frequency=(1, 40), harmonics=5)
    # the coordinate of the rail is the motion of the body along x
    assert np.allclose(found.amplitude(b.motion("x")), found.amplitude("rail"), rtol=1e-12)
    assert np.allclose(found.amplitude("mass.motion.-x"), found.amplitude(0), rtol=1e-12)
    assert np.all(found.amplitude("mass.motion.y") == 0)
    one = mb.harmonic_balance(m, inputs=b.force("x"), amplitude=20.0, frequency=10.0)
    x = one.displacement(0.01, "mass.motion.x")
    assert x.shape == (1,) and x[0] == pytest.approx(one.displacement(0.01)[0, 0])


def test_bars_are_the_harmonics(curve):
    one = curve.point(40)
    bars = {round(p.get_x() + 0.35): p.get_height() for p in one.plot().axes[0].patches}
    assert set(bars) == {1, 3, 5, 7} and bars[3] == one.amplitude(0, 3)


def test_orbit_is_the_motion(curve):
    one = curve.point(40)
    time, phase = one.plot_orbit().axes
    t, x = time.lines[0].get_data()
    assert np.array_equal(x, one.displacement(t)[0]) and t[-1] == one.period
    assert np.array_equal(phase.lines[0].get_ydata(), one.velocity(t)[0])


def test_spectrum_names_the_largest_lines():
    qp = mb.quasi_periodic(duffing(1.5, 0.1), PAIR, harmonics=7)
    figure = qp.plot()
    names = [text.get_text() for text in figure.axes[0].texts]
    assert {"(1, 0)", "(0, 1)", "(2, -1)"} <= set(names)
    f, size, index = qp.lines()
    i = index.index("(2, -1)")
    assert f[i] == pytest.approx(1.5 * (2 - 2**0.5) / (2 * np.pi)) and size[i] == qp.amplitude(0, (2, -1))
    assert len(qp.plot_orbit().axes) == 2 and "(2, -1)" in str(qp)
    with pytest.raises(mb.errors.ModelError, match="index must be 2 integers"):
        qp.amplitude(0, (1, 0, 0))


def test_multipliers_leave_the_circle_where_the_branch_is_unstable(absorber):
    outside = np.any(np.abs(absorber.multipliers) > 1 + 1e-9, axis=1)
    assert np.array_equal(outside, ~absorber.stable)
    figure = absorber.plot_multipliers()
    red = next(line for line in figure.axes[0].lines if line.get_label() == "outside")
    assert len(red.get_xdata()) == np.sum(np.abs(absorber.multipliers) > 1 + 1e-7)


def test_limit_cycle_has_a_multiplier_one():
    cycle = mb.limit_cycle(van_der_pol(), harmonics=31)
    assert np.min(np.abs(cycle.multipliers - 1)) < 1e-6 and "period 6.66328" in str(cycle) and "stable" in str(cycle)
    assert cycle.plot_multipliers().axes


def test_branches_of_tori_and_parameters_draw_their_folds():
    branch = mb.quasi_periodic_response(duffing(1.5, 0.1), PAIR, scale=(1.2, 0.8), harmonics=3)
    lines = branch.plot().axes[0].lines
    assert len(lines) == 4 and len(lines[1].get_xdata()) == len(branch.folds) > 0
    assert branch.to_xarray().X.shape == branch.X.shape and "fold" in str(branch)
    level = mb.quasi_periodic_response(duffing(1.5, 0.1), PAIR, level=(0.1, 1.0), harmonics=3)
    assert level.plot().axes[0].get_xlabel() == "force level"
    family = mb.parameter_response(duffing, value=(0.01, 0.3), force=[0.18], omega=1.3, x0=None)
    assert family.plot().axes and family.to_xarray().value.shape == (len(family),) and "parameter" not in str(family.X)


def test_labelled_data_hold_events_and_multipliers(curve):
    data = curve.to_xarray()
    assert list(data.event_kind.values) == ["fold", "fold"] and data.attrs["status"] == "converged"
    assert np.array_equal(data.multiplier.values, curve.multipliers) and data.omega.attrs["units"] == "rad/s"


def test_pickled_curve_draws_again(curve, tmp_path):
    twin = pickle.loads(curve.save(tmp_path / "curve.pkl").read_bytes())
    assert str(twin) == str(curve) and len(twin.plot().axes[0].lines) == 3


def test_cut_branch_says_so_and_goes_on():
    cut = mb.frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), max_points=20)
    assert cut.status == "max-points" and "resume" in str(cut) and len(cut) == 20
    whole = cut.resume()
    assert whole.status == "converged" and np.array_equal(whole.omega[:20], cut.omega) and len(whole.events) == 2


def test_branch_that_cannot_go_on_keeps_its_points():
    class Breaks:
        def __call__(self, t, u, v):
            return np.where(np.max(np.abs(u)) > 1.0, np.nan, 0.1) * u**3

    system = mb.MechanicalSystem(
        [[1.0]], [[0.05]], [[1.0]], elements=[mb.FunctionLaw(Breaks(), lambda t, u, v: (0.3 * u**2, 0 * u), w=[1.0])]
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = mb.frequency_response(system, force=[0.18], omega=(0.5, 1.6))
    assert found.status.startswith("stopped") and len(found) > 10
    assert found.amplitude().max() < 1.01 and "points so far are kept" in str(found)
    assert found.plot().axes


def test_progress_line(capsys):
    mb.frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), progress=True)
    line = capsys.readouterr().err
    for word in ("Hz", "|X|", "H 7", "step", "events"):
        assert word in line
    mb.frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), progress=False)
    assert capsys.readouterr().err == ""


def test_rest_has_nothing_to_draw():
    rest = mb.harmonic_balance(duffing(), force=[0.0], omega=1.0)
    for draw in (rest.plot, rest.plot_spectrum):
        with pytest.raises(mb.errors.ModelError, match="does not move"):
            draw()


@pytest.mark.parametrize("harmonics", [7, 15, 31])
def test_largest_displacement_is_at_its_peak(harmonics):
    """Peak of the hard Duffing oscillator by shooting (docs/theory.md (23.6)); the series has converged to 1e-6 with seven."""
    curve = mb.frequency_response(
        duffing(1.0), force=[0.3], omega=(2.2, 2.5), harmonics=harmonics, stability=False, events=False
    )
    peak = curve.peak(harmonic=None)
    errors = abs(peak.largest() / 2.5645599332 - 1), abs(peak.omega / 2.3993334635 - 1)
    print(f"H = {harmonics}: height off by {errors[0]:.1e}, omega by {errors[1]:.1e}")
    assert max(errors) < (5e-6 if harmonics == 7 else 1e-9)


def test_largest_displacement_lies_above_every_sample():
    cycle = mb.limit_cycle(mb.examples.van_der_pol(5.0), harmonics=63)
    step = cycle.period / 2000
    coarse = step * np.arange(2001)
    near = coarse[np.argmax(np.abs(cycle.displacement(coarse)))] + np.linspace(-step, step, 2001)
    dense = np.max(np.abs(cycle.displacement(np.concatenate([coarse, near]))))
    assert 0 <= cycle.largest() - dense < 1e-8


@pytest.mark.parametrize("top", [50, 3000])
def test_largest_displacement_costs_exponentials_in_proportion_to_the_harmonics(top, monkeypatch):
    # sum_h cos(h phase) / h^2 has its maximum at zero, pi^2/6 but for the harmonics left out
    X = np.zeros((1, 2 * top + 1))
    X[0, 1::2] = 1.0 / np.arange(1, top + 1) ** 2
    system = mb.MechanicalSystem([[1.0]], None, [[1.0]])
    motion = mb.harmonic_balance(system, force=[0.1], omega=0.37, harmonics=3).replaced(X=X)
    sizes, plain = [], np.exp

    def counted(x, *args, **kwargs):
        sizes.append(np.size(x))
        return plain(x, *args, **kwargs)

    monkeypatch.setattr(np, "exp", counted)
    found = motion.largest()
    assert 0 < sum(sizes) <= 32 * (top + 1), sizes
    assert found == pytest.approx(np.sum(X[0, 1::2]), rel=1e-12)


def test_tables_show_what_is_driven_or_touched():
    """Of many coordinates those with a force or a nonlinear element, whatever the others do."""
    n = 60
    K = np.diag(np.full(n, 2.1)) - np.eye(n, k=1) - np.eye(n, k=-1)
    K[40, 40] = 0.3  # a soft one, which moves most
    e = np.eye(n)
    system = mb.MechanicalSystem(
        np.eye(n), 0.05 * np.eye(n), K + 2.0 * np.eye(n), elements=[mb.Cubic(0.1, w=e[7] - e[9])]
    )
    curve = mb.frequency_response(system, force=0.1 * e[12], omega=(0.5, 0.6), harmonics=3, max_points=4)
    heads, _ = curve.rows()
    assert {h for h in heads if h.startswith("|")} == {"|x7|", "|x9|", "|x12|"}
