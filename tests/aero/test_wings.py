"""Lifting lines against elliptic and rectangular wings and Wagner's function; attached flow against Theodorsen's flutter."""

from __future__ import annotations

import doctest
import importlib
import itertools

import matplotlib.pyplot as plt
import mbrs as mb
import mpmath
import numpy as np
import pytest
from mbrs.aero.wings import _Strips
from mbrs.errors import ConvergenceError, ModelError, RouteError
from scipy import special
from scipy.integrate import quad
from scipy.optimize import brentq, fsolve

THIN = mb.aero.polar([-1.5, 1.5], [-3 * np.pi, 3 * np.pi], [0.0, 0.0], name="thin")
RNG = np.random.default_rng(8)


def elliptic(aspect, span=8.3, **more):
    y = -span / 2 * np.cos(np.linspace(0, np.pi, 4001))
    chord = 4 * span / (np.pi * aspect) * np.sqrt(np.maximum(1 - (2 * y / span) ** 2, 0))
    return mb.aero.blade(y, chord, more.get("twist", 0.0), more.get("polar", THIN))


def test_the_elliptic_wing(case):
    errors = []
    for n in (20, 40, 80, 160):
        w = mb.aero.lifting_line(elliptic(8.0), 1e-4, strips=n)
        lift = w.lift_coefficient[0]
        errors.append(abs(lift / 1e-4 / (2 * np.pi / (1 + 2 / 8)) - 1))
        assert abs(w.induced_drag[0] / (lift**2 / (np.pi * 8)) - 1) < 1e-5
        assert w.error[0] < 8 * errors[-1] and errors[-1] < w.error[0]
    assert 2 * np.pi / (1 + 2 / 8) == pytest.approx(5.026548, abs=5e-7)
    case("elliptic wing, 160 strips: lift slope", topic="aero", ours=lift / 1e-4, known=2 * np.pi / (1 + 2 / 8), within=1e-3,
         source="2 pi / (1 + 2/A) (Prandtl)", estimate=w.error)  # fmt: skip
    case("elliptic wing, 160 strips: induced drag over CL^2 / (pi A)", topic="aero", ours=w.induced_drag[0] / (lift**2 / (np.pi * 8)),
         known=1.0, within=1e-5, source="Prandtl")  # fmt: skip
    assert errors[2] < 1e-3 and all(3.5 < a / b < 4.5 for a, b in itertools.pairwise(errors))


def prandtl(aspect, terms=400):
    """Lift slope and factor of induced drag of a rectangular wing with slope 2 pi, from the series sum A_n sin(n t)."""
    n = np.arange(1, 2 * terms, 2)
    t = np.linspace(0, np.pi / 2, terms + 1)[1:]
    mu = 2 * np.pi / (4 * aspect)
    a = np.linalg.solve(np.sin(np.outer(t, n)) * (mu * n + np.sin(t)[:, None]), mu * np.sin(t))
    return np.pi * aspect * a[0], np.sum(n * a**2) / a[0] ** 2


@pytest.mark.parametrize("aspect", [4.0, 6.0, 8.0, 20.0])
def test_rectangular_wings_are_prandtls(case, aspect):
    slope, factor = prandtl(aspect)
    w = mb.aero.lifting_line(mb.aero.blade([0.0, 1.7 * aspect], 1.7, 0.0, THIN), 1e-4, strips=160)
    lift = w.lift_coefficient[0]
    case(f"rectangular wing of aspect ratio {aspect:g}: lift slope", topic="aero", ours=lift / 1e-4, known=slope, within=2e-4,
         uncertainty=1e-8, source="Prandtl's equation by Glauert's series", estimate=w.error)  # fmt: skip
    assert w.induced_drag[0] / (lift**2 / (np.pi * aspect)) == pytest.approx(factor, rel=2e-4)
    assert w.aspect_ratio == pytest.approx(aspect, rel=1e-14)


def test_twist_and_angle_are_one():
    one = mb.aero.lifting_line(elliptic(6.0, twist=0.05), 0.03, strips=40)
    other = mb.aero.lifting_line(elliptic(6.0), 0.08, strips=40)
    assert np.abs(one.circulation - other.circulation).max() < 1e-12


