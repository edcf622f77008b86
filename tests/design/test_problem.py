"""Optimisation problems with constraints on motions and modes, each with a known optimum, and the check of gradients."""

import mbrs as mb
import numpy as np
import pytest
from mbrs.examples import five_bar
from motion_models import silent, spatial_loop


def oscillator():
    """m x" + c x' + k x = 0, x(0) = 0, x'(0) = v."""
    m = mb.Model("oscillator")
    p = m.body("p", mass=2.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1.0, 0, 0))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x", k=50.0, c=1.0)
    return m


def free_mass():
    m = mb.Model("free")
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(0.5, 0, 0))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x")
    return m


X = mb.Final(lambda s: s.position("p")[0])


def slopes(f, z, e=1e-5):
    """Central differences of a function of scaled variables."""
    unit = np.eye(len(z))
    return np.array([(f(z + e * u) - f(z - e * u)) / (2 * e) for u in unit])


@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_bounded_objectives_hold(scheme):
    """min (x(1) - 3)^2 with x(1) <= 2: x(1) = v."""
    goal = mb.Final(lambda s: (s.position("p")[0] - 3.0) ** 2)
    p = mb.problem(
        free_mass(), goal, ["p.velocity[0]"], t=1.0, step=0.1, constraints=[mb.Bounded(X, upper=2.0)], scheme=scheme
    )
    best = p.solve()
    assert best.status == "converged"
    assert best.x[0] == pytest.approx(2.0, abs=1e-6)
    assert best.value == pytest.approx(1.0, abs=1e-5)
    assert len(best.history) == best.stats.counts["evaluations"] == len(p.history)


def test_both_sides_of_bounded_objectives_and_their_order():
    goal = mb.Final(lambda s: s.velocity("p")[0] ** 2)
    energy = mb.Integral(lambda s: s.velocity("p")[0] ** 2)
    limits = [mb.Frequency(0, upper=1.0), mb.Bounded(X, lower=0.1, upper=0.2), mb.Bounded(energy, upper=3.0)]
    p = mb.problem(oscillator(), goal, ["rail.k", "p.velocity[0]"], t=0.5, step=0.01, constraints=limits)
    assert len(p.constraints) == 4
    z = p.x0 * [1.03, 0.95]
    for c in p.constraints:
        assert np.allclose(c["jac"](z), slopes(c["fun"], z), rtol=1e-6, atol=1e-8)
    values = mb.gradient(p.model, [X, energy], ["rail.k"], t=0.5, step=0.01).value
    p.apply(z)
    values = mb.gradient(p.model, [X, energy], ["rail.k"], t=0.5, step=0.01).value
    frequency = mb.modes(p.model).frequency[0]
    found = [c["fun"](z) for c in p.constraints]
    assert np.allclose(found, [1.0 - frequency, values[0] - 0.1, 0.2 - values[0], 3.0 - values[1]], rtol=1e-12)


def test_a_frequency_limit_is_active_at_the_optimum():
    """min x(0.1)^2 wants the stiffest spring; k = m (2 pi f)^2 at the limit."""
    goal = mb.Final(lambda s: s.position("p")[0] ** 2)
    p = mb.problem(
        oscillator(),
        goal,
        ["rail.k"],
        t=0.1,
        step=0.002,
        constraints=[mb.Frequency(0, upper=1.5)],
        scale={"rail.k": 100.0},
    )
    best = p.solve(tol=1e-12)
    assert mb.modes(p.model).frequency[0] <= 1.5 * (1 + 1e-6)
    assert best.x[0] == pytest.approx(2.0 * (2 * np.pi * 1.5) ** 2, rel=1e-3)


def test_a_damping_limit_is_active_at_the_optimum():
    """min of the swing wants the largest damper; zeta = c / (2 sqrt(k m))."""
    goal = mb.Integral(lambda s: s.position("p")[0] ** 2)
    limit = mb.Damping(0, upper=0.2)
    p = mb.problem(oscillator(), goal, ["rail.c"], t=2.0, step=0.02, constraints=[limit], scale={"rail.c": 1.0})
    best = p.solve(tol=1e-12)
    assert best.x[0] == pytest.approx(0.2 * 2 * np.sqrt(50.0 * 2.0), rel=1e-4)
    c = p.constraints[0]
    z = np.array([2.0])
    assert np.allclose(c["jac"](z), slopes(c["fun"], z), rtol=1e-7)
    assert c["fun"](z) == pytest.approx(0.2 - 2.0 / (2 * np.sqrt(100.0)), rel=1e-12)


