"""What a gradient says of itself: error, growth, starts that it cannot follow, times, names of what it is asked for."""

import pickle
import warnings

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import MbrsWarning, ModelError, NotDifferentiableError
from mbrs.examples import five_bar
from motion_models import silent
from test_gradient import FIVE_BAR, LENGTHS, drift, worst
from test_gradient_hard import double_pendulum
from test_objectives import oscillator, x

X = mb.Final(x)


@pytest.mark.some(2)
@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_the_estimated_error_is_the_error(scheme, method):
    """Against the converged gradient of docs/theory.md (23.12), relative to the largest effect."""
    for step in (0.02, 0.005):
        g = mb.gradient(silent(five_bar), mb.Integral(drift), LENGTHS, t=1.0, step=step, scheme=scheme, method=method)
        off = np.abs((np.asarray(g.gradient) - FIVE_BAR[1.0][1]) * g.where).max()
        true = off / np.abs(np.asarray(g.gradient) * g.where).max()
        print(f"{scheme}, {method}, step {step}: error {true:.2e}, estimated {g.error:.2e}")
        assert 0.5 * true < g.error < 2.0 * true


def test_the_estimate_keeps_given_times_and_travels():
    m = oscillator()
    g = mb.gradient(m, mb.AtTimes([0.13, 0.37], lambda s: (s.index + 1) * x(s)), "rail.k", t=0.5, step=0.02)
    assert 0.0 < g.error < 1e-2
    assert pickle.loads(pickle.dumps(g)).error == g.error
    other = mb.gradient(m, X, "rail.k", t=0.5, step=0.02)
    assert pickle.loads(pickle.dumps(other)).error is None
    m.set({"rail.c": 2.0})
    assert other.error is None
    assert mb.gradient(m, X, "rail.k", t=0.5, step=0.5).error is None


@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_chaos_is_said(method):
    m = silent(double_pendulum)
    psi = mb.Final(lambda s: s.position("b")[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        short = mb.gradient(m, psi, "a.mass", t=1.0, step=0.01, method=method)
    with pytest.warns(MbrsWarning, match=r"amplifies relative changes of the parameters .* times: .* chaotic"):
        long = mb.gradient(m, psi, "a.mass", t=20.0, step=0.01, method=method)
    print(
        f"growth over 1 s {short.growth:.2e}, over 20 s {long.growth:.2e}; errors {short.error:.1e}, {long.error:.1e}"
    )
    assert short.growth < 10 < 1e4 < long.growth
    assert short.error < 1e-2 < 0.3 < long.error
    with pytest.warns(MbrsWarning, match="chaotic"):
        mb.simulate(m, t=20.0, step=0.01, method="ali3p", parameters="a.mass").sensitivity("b.position")


def test_the_best_fit_is_not_called_chaotic():
    """A sum of squares that is nearly zero has small numbers everywhere."""
    m, at = oscillator(), [0.1, 0.2, 0.3]
    data = [mb.gradient(m, mb.AtTimes([t], x), "rail.k", t=0.3, step=0.01).value for t in at]
    psi = mb.AtTimes(at, lambda s: (x(s) - data[s.index] * (1 + 1e-9)) ** 2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert mb.gradient(m, psi, ["rail.k", "p.mass"], t=0.3, step=0.01).growth < 100.0


def guessed(at=0.3):
    """A slider that starts off its drawn place by its first guess."""
    m = mb.Model("guessed")
    place = m.parameter("place", at)
    p = m.body("p", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0), pose=((place, 0, 0), (1, 0, 0, 0)))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x", k=10.0)
    return m


@pytest.mark.parametrize("name", ["place", "p.at[0]"])
def test_a_start_that_follows_a_first_guess_has_no_derivative(name):
    with pytest.raises(NotDifferentiableError, match=r"moves the start through the first guess pose="):
        mb.gradient(guessed(), X, ["rail.k", name], t=0.2, step=0.02)
    traj = mb.simulate(guessed(), t=0.2, step=0.02, method="ali3p", parameters=[name])
    with pytest.raises(NotDifferentiableError, match="pose="):
        traj.sensitivity("p.position")


@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_numbers_that_leave_the_guess_alone_have_one(method):
    found = mb.gradient(guessed(), X, ["rail.k", "p.mass"], t=0.2, step=0.02, method=method).gradient
    for i, (name, now) in enumerate((("rail.k", 10.0), ("p.mass", 1.0))):
        ends = []
        for side in (1, -1):
            m = guessed()
            m.set({name: now * (1 + side * 1e-4)})
            ends.append(mb.gradient(m, X, name, t=0.2, step=0.02).value)
        assert found[i] == pytest.approx((ends[0] - ends[1]) / (2e-4 * now), rel=1e-6)
    # from the same place as a state, the rest is differentiated, and the place is held
    m = guessed()
    start = mb.simulate(m, t=0.02, step=0.02, method="ali3p").state(0.0)
    held = mb.gradient(m, X, ["rail.k", "p.mass"], t=0.2, step=0.02, at=start, method=method).gradient
    assert np.allclose(held, found, rtol=1e-9)


def test_times_that_are_the_end_to_rounding():
    m, times = oscillator(), np.arange(1, 4) * 0.1  # 0.30000000000000004
    assert times[-1] > 0.3
    g = mb.gradient(m, mb.AtTimes(times, x), "rail.k", t=0.3, step=0.01)
    assert g.t[-1] == 0.3
    assert len(g.t) == 31
    with pytest.raises(ModelError, match="outside the motion"):
        mb.gradient(m, mb.AtTimes([0.3 + 1e-9], x), "rail.k", t=0.3, step=0.01)


@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_times_beside_a_break_make_no_step_of_rounding(scheme):
    m = oscillator()
    m.force("late", "p", at=(0, 0, 0), value=(mb.Ramp(6.0, start=0.1 + 1e-16), 0, 0))
    found = [
        mb.gradient(m, mb.AtTimes([t], lambda s: s.acceleration("p")[0]), "rail.k", t=0.3, step=0.01, scheme=scheme)
        for t in (0.1, 0.1 + 1e-9)
    ]
    assert np.diff(found[0].t).min() > 1e-3
    assert found[0].value == pytest.approx(found[1].value, rel=1e-6)
    with pytest.raises(ModelError, match="cannot be told apart"):
        mb.gradient(m, mb.AtTimes([0.1, 0.1 + 1e-15], x), "rail.k", t=0.3, step=0.01, scheme=scheme)
    chosen = mb.gradient(m, mb.AtTimes([0.1, 0.2], x), "rail.k", t=0.3, rtol=1e-5, scheme=scheme)
    assert {0.1, 0.2, 0.3} <= set(chosen.t)
    d = np.diff(chosen.t)
    assert (d[1:] / d[:-1]).min() > 5e-3


def test_objectives_need_not_be_defined_at_the_start():
    """At t = 0, where they are not evaluated."""
    m = oscillator()
    final = mb.gradient(m, mb.Final(lambda s: x(s) / s.t + np.log(s.t)), "rail.k", t=0.5, step=0.01)
    plain = mb.gradient(m, X, "rail.k", t=0.5, step=0.01)
    assert final.gradient[0] == pytest.approx(2.0 * plain.gradient[0], rel=1e-12)
    seen = []
    mb.gradient(
        m, mb.AtTimes([0.2, 0.4], lambda s: seen.append((s.t, s.index)) or x(s) / s.t), "rail.k", t=0.5, step=0.01
    )
    assert {t for t, _ in seen} == {0.2, 0.4}


BAD = [
    lambda m: mb.gradient(m, X, 3, t=0.1, step=0.01),
    lambda m: mb.gradient(m, X, None, t=0.1, step=0.01),
    lambda m: mb.gradient(m, X, "rail.k", t=0.1, step=0.01, keep="x"),
    lambda m: mb.gradient(m, X, "rail.k", t=0.1, step=0.01, keep=np.nan),
    lambda m: mb.gradient(m, X, "rail.k", t=0.1, step=0.01, keep=-1),
    lambda m: mb.gradient(m, mb.Final(lambda s: s.point(("x", 0, 0), of="p")[0]), "rail.k", t=0.1, step=0.01),
    lambda m: mb.check_gradients(3, m, ["rail.k"]),
]


@pytest.mark.parametrize("call", BAD, ids=range(len(BAD)))
def test_arguments_of_wrong_types(call):
    with pytest.raises(ModelError):
        call(oscillator())


@pytest.fixture(scope="module")
def planar():
    m = mb.Model("planar")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1, 0, 0), angular_velocity=(0, 0, 0.3))
    m.planar("table", m.ground, b, at=(0, 0, 0), axis="z", k=(1, 1, 1))
    return mb.simulate(m, t=0.3, step=0.1, method="ali3p", parameters=["b.mass", "table.k[2]"])


