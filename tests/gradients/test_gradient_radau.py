"""Gradients of Radau's method: every scene, hand-written equations of inconvenient models, order, stiff springs, checkpoints."""

import mbrs as mb
import numpy as np
import pytest
from gradient_scenes import SCENES
from mbrs.examples import five_bar
from motion_models import open_chain, silent, spatial_loop
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from test_gradient import FIVE_BAR, LENGTHS, differences, drift, everything, worst
from test_gradient_hand import against_direct

RADAU = {"scheme": "radau"}
SKEW = np.array([0.48, 0.64, -0.6])


@pytest.mark.some(12)
@pytest.mark.parametrize("name", SCENES)
def test_adjoint_is_direct_in_every_scene(name):
    error = against_direct(silent(SCENES[name]), "radau")
    print(f"{name}: adjoint - direct {error:.1e}")
    assert error < 1e-9


def two_masses(stiff, soft, mass):
    """Two masses on oblique rails in a line, the first held by a stiff spring, the second by a soft one."""
    m = mb.Model("two masses")
    a = m.body("a", mass=m.parameter("mass", mass), inertia=(1, 1, 1), at=(0, 0, 0))
    b = m.body("b", mass=1.7, inertia=(1, 1, 1), at=SKEW, velocity=0.6 * SKEW)
    m.prismatic("near", m.ground, a, at=(0, 0, 0), axis=SKEW, k=m.parameter("stiff", stiff), c=3e-4 * stiff)
    m.prismatic("far", a, b, at=SKEW, axis=SKEW, k=m.parameter("soft", soft), c=0.1)
    return m


