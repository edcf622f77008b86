"""Blade elements and momentum: random annuli against the balance of forces, closed forms, Glauert's optimum rotor."""

from __future__ import annotations

import doctest

import mbrs as mb
import mbrs.aero.steady_rotors
import numpy as np
import pytest
from mbrs.aero.momentum import Annuli, inflow
from mbrs.errors import ModelError
from scipy.optimize import brentq

RNG = np.random.default_rng(14)


def random_polar():
    angle = np.r_[-np.pi, np.sort(RNG.uniform(-3.1, 3.1, 30)), np.pi]
    lift, drag = RNG.normal(size=32) * 10 ** RNG.uniform(-2, 1), 10 ** RNG.uniform(-4, 1, 32)
    lift[-1], drag[-1] = lift[0], drag[0]
    return mb.aero.polar(angle, lift, drag, interpolation=RNG.choice(["pchip", "linear"]))


def random_annuli(m):
    p = random_polar()
    return Annuli(
        p.clip_values,
        RNG.uniform(-np.pi, np.pi, m),
        10 ** RNG.uniform(-5, 2.5, m),
        10 ** RNG.uniform(-6, 3, (RNG.integers(0, 3), m)),
    )


def speeds(m):
    """Of any sign, over ten decades, with zeros."""
    v = RNG.choice([-1.0, 1.0], m) * 10 ** RNG.uniform(-5, 5, m)
    v[RNG.random(m) < 0.03] = 0.0
    return v


def imbalance(annuli, flow, vx, vy):
    """Blade force less momentum's, axial and tangential, over the sum of their sizes: written down without the solver's unknown."""
    x = vx + flow.axial
    w2 = flow.speed**2
    push, drive = annuli.solidity * w2 * flow.normal, annuli.solidity * w2 * flow.driving
    mass = 4 * flow.loss * np.abs(x)
    axial = -mass * flow.axial
    a = -flow.axial / np.where(vx == 0, 1, vx)
    f = flow.loss
    buhl = vx * np.abs(vx) * (8 / 9 + (4 * f - 40 / 9) * a + (50 / 9 - 4 * f) * a**2)
    axial = np.where((vx != 0) & (a > 0.4) & (a <= 1), buhl, axial)
    twist = mass * flow.tangential
    drag = annuli.solidity * w2  # forces may cancel to nothing, but not beyond rounding of their terms
    return (
        np.abs(push - axial) / (np.abs(push) + np.abs(axial) + drag * 1e-3 + 1e-300),
        np.abs(drive - twist) / (np.abs(drive) + np.abs(twist) + drag * 1e-3 + 1e-300),
    )


@pytest.mark.parametrize("n", [20, pytest.param(130, marks=pytest.mark.slow)])
def test_any_input_has_a_balance(n):
    worst = 0.0
    for _ in range(n):
        m = 200
        annuli, vx, vy = random_annuli(m), speeds(m), speeds(m)
        flow = inflow(annuli, vx, vy)
        assert flow.steps < 180
        for name in ("angle", "speed", "axial", "tangential", "normal", "driving", "residual"):
            assert np.all(np.isfinite(getattr(flow, name))), name
        assert flow.residual.max() <= mbrs.aero.steady_rotors.BALANCED
        alive = flow.loss * np.abs(np.sin(flow.angle)) > 1e-9  # elsewhere the air at the blade stands still
        alive &= flow.speed > 1e-12 * np.hypot(vx, vy)
        for part in imbalance(annuli, flow, vx, vy):
            worst = max(worst, part[alive].max())
        turned = np.arctan2(vx + flow.axial, vy + flow.tangential) - flow.angle
        assert np.abs(np.sin(turned[alive])).max() < 1e-6
    assert worst < 1e-5, worst