def test_coordinates_of_joints_have_their_own_names(planar):
    assert "table rz" in planar.sensitivity_table("table")
    d = planar.to_xarray(sensitivity=["table", "b.position", "table.reaction"])
    assert d["d table"].sel({"table component": "rz"}).values.tolist() == planar.sensitivity("table")[:, 2].tolist()
    assert d["d b.position"].dims == ("time", "axis", "parameter")
    assert d["table.reaction component"].values.tolist() == ["x", "y", "z", "rx", "ry", "rz"]
    names = [t.get_text() for t in planar.plot("sensitivity", of="table").axes[0].get_legend().get_texts()]
    assert names == ["x", "y", "rz"]


@pytest.mark.parametrize("t", [np.nan, 99.0, "x"])
def test_times_that_are_no_outputs(planar, t):
    with pytest.raises(ModelError):
        planar.state(t)
    with pytest.raises(ModelError):
        planar.sensitivity_table("table", t=t)


@pytest.mark.parametrize("what", [3, None, ["table"]])
def test_quantities_of_wrong_types(planar, what):
    with pytest.raises(ModelError, match="a quantity is named like"):
        planar.sensitivity(what)


def test_the_five_bar_over_five_seconds():
    """docs/theory.md (23.12): psi, its gradient, and what extrapolation in the step leaves."""
    known, runs = np.array([0.7268774613, -4.22881085, 3.21160410]), []
    for h in (5e-3, 2.5e-3):
        g = mb.gradient(silent(five_bar), mb.Integral(drift), LENGTHS, t=5.0, step=h)
        runs.append(np.array([g.value, *g.gradient]))
    ratio, left = (runs[0] - known) / (runs[1] - known), (4 * runs[1] - runs[0]) / 3 - known
    print(f"errors fall by {ratio}, extrapolated {left}")
    # the value's own h^2 term is thirty times smaller than the gradient's, so that h^4 shows in its ratio
    assert np.all(np.abs(ratio[1:] - 4) < 0.05)
    assert np.all(np.abs(left) < [1e-7, 1e-6, 1e-6])


def test_the_five_bar_finds_its_natural_lengths():
    """docs/theory.md (23.12): static equilibrium as drawn, psi = 0."""
    m = silent(five_bar)
    best = mb.problem(
        m, mb.Integral(drift), LENGTHS, t=1.0, step=2e-2, bounds=dict.fromkeys(LENGTHS, (1.0, 4.0))
    ).solve("SLSQP", options={"ftol": 1e-14})
    print(best)
    assert best.status == "converged"
    assert best.value < 1e-10
    assert worst(best.x, [2.43192357, 1.84486889]) < 1e-5
