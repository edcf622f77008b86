"""Objectives that cannot be differentiated, or that are no functions of the state, wherever in the motion they say so."""

import math

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import ModelError, NotDifferentiableError


def oscillator():
    """m x" + c x' + k x = 0, x(0) = 0, x'(0) = v."""
    m = mb.Model("oscillator")
    p = m.body("p", mass=2.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(1.0, 0, 0))
    m.prismatic("rail", m.ground, p, at=(0, 0, 0), axis="x", k=50.0, c=1.0)
    return m


def x(s):
    return s.position("p")[0]


def run(function, method="direct", **changed):
    """Two seconds: more than a period and a half, 200 steps."""
    return mb.gradient(
        oscillator(), mb.Integral(function), "rail.k", method=method, **{"t": 2.0, "step": 0.01, **changed}
    )


WINDOWS = [
    lambda s: (s.t > 1.5) * abs(s.velocity("p")[0]),
    lambda s: abs(s.velocity("p")[0]) if s.t < 0.3 else x(s),
    lambda s: np.linalg.norm(s.position("p")) if 0.41 < s.t < 0.46 else 0.0,
    lambda s: x(s) * abs(x(s)) if s.t > 1.0 else x(s),
    lambda s: np.conj(x(s)) if s.t < 0.2 else x(s),
]


@pytest.mark.parametrize("method", ["direct", "adjoint"])
@pytest.mark.parametrize("function", WINDOWS, ids=range(len(WINDOWS)))
def test_what_is_not_analytic_somewhere_is_found(function, method):
    with pytest.raises(NotDifferentiableError, match=r"not analytic there"):
        run(function, method)


def test_branches_with_slopes_of_their_own_pass():
    """Functions of several analytic pieces: the derivative is that of the piece, against differences of the motion."""
    for function in (
        lambda s: max(x(s), 0.0) ** 2,
        lambda s: np.maximum(x(s) - 0.05, 0.0) ** 3,
        lambda s: x(s) ** 2 if s.t > 0.7 else 3 * x(s),
    ):
        exact, ends = run(function).gradient[0], []
        for side in (1, -1, 2, -2):
            m = oscillator()
            m.set({"rail.k": 50.0 + 0.05 * side})
            ends.append(mb.gradient(m, mb.Integral(function), "rail.k", t=2.0, step=0.01).value)
        difference = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / 0.6
        print(f"{exact:.9g}, differences {difference:.9g}")
        assert exact == pytest.approx(difference, rel=2e-4)


def test_a_kink_right_at_an_instant_is_no_error():
    """At the start x = 0, where max(x, 0) has two slopes."""
    assert np.isfinite(run(lambda s: max(x(s), 0.0)).value)
    assert np.isfinite(run(lambda s: np.maximum(-x(s), 0.0)).value)


@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_objectives_may_change_what_they_are_given(method):
    def changing(s):
        p = s.position("p")
        p *= 2
        s.rotation("p")[0, 0] = 7.0
        return p[0] ** 2

    goals = [mb.Integral(changing), mb.Integral(x)]
    plain = [mb.Integral(lambda s: (2 * x(s)) ** 2 + 0 * s.rotation("p")[0, 0]), mb.Integral(x)]
    found, known = (
        mb.gradient(oscillator(), g, ["rail.k", "p.mass"], t=2.0, step=0.01, method=method) for g in (goals, plain)
    )
    assert np.array_equal(found.value, known.value)
    assert np.allclose(found.gradient, known.gradient, rtol=1e-13, atol=0)


def test_objectives_that_remember_or_guess_are_refused():
    calls = [0]

    def counting(s):
        calls[0] += 1
        return calls[0] * x(s)

    rng = np.random.default_rng(1)
    for function in (counting, lambda s: rng.normal() * x(s)):
        with pytest.raises(ModelError, match=r"for the same state.*depend on the state alone"):
            run(function)


@pytest.mark.parametrize(
    "function",
    [lambda s: np.arctan2(x(s), 1.0), lambda s: math.sin(x(s)), lambda s: np.hypot(x(s), 1.0)],
    ids=["arctan2", "math", "hypot"],
)
@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
def test_functions_of_real_numbers_only_are_named(function):
    with pytest.raises(NotDifferentiableError, match="complex"):
        run(function, t=0.3)


def test_arctan2_as_the_message_writes_it():
    def angle(s):
        x, y = s.rotation("p")[0, 0] - 0.3, s.position("p")[0] + 0.2
        return 2 * np.arctan(y / (np.sqrt(x**2 + y**2) + x))

    found = run(angle, t=0.3)
    m = oscillator()
    assert mb.check_gradients(lambda m: mb.gradient(m, mb.Integral(angle), "rail.k", t=0.3, step=0.01), m, ["rail.k"])
    at = mb.gradient(m, mb.AtTimes([0.0], angle), "rail.k", t=0.3, step=0.01).value
    assert at == pytest.approx(math.atan2(0.2, 0.7), rel=1e-14)
    assert np.isfinite(found.gradient).all()