def two_masses_by_hand(stiff, soft, mass, t):
    """Place and speed of the second mass along the rail."""
    M = np.array([[mass, 0.0], [0.0, 1.7]], dtype=complex)
    K = np.array([[stiff + soft, -soft], [-soft, soft]], dtype=complex)
    C = np.array([[3e-4 * np.real(stiff) + 0.1, -0.1], [-0.1, 0.1]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    return (expm(A * t) @ [0.0, 0.0, 0.0, 0.6])[[1, 3]]


@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_a_stiff_spring_beside_a_soft_one_has_its_closed_form(method):
    """Steps a hundred times as long as the fast vibration lasts; the exponential of the equations, by complex steps."""
    now, t = {"stiff": 3.1e7, "soft": 5.3, "mass": 0.9}, 2.3
    goals = [
        mb.Final(lambda s: SKEW @ s.position("b") - 1.0),
        mb.Final(lambda s: SKEW @ s.velocity("b")),
    ]
    m = two_masses(**now)
    value, slope = found = mb.gradient(m, goals, list(now), t=t, rtol=1e-8, method=method, **RADAU)
    exact = np.array(
        [np.imag(two_masses_by_hand(**{**now, p: x * (1 + 1e-30j)}, t=t)) / (1e-30 * x) for p, x in now.items()]
    ).T
    sizes = np.array(list(now.values()))
    error = np.abs((slope - exact) * sizes).max() / np.abs(exact * sizes).max()
    print(
        f"{len(found.t) - 1} steps, values {np.abs(value - two_masses_by_hand(**now, t=t)).max():.1e}, slopes {error:.1e}"
    )
    assert len(found.t) < 120
    assert np.abs(value - two_masses_by_hand(**now, t=t)).max() < 1e-8
    assert error < 1e-7


CORNERS = np.array([[0.0, 0.0], [0.13, 0.81], [1.27, 1.16], [1.52, -0.11]])
ACROSS = np.linalg.qr(np.array([[0.3, -0.9, 0.4], [0.8, 0.35, 0.1], [-0.2, 0.5, 0.77]]))[0]


def four_bar(k, mass):
    """Three bars in an oblique plane with four parallel hinges, which repeat each other's rows, and a spring in the first."""
    m = mb.Model("four-bar", gravity=ACROSS @ [1.3, -8.7, 0.0])
    at = [ACROSS @ [*c, 0.0] for c in CORNERS]
    masses, inertias = [0.8, m.parameter("mass", mass), 1.1], [0.05, 0.11, 0.09]
    bars = [
        m.body(f"bar{i}", mass=masses[i], inertia=inertias[i] * np.eye(3), at=(at[i] + at[i + 1]) / 2) for i in range(3)
    ]
    ends = [m.ground, *bars, m.ground]
    springs = [{"k": m.parameter("k", k)}, {}, {}, {}]
    for i in range(4):
        m.revolute(f"hinge{i}", ends[i], ends[i + 1], at=at[i], axis=ACROSS[:, 2], **springs[i])
    return m


def four_bar_by_hand(k, mass, t):
    """Middle of the second bar in the plane at t: one equation for the angle of the first bar, by SciPy, over complex numbers."""
    lengths = np.linalg.norm(np.diff(CORNERS, axis=0), axis=1)
    first = np.arctan2(*(CORNERS[1] - CORNERS[0])[::-1])
    masses, inertias, g = np.array([0.8, mass, 1.1]), [0.05, 0.11, 0.09], np.array([1.3, -8.7])

    def closed(angle):
        """Angles of all bars, their slopes and curvatures by the first."""
        a = np.array([angle, *(np.arctan2(*d[::-1]) for d in np.diff(CORNERS, axis=0)[1:])], dtype=complex)
        for _ in range(30):
            open_ = (lengths * [np.cos(a), np.sin(a)]).sum(axis=1) - (CORNERS[3] - CORNERS[0])
            a[1:] -= np.linalg.solve((lengths * [-np.sin(a), np.cos(a)])[:, 1:], open_)
        J = lengths * np.array([-np.sin(a), np.cos(a)])
        s = np.array([1.0, *np.linalg.solve(J[:, 1:], -J[:, 0])])
        bend = -lengths * np.array([np.cos(a), np.sin(a)]) @ s**2
        return a, s, np.array([0.0, *np.linalg.solve(J[:, 1:], -bend)])

    def middles(a):
        """Of all bars, with which bar angles they turn: (bar, 2) and (bar, angle, 2)."""
        half = np.tril(np.ones((3, 3))) - 0.5 * np.eye(3)
        along, turned = lengths * np.array([np.cos(a), np.sin(a)]), lengths * np.array([-np.sin(a), np.cos(a)])
        return half @ along.T, half[:, :, None] * turned.T, -half[:, :, None] * along.T

    def slope(_, y):
        a, s, c = closed(y[0])
        _, J, B = middles(a)
        v, w = np.einsum("bax,a->bx", J, s), np.einsum("bax,a->bx", J, c) + np.einsum("bax,a->bx", B, s**2)
        inertia = masses @ np.sum(v * v, axis=1) + inertias @ s**2
        force = masses @ (v @ g) - k * (y[0] - first)
        bias = masses @ np.sum(v * w, axis=1) + inertias @ (s * c)
        return np.array([y[1], (force - bias * y[1] ** 2) / inertia])

    y = solve_ivp(slope, (0.0, t), np.array([first, 0.0], dtype=complex), method="DOP853", rtol=1e-12, atol=1e-12).y
    return middles(closed(y[0, -1])[0])[0][1]


@pytest.mark.some(1)
@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_a_closed_loop_in_an_oblique_plane(method):
    """Equations in one coordinate by hand, with complex steps of the parameters."""
    now, t = {"k": 2.3, "mass": 1.4}, 0.7
    m = silent(lambda: four_bar(**now))
    goals = [mb.Final(lambda s, i=i: ACROSS[:, i] @ s.position("bar1")) for i in range(2)]
    value, slope = mb.gradient(m, goals, list(now), t=t, rtol=1e-9, method=method, **RADAU)
    hand = [four_bar_by_hand(**{**now, p: x + 1e-20j}, t=t) for p, x in now.items()]
    print(f"values {np.abs(value - hand[0].real).max():.1e}, slopes {worst(slope, np.imag(hand).T * 1e20):.1e}")
    assert np.abs(value - hand[0].real).max() < 1e-9
    assert worst(slope, np.imag(hand).T * 1e20) < 1e-8


def place(m):
    body = m.bodies[-1].name
    return lambda s: np.sum(s.position(body) * [1.0, -2.0, 0.5])


SMOOTH = {five_bar: LENGTHS, open_chain: ["a.mass", "bush.k[1]"], spatial_loop: ["R1.at[0]", "spring.c", "crank.mass"]}


def errors_of_motion_and_derivatives(make, scheme, steps):
    """At twenty instants, and of an integral, for each step; the explicit scheme of order 8 with fine steps is exact beside them."""
    m, names = silent(make), SMOOTH[make]
    body, psi = m.bodies[-1].name, mb.Integral(place(m))

    def run(method, h):
        traj = mb.simulate(m, 0.8, step=h, method=method, parameters=names)
        found = mb.gradient(m, psi, names, t=0.8, step=h, scheme=method)
        every = (len(traj.t) - 1) // 20
        return [
            traj.position(body)[::every],
            traj.sensitivity(f"{body}.position")[::every],
            found.value,
            found.gradient,
        ]

    exact = run("explicit", 0.005)
    return [[np.linalg.norm(np.asarray(a) - b) for a, b in zip(run(scheme, h), exact, strict=True)] for h in steps]


@pytest.mark.some(1)
@pytest.mark.parametrize("make", list(SMOOTH), ids=lambda f: f.__name__)
def test_motion_and_derivatives_have_the_order_of_radau(make):
    errors = errors_of_motion_and_derivatives(make, "radau", (0.02, 0.01))
    orders = np.log2(np.divide(*errors))
    print(f"{make.__name__}: errors {errors[1]}, orders {orders}")
    assert np.all(orders > 4.7)


@pytest.mark.some(1)
@pytest.mark.parametrize("make", [open_chain, spatial_loop], ids=lambda f: f.__name__)
def test_differences_of_the_same_steps(make):
    m = silent(make)
    names = SMOOTH[make]
    psi = mb.Integral(everything(m))
    slope = mb.gradient(m, psi, names, t=0.2, step=0.02, **RADAU).gradient
    error = worst(slope, differences(m, psi, names, t=0.2, step=0.02, **RADAU))
    print(f"{make.__name__}: differences {error:.1e}")
    assert error < 1e-7


def test_the_known_gradient_and_what_the_run_says_of_it():
    found = mb.gradient(silent(five_bar), mb.Integral(drift), LENGTHS, t=1.0, rtol=1e-7, **RADAU)
    effects = np.abs(np.asarray(found.gradient) * found.where).max()
    true = np.abs((np.asarray(found.gradient) - FIVE_BAR[1.0][1]) * found.where).max() / effects
    print(f"{len(found.t) - 1} steps, error {true:.1e}, estimated {found.error:.1e}")
    assert abs(found.value - FIVE_BAR[1.0][0]) < 1e-7
    # the known gradient has eight digits
    assert true < 2.0 * found.error + 1e-8
    assert found.error < 100.0 * true + 1e-8


def test_checkpoints_give_the_same():
    """Matrices and guesses begin anew at a checkpoint: the same to what Newton's method leaves."""
    m = silent(spatial_loop)
    psi = mb.Integral(place(m))
    whole, parts = (
        mb.gradient(m, psi, SMOOTH[spatial_loop], t=0.4, step=0.02, method="adjoint", keep=keep, **RADAU)
        for keep in (2**23, 0)
    )
    assert parts.stats.counts["checkpoints"] > 1
    assert parts.gradient == pytest.approx(np.asarray(whole.gradient), rel=1e-9)


def test_a_trajectory_has_its_derivatives_over_time():
    m = silent(five_bar)
    traj = mb.simulate(m, t=0.3, step=0.01, method="radau", parameters=LENGTHS)
    goals = [mb.Final(lambda s, i=i: s.point("P2")[i]) for i in range(3)]
    final = mb.gradient(m, goals, LENGTHS, t=0.3, step=0.01, method="adjoint", **RADAU)
    assert np.allclose(traj.sensitivity("P2")[-1], final.gradient, rtol=1e-9, atol=1e-12)