def test_a_mirrored_wind_mirrors_the_flow():
    m = 50
    p = random_polar()
    mirrored = mb.aero.polar(-p.angle[::-1], -p.lift[::-1], p.drag[::-1], interpolation=p.interpolation)
    twist, solidity = RNG.uniform(-1, 1, m), 10 ** RNG.uniform(-3, 0, m)
    loss = 10 ** RNG.uniform(-2, 2, (1, m))
    vx, vy = np.abs(speeds(m)) + 0.01, np.abs(speeds(m)) + 0.01
    one = inflow(Annuli(p.clip_values, twist, solidity, loss), vx, vy)
    other = inflow(Annuli(mirrored.clip_values, -twist, solidity, loss), -vx, vy)
    size = np.hypot(vx, vy)
    assert np.abs((one.axial + other.axial) / size).max() < 1e-9
    assert np.abs((one.tangential - other.tangential) / size).max() < 1e-9
    assert np.abs(one.normal + other.normal).max() < 1e-6 * np.abs(one.normal).max()


def disc(lift, **more):
    """One annulus whose section has the same lift everywhere."""
    return Annuli(
        lambda a: np.stack([np.full(np.shape(a), lift), np.full(np.shape(a), more.get("drag", 0.0))], axis=-1),
        np.zeros(1),
        np.array([more["solidity"]]),
        np.zeros((0, 1)),
    )


@pytest.mark.parametrize("ct", [0.1, 0.5, 0.8, 0.95, 0.97, 1.2, 1.6, 1.95])
def test_thrust_is_that_of_momentum_theory_and_of_buhls_parabola(ct):
    # fast blades: the thrust is sigma cl (Omega r)^2
    speed, sigma = 3e2, 1e-5
    flow = inflow(disc(ct / (sigma * speed**2), solidity=sigma), np.ones(1), np.full(1, speed))
    a, thrust = -flow.axial[0], sigma * flow.speed[0] ** 2 * flow.normal[0]
    assert thrust == pytest.approx(ct, rel=1e-4)
    truth = 4 * a * (1 - a) if ct < 0.96 else 8 / 9 + (4 - 40 / 9) * a + (50 / 9 - 4) * a**2
    assert thrust == pytest.approx(truth, rel=1e-10) and (a < 0.4) == (ct < 0.96)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("climb", [0.0, 1e-9, 0.3])
def test_hover_is_that_of_actuator_discs(sign, climb):
    # T = 2 rho A |u| du: in still air u = sqrt(T / (2 rho A)), in a climb u = sqrt(V^2/4 + T / (2 rho A)) - V/2
    speed, sigma, lift = 3e3, 1e-6, 0.7
    v = sign * climb
    thrust = sigma * lift * speed**2  # over rho / 2: positive pushes along the wind
    flow = inflow(disc(-sign * lift, solidity=sigma), np.array([v]), np.array([speed]))
    truth = sign * (np.sqrt(climb**2 / 4 + thrust / 4) - climb / 2)
    assert flow.axial[0] == pytest.approx(truth, rel=1e-5)


def test_swirl_carries_the_torque():
    # 4 a' (1 - a) x^2 lambda_r ... = the torque of the lift, with a of order one
    annuli = disc(0.9, solidity=0.1, drag=0.01)
    flow = inflow(annuli, np.array([1.3]), np.array([2.1]))
    for part in imbalance(annuli, flow, np.array([1.3]), np.array([2.1])):
        assert part[0] < 1e-12
    assert flow.axial[0] < 0 < flow.tangential[0]


def test_losses_are_prandtls():
    e = np.array([[0.7], [2.3]])
    annuli = Annuli(lambda a: np.zeros((*np.shape(a), 2)), np.zeros(1), np.array([0.1]), e)
    flow = inflow(annuli, np.array([1.1]), np.array([4.7]))
    s = 1.1 / np.hypot(1.1, 4.7)
    truth = np.prod([2 / np.pi * np.arccos(np.exp(-x / s)) for x in (0.7, 2.3)])
    assert flow.loss[0] == pytest.approx(truth, rel=1e-14) and flow.axial[0] == pytest.approx(0.0, abs=1e-12)


# --- whole rotors -----


def optimum(ratio, n=400, hub=2e-3):
    """Glauert's optimum rotor: a and a' of each annulus, and the chord that makes them with a lift coefficient of one."""
    x = np.linspace(hub, 1.0, n) * ratio
    a = np.array([brentq(np.poly1d([16, -24, 9 - 3 * s * s, s * s - 1]), 0.25, 1 / 3) for s in x])
    phi = np.arctan2(1 - a, x * (1 + (1 - 3 * a) / (4 * a - 1)))
    solidity = 4 * np.sin(phi) ** 2 * a / ((1 - a) * np.cos(phi))
    r, angle = 37.0 * x / ratio, np.linspace(-0.5, 0.5, 3)
    p = mb.aero.polar(angle, 2 * np.pi * angle, np.zeros(3))
    b = mb.aero.blade(r, solidity * 2 * np.pi * r / 3, phi - 1 / (2 * np.pi), p)
    return mb.aero.rotor(b, 3, tip_loss=False, hub_loss=False)