def test_modes_at_equilibrium_follow_the_parameters():
    m = mb.Model("pendulum", gravity=(0, -9.81, 0))
    p = m.body("p", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(1, 0, 0))
    m.revolute("A", m.ground, p, at=(0, 0, 0), axis="z", k=3.0, c=0.1)
    goal = mb.Final(lambda s: s.position("p")[1])
    limits = [mb.Frequency(0, lower=0.1, at_equilibrium=True), mb.Damping(0, lower=0.0, at_equilibrium=True)]
    problem = mb.problem(m, goal, ["A.k", "p.mass"], t=0.1, step=0.01, constraints=limits)
    z = problem.x0
    for c in problem.constraints:
        assert np.allclose(c["jac"](z), slopes(c["fun"], z), rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: mb.Bounded(X), "needs lower= or upper="),
        (lambda: mb.Bounded(X, lower=2.0, upper=1.0), "lower not above upper"),
        (lambda: mb.Bounded(lambda s: 0.0, upper=1.0), "takes mb.Integral"),
        (lambda: mb.Frequency(0), "needs lower= or upper="),
        (lambda: mb.Damping(0, lower=0.3, upper=0.1), "lower not above upper"),
    ],
)
def test_limits_that_are_none(make, message):
    with pytest.raises(mb.errors.ModelError, match=message):
        make()


def test_wrong_problems_are_named():
    m, goal = oscillator(), X
    options = {"t": 0.1, "step": 0.01}
    with pytest.raises(mb.errors.ModelError, match=r"no mode 7"):
        mb.problem(m, goal, ["rail.k"], constraints=[mb.Frequency(7, upper=1.0)], **options).constraints[0]["fun"](
            np.ones(1)
        )
    with pytest.raises(mb.errors.ModelError, match="constraints= takes"):
        mb.problem(m, goal, ["rail.k"], constraints=[X], **options)
    with pytest.raises(mb.errors.ModelError, match="not among the parameters"):
        mb.problem(m, goal, ["rail.k"], bounds={"rail.c": (0, 1)}, **options)
    with pytest.raises(mb.errors.NameNotFoundError, match="did you mean 'k'"):
        mb.problem(m, goal, ["rail.kk"], **options)
    with pytest.raises(mb.errors.ModelError, match="vector of variables contains NaN"):
        mb.problem(m, goal, ["rail.k"], **options).fun(np.array([np.nan]))


@pytest.mark.parametrize("scheme", ["ali3p", "generalized-alpha"])
def test_check_gradients_of_a_motion(scheme):
    m = silent(spatial_loop)
    psi = mb.Integral(lambda s: s.position("rocker")[0] + 0.1 * s.velocity("crank")[2])
    names = ["spring.k", "spring.length", "crank.mass", "R1.at[0]"]

    def analysis(m):
        return mb.gradient(m, psi, names, t=0.2, step=0.02, scheme=scheme)

    check = mb.check_gradients(analysis, m, names)
    print(check)
    assert check
    assert check.labels == tuple(names)
    assert np.all(check.error < 1e-6)


def test_check_gradients_finds_a_wrong_one():
    """A value that is not what was differentiated."""
    m = silent(five_bar)
    psi = mb.Final(lambda s: s.point("P2")[0])

    def analysis(m):
        return mb.gradient(m, psi, ["spring1.length"], t=0.2, step=0.02)

    wrong = mb.check_gradients(
        analysis, m, ["spring1.length"], value=lambda r: np.asarray(r.value) * (2.0 if hasattr(r, "gradient") else 1.0)
    )
    assert not wrong


GOAL = mb.Integral(lambda s: s.position("p")[0] ** 2)
BOX = {"rail.k": (10.0, 400.0), "rail.c": (0.1, 8.0)}


def mixed(**given):
    """Frequency, damping and a bound on the motion together; the frequency limit and the largest damper are active."""
    limits = [mb.Frequency(0, lower=0.3, upper=1.0), mb.Damping(0, upper=0.4), mb.Bounded(X, lower=-0.2, upper=0.3)]
    options = {"t": 0.5, "step": 0.01, "bounds": BOX, "constraints": limits, **given}
    return mb.problem(oscillator(), GOAL, ["rail.k", "rail.c"], **options)


@pytest.mark.parametrize("method", [None, "SLSQP", "trust-constr", "COBYLA"])
def test_every_method_with_constraints_finds_the_same(method):
    """The objective is of size 1e-2 and tolerances are absolute in SciPy: scaled, all of them get there."""
    best = mixed().solve(method)
    print(method, best.value, best.x, best.stats.counts)
    assert best.status == "converged"
    assert best.x == pytest.approx([2.0 * (2 * np.pi) ** 2, 8.0], rel=2e-3)
    assert best.violation[-1] <= 1e-4
    assert len(best.violation) == len(best.history) == best.stats.counts["evaluations"]


@pytest.mark.parametrize("method", ["L-BFGS-B", "TNC", "Nelder-Mead", "BFGS"])
def test_methods_that_would_leave_constraints_out_are_refused(method):
    with pytest.raises(mb.errors.ModelError, match=r"knows no constraints and would leave them out; take one of SLSQP"):
        mixed().solve(method)
    with pytest.raises(mb.errors.ModelError, match="knows no bounds"):
        mixed(constraints=()).solve("BFGS")
    with pytest.raises(mb.errors.ModelError, match="method= is one of"):
        mixed(constraints=()).solve("foo")


def test_what_cannot_be_kept_to_is_not_converged():
    p = mixed(constraints=[mb.Frequency(0, lower=100.0)])
    best = p.solve()
    assert best.status == "infeasible"
    assert best.violation[-1] > 0.9