def test_the_influence_is_biot_and_savarts():
    line = _Strips(mb.aero.blade([-1.0, 0.7, 3.0], [0.5, 0.9, 0.4], 0.0, THIN), 8)
    n = 8
    begin, end, seen = RNG.uniform(0, 1, n), RNG.uniform(1, 5, n), RNG.uniform(0.2, 4, (n, n))
    trailing, shed = line.trailing_influence(begin, end), line.shed_influence(seen)
    far = line.trailing_influence(begin, np.full(n, np.inf))
    point = np.c_[np.zeros(n), line.y, np.zeros(n)]

    def down(points, a, b):
        return -mb.aero.induced_velocity(points, [a], [b], 1.0)[..., 2]

    for j in range(n):
        low, high = line.edges[j : j + 2]
        for matrix, last in ((trailing, end[j]), (far, 1e7)):
            legs = down(point, [last, low, 0], [begin[j], low, 0]) + down(point, [begin[j], high, 0], [last, high, 0])
            assert np.abs(matrix[:, j] - legs).max() < 1e-9 * np.abs(matrix[:, j]).max()
        for i in range(n):
            # the vortex that was shed turns against the bound one: y from high to low
            one = down(point[i], [seen[i, j], high, 0], [seen[i, j], low, 0])
            assert shed[i, j] == pytest.approx(one, rel=1e-9)


def test_a_sudden_start_is_wagners(case):
    # a wing so long that its middle is two-dimensional; half chords of 0.9 m
    wing = mb.aero.blade([-4e5, 4e5], 1.8, 0.0, THIN)
    errors = []
    for step in (0.2, 0.1, 0.05):
        w = mb.aero.impulsive_start(wing, 1e-3, 9.0, step=0.9 * step, strips=4)
        s = w.distance / 0.9
        truth = mb.aero.wagner(s)
        late = s > 1 - 1e-9
        wrong = np.abs(w.lift_coefficient / (2 * np.pi * 1e-3) / truth - 1)[late]
        errors.append(wrong.max())
    assert errors[0] < 0.024 and errors[1] < 0.014 and errors[2] < 0.0085
    at, known = np.array([1.0, 5.0, 10.0]), np.array([0.6006, 0.788, 0.875])
    case("impulsive start of a lifting line, steps of a twentieth of the half chord: lift at 1, 5, 10 half chords over the steady one",
         topic="aero", ours=np.interp(at, s, w.lift_coefficient) / (2 * np.pi * 1e-3), known=known, within=0.01, uncertainty=6e-4,
         source="Wagner's function (I. E. Garrick, NACA Report 629)", kind="publication")  # fmt: skip
    default = mb.aero.impulsive_start(wing, 1e-3, 9.0, strips=4)
    truth = mb.aero.wagner(default.distance / 0.9)
    late = default.distance > 0.9
    assert np.abs(default.lift_coefficient / (2 * np.pi * 1e-3) / truth - 1)[late].max() < 0.02


def test_a_start_ends_in_the_steady_flow():
    wing = mb.aero.blade([0.0, 4.7, 8.0], [1.3, 1.0, 0.7], [0.0, 0.02, 0.01], THIN)
    steady = mb.aero.lifting_line(wing, 0.07, strips=20).lift_coefficient[0]
    missing = [
        1 - mb.aero.impulsive_start(wing, 0.07, x, step=x / 200).lift_coefficient[-1] / steady for x in (40.0, 160.0)
    ]
    # in three dimensions what is shed leaves like one over the distance squared, where the wake is longer than the wing
    assert 0 < missing[1] < missing[0] / 6 and missing[0] < 2e-3


def stalling():
    a = np.linspace(-np.pi, np.pi, 361)
    attached = 2 * np.pi * a / (1 + np.exp((np.abs(a) - 0.27) / 0.03))
    return mb.aero.polar(a, attached + np.sin(2 * a) / (1 + np.exp(-(np.abs(a) - 0.27) / 0.03)), 0.01 + np.sin(a) ** 2)


def test_stalled_wings_balance_or_say_so():
    wing = mb.aero.blade([-4.0, 4.0], 1.0, 0.0, stalling())
    line = _Strips(wing, 40)
    for angle in np.linspace(-0.6, 0.5, 12):
        try:
            w = mb.aero.lifting_line(wing, angle, strips=40)
        except ConvergenceError as problem:
            assert "misses the polars" in str(problem) and abs(angle) > 0.25
            continue
        gamma = w.circulation[0]
        wash = line.trailing_influence(np.zeros(40), np.full(40, np.inf)) @ gamma
        law = 0.5 * np.hypot(1, wash) * wing.coefficients(line.y, angle - np.arctan(wash))[:, 0]
        assert np.abs(gamma - law).max() < 2e-10 * np.abs(gamma).max() + 1e-15
        # the result, put together another way: the force per strip across and along the relative wind
        drag = 0.5 * np.hypot(1, wash) ** 2 * wing.coefficients(line.y, angle - np.arctan(wash))[:, 1]
        total = np.sum((gamma * wash + drag / np.hypot(1, wash)) * line.width) / 4
        assert w.drag_coefficient[0] == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: mb.aero.lifting_line("wing", 0.1), "mb.aero.blade"),
        (lambda: mb.aero.lifting_line(elliptic(8.0), 5.0), "in radians"),
        (lambda: mb.aero.lifting_line(elliptic(8.0), np.nan), "NaN"),
        (lambda: mb.aero.lifting_line(elliptic(8.0), 0.1, strips=7), "even"),
        (lambda: mb.aero.impulsive_start(elliptic(8.0), [0.1, 0.2], 3.0), "one angle"),
        (lambda: mb.aero.impulsive_start(elliptic(8.0), 0.1, -3.0), "positive distance"),
        (lambda: mb.aero.impulsive_start(elliptic(8.0), 0.1, 3.0, step=0.0), "step must be positive"),
        (lambda: mb.aero.impulsive_start(elliptic(8.0), 0.1, 3.0, step=1e-6), "20000|longer step"),
    ],
)
def test_wings_that_cannot_be(call, message):
    with pytest.raises(ModelError, match=message):
        call()