@pytest.mark.parametrize(
    "ratio, truth", [(1.0, 0.415496), (2.0, 0.511187), (5.0, 0.570387), (7.5, 0.580849), (10.0, 0.585234)]
)
def test_the_optimum_rotor_has_glauerts_power(case, ratio, truth):
    p = mb.aero.performance(optimum(ratio), ratio, elements=200)
    case(f"Glauert's optimum rotor at the tip speed ratio {ratio:g}: power coefficient", topic="aero", kind="publication",
         ours=p.power_coefficient[0], known=truth, within=3e-6, uncertainty=2e-6, estimate=p.error,
         source="H. Glauert in Durand, Aerodynamic Theory IV (1935), the integral with six digits")  # fmt: skip
    assert p.status == "converged"


def test_off_its_design_the_optimum_rotor_gives_less():
    p = mb.aero.performance(optimum(7.5), [5.0, 6.9, 7.5, 8.1, 9.0])
    assert np.argmax(p.power_coefficient) in (1, 2, 3)
    # by momentum theory no rotor gives more than the optimum at its own tip speed ratio
    assert p.power_coefficient.max() < 16 / 27


def common():
    a = np.linspace(-np.pi, np.pi, 145)
    thick = mb.aero.polar(a, 2.1 * np.sin(2 * a), 0.09 + 1.1 * np.sin(a) ** 2, thickness=0.4)
    thin = mb.aero.polar(a, np.pi * np.sin(2 * a), 0.008 + 1.3 * np.sin(a) ** 2, thickness=0.17)
    return mb.aero.blade(
        [1.7, 5.3, 11.9, 23.1, 33.7],
        [1.4, 2.3, 2.0, 1.3, 0.4],
        [0.31, 0.23, 0.11, 0.05, 0.01],
        [thin, thick],
        thickness=[0.4, 0.37, 0.28, 0.2, 0.17],
    )


def test_the_estimate_holds_and_refinement_converges():
    r = mb.aero.rotor(common(), 3, hub_radius=1.3, tip_radius=34.9, precone=0.05)
    ratio = np.linspace(2.0, 12.0, 9)
    fine = mb.aero.performance(r, ratio, elements=1600)
    errors = []
    for n in (20, 40, 80, 160):
        p = mb.aero.performance(r, ratio, elements=n)
        apart = [
            np.abs(getattr(p, k) - getattr(fine, k)) / np.abs(getattr(fine, k)).max()
            for k in ("power_coefficient", "thrust_coefficient")
        ]
        errors.append(np.max(apart))
        assert np.max(apart) < 2.0 * p.error.max()
    assert errors[-1] < 3e-4 and errors[0] / errors[-1] > 8.0


@pytest.mark.parametrize("n", [8, 9, 30])
def test_elements_integrate_polynomials_exactly(n):
    r = mb.aero.rotor(common(), hub_radius=0.7, tip_radius=36.1)
    places, weights = r.elements(n)
    for k in range(n):
        truth = (36.1 ** (k + 1) - 0.7 ** (k + 1)) / (k + 1)
        assert weights @ places**k == pytest.approx(truth, rel=1e-12)


def test_units_and_power_are_consistent():
    b = common()
    p = mb.aero.performance(mb.aero.rotor(b, 3), 7.0)
    k = 3.7  # a rotor k times larger: the same coefficients
    big = mb.aero.blade(k * b.stations, k * b.chord, b.twist, list(b.polars), thickness=b.thickness)
    q = mb.aero.performance(mb.aero.rotor(big, 3), 7.0)
    assert np.abs(p.power_coefficient / q.power_coefficient - 1) < 1e-12
    assert p.power(8.0) == pytest.approx(p.torque(8.0) * 7.0 * 8.0 / p.radius, rel=1e-13)
    assert p.thrust(8.0, 1.1) == pytest.approx(p.thrust_coefficient * 0.5 * 1.1 * np.pi * p.radius**2 * 64, rel=1e-13)
    pitched = mb.aero.performance(mb.aero.rotor(b, 3, pitch=0.03), 7.0)
    assert mb.aero.performance(mb.aero.rotor(b, 3), 7.0, pitch=0.03).power_coefficient == pitched.power_coefficient