def test_a_design_without_motion_keeps_the_best_so_far():
    """A mass that an unbounded optimiser takes below zero."""
    goal = mb.Final(lambda s: s.value("p.mass") + 0.0 * s.position("p")[0])
    p = mb.problem(oscillator(), goal, ["p.mass"], t=0.1, step=0.01)
    with pytest.raises(mb.errors.ConvergenceError, match=r"cannot be evaluated: .*mass.*bounds=") as caught:
        p.solve()
    best = caught.value.result
    assert best.status == "stopped"
    assert best.value == best.history.min() == best.x[0] == p.model.value("p.mass")


def test_numbers_that_are_no_parameters_may_be_set_in_between():
    p = mixed()
    first = p.fun(p.x0), p.constraints[0]["fun"](p.x0)
    p.model.set({"p.mass": 3.0})
    again = p.fun(p.x0), p.constraints[0]["fun"](p.x0)
    p.model.set({"p.mass": 2.0})
    assert again[0] != first[0]
    assert again[1] != first[1]
    assert (p.fun(p.x0), p.constraints[0]["fun"](p.x0)) == first


def test_a_design_is_solved_for_its_modes_once(monkeypatch):
    from mbrs.design import problem

    p, calls = mixed(), []
    made = problem.Problem._modal_numbers
    monkeypatch.setattr(problem.Problem, "_modal_numbers", lambda self, at: calls.append(at) or made(self, at))
    for c in p.constraints:
        c["fun"](p.x0), c["jac"](p.x0)
    assert len(calls) == 1


@pytest.mark.slow
def test_the_course_of_an_optimisation_shows_what_violates(tmp_path):
    p = mixed(constraints=[mb.Frequency(0, upper=0.6)])
    best = p.solve()
    figure = best.plot()
    figure.savefig(tmp_path / "a.png")
    (ax,) = figure.axes
    evaluated, least, violated = ax.lines
    assert len(evaluated.get_xdata()) + len(violated.get_xdata()) == len(best.history)
    assert best.violation[0] > 0.1  # drawn with 0.8 Hz
    assert violated.get_xdata()[0] == 1
    assert np.isnan(least.get_ydata()[0])
    assert best.to_xarray()["violation"].values.tolist() == best.violation.tolist()


def test_an_optimisation_shows_its_progress(monkeypatch, capsys):
    from mbrs._lib import progress

    monkeypatch.setenv("MBRS_PROGRESS", "1")
    monkeypatch.setattr(progress, "_QUIET_FOR", 0.0)
    mixed().solve()
    shown = capsys.readouterr().err
    assert "optimisation" in shown
    assert "objective 0.0" in shown


BAD = [
    ({"bounds": {"rail.k": 5.0}}, r"\(lower, upper\)"),
    ({"bounds": {"rail.k": ("a", 1.0)}}, "must be a number"),
    ({"bounds": {"rail.k": (np.nan, 1.0)}}, "must be a number"),
    ({"bounds": {"rail.k": (9.0, 1.0)}}, "above its upper bound"),
    ({"bounds": [(1.0, 2.0)]}, "takes a dictionary"),
    ({"scale": {"rail.k": "x"}}, "must be a number"),
    ({"scale": {"rail.k": 0.0}}, "positive"),
    ({"scale": [1.0]}, "takes a dictionary"),
    ({"constraints": mb.Frequency(0, upper=1.0)}, "takes a list"),
    ({"t": np.nan}, "t= must be"),
    ({"setp": 0.1}, "did you mean step=?"),
]


@pytest.mark.parametrize(("change", "message"), BAD, ids=range(len(BAD)))
def test_wrong_problems_are_named_before_anything_runs(change, message):
    with pytest.raises(mb.errors.ModelError, match=message):
        mixed(**change)


def test_bounds_may_be_open():
    p = mixed(bounds={"rail.k": (None, 400.0)})
    assert p.bounds == [(-np.inf, 8.0), (-np.inf, np.inf)]
    assert mixed(constraints=None).limits == ()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: mb.Frequency(0, lower="a"), "must be a number"),
        (lambda: mb.Bounded(X, lower=None), "must be a number"),
        (lambda: mb.Bounded(X, lower=np.inf), "needs lower"),
        (lambda: mb.Frequency(0.5, upper=1.0), "number of a mode"),
        (lambda: mb.Damping(-1, upper=1.0), "number of a mode"),
        (lambda: mb.Frequency(True, upper=1.0), "number of a mode"),
    ],
)
def test_limits_of_wrong_types(make, message):
    with pytest.raises(mb.errors.ModelError, match=message):
        make()


def test_parameters_that_cannot_be_varied():
    o = {"t": 0.1, "step": 0.01}
    with pytest.raises(mb.errors.ModelError, match="named twice"):
        mb.problem(oscillator(), X, ["rail.k", "rail.k"], **o)
    with pytest.raises(mb.errors.ModelError, match="is a rotation and cannot be a design variable"):
        mb.problem(oscillator(), X, ["rail.axis"], **o)