def test_a_start_that_does_not_fit_into_memory_is_refused(monkeypatch):
    monkeypatch.setenv("MBRS_MEMORY", "1e6")
    with pytest.raises(RouteError, match="longer step="):
        mb.aero.impulsive_start(elliptic(8.0), 0.1, 30.0, strips=100)


def test_a_polar_that_does_not_cover_names_its_station():
    short = mb.aero.polar([-0.05, 0.05], [-0.3, 0.3], [0.0, 0.0], name="short")
    wing = mb.aero.blade([-4.0, 4.0], 1.0, 0.0, short)
    for call in (lambda: mb.aero.lifting_line(wing, 0.1), lambda: mb.aero.impulsive_start(wing, 0.1, 2.0)):
        with pytest.raises(ModelError, match=r"'short' covers .*station \d of 2"):
            call()


def test_results_print_and_draw():
    w = mb.aero.lifting_line(elliptic(8.0), [0.02, 0.05])
    assert "aspect ratio 8" in str(w) and len(w.plot().axes[0].lines) == 2
    s = mb.aero.impulsive_start(elliptic(8.0), 0.02, 2.0)
    assert "impulsive start" in str(s) and len(s.plot().axes[0].lines) == 1
    plt.close("all")


# --- attached flow that changes in time -----


@pytest.mark.parametrize("k", [1e-6, 0.03, 0.4, 2.7, 90.0, 0.3 - 0.1j, 0.2 + 0.4j])
def test_theodorsens_function(case, k):
    p = 1j * mpmath.mpmathify(k)
    truth = complex(mpmath.besselk(1, p) / (mpmath.besselk(0, p) + mpmath.besselk(1, p)))
    case(f"Theodorsen's function at k = {k}", topic="aero", kind="high precision", ours=mb.aero.theodorsen(k), known=truth, within=1e-13,
         source="K1(i k) / (K0(i k) + K1(i k)) by mpmath", scale=1.0)  # fmt: skip


# Garrick's integral by mpmath with 15 digits at 1 and 5
@pytest.mark.parametrize("s, known", [(0.0, 0.5), (1.0, 0.600605598398805), (5.0, 0.788203166469517), (300.0, None)])
def test_wagners_function(case, s, known):
    def part(x):
        k, i = special.k0(x) - special.k1(x), special.i0(x) + special.i1(x)
        return np.exp(-x * s) / (x * x * (k * k + np.pi**2 * i * i))

    truth = 1 - sum(quad(part, a, b, epsabs=1e-14)[0] for a, b in itertools.pairwise((1e-300, 1e-3, 0.1, 3.0, 40.0)))
    case(f"Wagner's function at {s:g} half chords", topic="aero", kind="independent script", ours=mb.aero.wagner(s), known=truth,
         within=1e-11, uncertainty=1e-13, source="Garrick's integral by quadrature", scale=1.0)  # fmt: skip
    assert known is None or mb.aero.wagner(s) == pytest.approx(known, abs=1e-11)


def test_wagners_function_is_the_transform_of_theodorsens():
    # C = p int_0^inf phi(s) exp(-p s) ds for motions exp(p s), here with a positive real part; in substituted s = x^2
    x = np.linspace(0.0, 25.0, 20001)
    phi = mb.aero.wagner(x**2)
    for p in (0.3 + 0.2j, 0.05 + 1.1j):
        y = 2 * x * phi * np.exp(-p * x**2)
        simpson = (y[0] + 4 * y[1::2].sum() + 2 * y[2:-1:2].sum() + y[-1]) * (x[1] / 3)
        assert abs(p * simpson - mb.aero.theodorsen(-1j * p)) < 1e-8