def test_the_coned_rotor_sweeps_less_and_meets_the_wind_across_its_blades():
    # no losses, little load, no swirl: dT = B c pi (theta = 0) W (U cos g) cos g dr with W = Omega r cos g, over the swept disc
    thin = mb.aero.polar([-2.0, 2.0], [-4 * np.pi, 4 * np.pi], [0.0, 0.0])
    b = mb.aero.blade([0.01, 10.0], 1e-6, 0.0, thin)
    for g in (0.0, 0.3):
        r = mb.aero.rotor(b, 2, precone=g, tip_loss=False, hub_loss=False)
        found = mb.aero.performance(r, 200.0).thrust_coefficient[0]
        omega = 200.0 / (10.0 * np.cos(g))
        truth = 2 * 1e-6 * 2 * np.pi * omega * np.cos(g) ** 3 * 0.5 * (100 - 1e-4) / (np.pi * (10 * np.cos(g)) ** 2)
        assert found == pytest.approx(truth, rel=1e-3)


def test_a_polar_that_does_not_cover_names_angle_and_station():
    p = mb.aero.polar([-0.2, 0.25], [-1.2, 1.5], [0.01, 0.01], name="short")
    r = mb.aero.rotor(mb.aero.blade([1.0, 3.0, 9.0], 0.7, 0.0, p), 3)
    with pytest.raises(ModelError, match=r"'short' covers -11.46 to 14.32 degrees, .* at 1.\d+ m \(station 1 of 3\)"):
        mb.aero.performance(r, 5.0)
    # where the solution stays within the table it is that of the longer table, whatever the search met on its way
    long = mb.aero.polar(
        [-2.0, -0.2, 0.25, 2.0], [-3.0, -1.2, 1.5, 0.3], [0.4, 0.01, 0.01, 0.7], interpolation="linear"
    )
    found = [
        mb.aero.performance(mb.aero.rotor(mb.aero.blade([4.0, 9.0], 0.4, 0.05, q), 3), 6.0).power_coefficient[0]
        for q in (p, long)
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-12)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda b: mb.aero.rotor("b"), "mb.aero.blade"),
        (lambda b: mb.aero.rotor(b, 0), "count"),
        (lambda b: mb.aero.rotor(b, hub_radius=2.0), "at most the first station's 1.7 m"),
        (lambda b: mb.aero.rotor(b, hub_radius=0.0), "must be positive"),
        (lambda b: mb.aero.rotor(b, tip_radius=30.0), "at least the last station's 33.7 m"),
        (lambda b: mb.aero.rotor(b, precone=90.0), "radians"),
        (lambda b: mb.aero.rotor(b, pitch=np.nan), "pitch must be a finite number, it is nan"),
        (lambda b: mb.aero.performance(b, 7.0), "mb.aero.rotor"),
        (lambda b: mb.aero.performance(mb.aero.rotor(b), -1.0), "must be positive"),
        (lambda b: mb.aero.performance(mb.aero.rotor(b), []), "must be positive"),
        (lambda b: mb.aero.performance(mb.aero.rotor(b), 7.0, elements=9), "even"),
    ],
)
def test_rotors_that_cannot_be(call, message):
    with pytest.raises(ModelError, match=message):
        call(common())


def test_the_result_prints_and_draws():
    p = mb.aero.performance(mb.aero.rotor(common()), [4.0, 7.0, 11.0])
    assert "largest power coefficient" in str(p) and "estimated error" in str(p)
    assert len(p.plot().axes[0].lines) == 2
    assert p.stats.counts["section_solutions"] == 3 * 120 and p.stats.wall_time > 0


def test_examples_of_docstrings():
    found = doctest.testmod(mbrs.aero.steady_rotors)
    assert found.attempted > 0 and found.failed == 0