@pytest.mark.parametrize("states, bound", [(2, 1e-2), (3, 3e-3), (4, 1e-3), (6, 1.3e-4), (8, 1.2e-5)])
def test_exponentials_approach_wagners_function(states, bound):
    model = mb.aero.indicial(states)
    s = np.r_[0, np.geomspace(3e-3, 9e2, 777)]
    assert np.abs(model.response(s) - mb.aero.wagner(s)).max() < bound
    assert model.response(0.0) == pytest.approx(0.5, abs=1e-12) and np.all(model.weights > 0)
    k = np.geomspace(0.01, 10, 50)
    assert np.abs(model.transfer(k) - mb.aero.theodorsen(k)).max() < 3 * bound


A, X, R2, RATIO, FREQUENCY = -0.2, 0.1, 0.24, 20.0, 0.4


def flutter(model, b=0.37, pitching=13.1, density=1.19):
    """Speed over b omega_alpha and frequency over omega_alpha at which the section begins to flutter."""
    m = RATIO * np.pi * density * b**2
    mass = m * np.array([[1, b * X], [b * X, b**2 * R2]])
    stiffness = m * pitching**2 * np.diag([FREQUENCY**2, b**2 * R2])

    def least_stable(v):
        air = mb.aero.attached_flow(b, v * b * pitching, axis=A, density=density, model=model)
        s = np.linalg.eigvals(air.state_matrix(mass, stiffness)) / pitching
        s = s[s.imag > 1e-3]
        return s[np.argmax(s.real)]

    speed = brentq(lambda v: least_stable(v).real, 1.5, 3.0, xtol=1e-13)
    return speed, least_stable(speed).imag


def theodorsens_flutter():
    """The same from Theodorsen's determinant, without units."""

    def determinant(x):
        v, w = x
        k = w / v
        c = complex(mb.aero.theodorsen(k))
        # L / (pi rho b^3 omega^2) and M / (pi rho b^4 omega^2) of h / b and alpha, motion exp(i omega t)
        down = [1j * k, 1 + 1j * k * (0.5 - A)]  # the downwash over U
        lift = [-1 + 2 * c * down[0] / k**2, (1j * k + k**2 * A) / k**2 + 2 * c * down[1] / k**2]
        moment = [
            -A + 2 * (A + 0.5) * c * down[0] / k**2,
            (-1j * k * (0.5 - A) + k**2 * (0.125 + A**2)) / k**2 + 2 * (A + 0.5) * c * down[1] / k**2,
        ]
        m = np.array(
            [
                [-RATIO * (1 - FREQUENCY**2 / w**2) + lift[0], -RATIO * X + lift[1]],
                [-RATIO * X - moment[0], -RATIO * R2 * (1 - 1 / w**2) - moment[1]],
            ]
        )
        d = np.linalg.det(m)
        return [d.real, d.imag]

    return fsolve(determinant, [2.2, 0.65], xtol=1e-13)


def test_the_typical_section_flutters_where_theodorsen_says():
    speed, frequency = theodorsens_flutter()
    assert speed == pytest.approx(2.18391, abs=2e-5) and frequency == pytest.approx(0.64898, abs=5e-6)
    for states, bound in ((2, 8e-3), (4, 1.5e-3), (6, 2e-4), (8, 1.5e-5)):
        found = flutter(mb.aero.indicial(states))
        assert found[0] == pytest.approx(speed, rel=bound) and found[1] == pytest.approx(frequency, rel=bound)


def test_a_steady_angle_has_the_steady_lift_at_the_quarter_chord():
    air = mb.aero.attached_flow(0.4, 31.0, axis=-0.5, density=1.1, model=mb.aero.indicial(3))
    z = np.linalg.solve(np.diag(air.decay), air.input @ [0.0, 0.05])
    force = -(air.stiffness @ [0.0, 0.05] + air.lag @ z)
    assert force[0] == pytest.approx(-2 * np.pi * 0.05 * 0.5 * 1.1 * 31.0**2 * 0.8, rel=1e-12)
    assert abs(force[1]) < 1e-12 * abs(force[0])


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: mb.aero.theodorsen(-0.1), "not be negative"),
        (lambda: mb.aero.wagner([1.0, -1.0]), "not be negative"),
        (lambda: mb.aero.indicial(1), "states"),
        (lambda: mb.aero.attached_flow(0.0, 1.0, axis=0.0), "must be positive"),
        (lambda: mb.aero.attached_flow(0.1, np.nan, axis=0.0), "speed must be a finite number"),
        (lambda: mb.aero.attached_flow(0.1, 1.0, axis=0.0).state_matrix(1.0, 2.0), r"\(2, 2\)"),
    ],
)
def test_sections_that_cannot_be(call, message):
    with pytest.raises(ModelError, match=message):
        call()


@pytest.mark.parametrize("module", ["wings", "attached"])
def test_examples_of_docstrings(module):
    found = doctest.testmod(importlib.import_module(f"mbrs.aero.{module}"))
    assert found.attempted > 0 and found.failed == 0
