"""Motion in time of matrices with nonlinear elements, against equations written here and SciPy."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from scipy.integrate import solve_ivp

rng = np.random.default_rng(7)
N = 4
A = rng.normal(size=(N, N))
MASS = A @ A.T + np.diag([2.0, 3.0, 1.0, 4.0])
B = rng.normal(size=(N, N))
STIFFNESS = B @ B.T + 5.0 * np.eye(N)
# one direction is excited by its own velocity, one pushed away by its own displacement
DAMPING = 0.3 * np.eye(N) - 0.9 * np.outer(A[0], A[0]) / (A[0] @ A[0])
STIFFNESS = STIFFNESS - 9.0 * np.outer(B[:, 1], B[:, 1]) / (B[:, 1] @ B[:, 1])
SKEW = rng.normal(size=(N, N))
GYROSCOPIC, CIRCULATORY = SKEW - SKEW.T, 0.1 * (A - A.T)
W = rng.normal(size=(4, N))
F = rng.normal(size=N)
X0, V0 = 0.3 * rng.normal(size=N), rng.normal(size=N)
T = 3.0


def laws(scale):
    return [
        mb.Cubic(2.0, w=W[0] / scale),
        mb.CoulombTanh(0.7, 0.4, w=W[1] / scale),
        mb.VanDerPol(1.5, w=W[2] / scale),
        mb.FunctionLaw(lambda t, u, v: 0.4 * np.sin(3.0 * t) * u + 0.1 * v * u**2, w=W[3] / scale),
    ]


def system(scale=None):
    """In units of its own for each coordinate: x = y / scale."""
    d = np.ones(N) if scale is None else scale
    change = np.outer(1.0 / d, 1.0 / d)
    return mb.MechanicalSystem(
        MASS * change,
        DAMPING * change,
        STIFFNESS * change,
        G=GYROSCOPIC * change,
        N=CIRCULATORY * change,
        elements=laws(d),
    )


def rate(t, y):
    x, v = y[:N], y[N:]
    u, du = W @ x, W @ v
    f = [
        2.0 * u[0] ** 3,
        0.7 * np.tanh(du[1] / 0.4),
        1.5 * u[2] ** 2 * du[2],
        0.4 * np.sin(3 * t) * u[3] + 0.1 * du[3] * u[3] ** 2,
    ]
    push = F * np.cos(2.0 * t) + np.eye(N)[1] * 0.5
    total = push - (DAMPING + GYROSCOPIC) @ v - (STIFFNESS + CIRCULATORY) @ x - W.T @ f
    return np.concatenate([v, np.linalg.solve(MASS, total)])


@pytest.fixture(scope="module")
def exact():
    return solve_ivp(
        rate, (0, T), np.concatenate([X0, V0]), method="DOP853", rtol=1e-13, atol=1e-14, dense_output=True
    ).sol


LOADS = [(F, lambda t: np.cos(2.0 * t)), ("x1", 0.5)]


@pytest.mark.some(3)
@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("auto", {"rtol": 1e-6}),
        ("radau", {"rtol": 1e-7}),
        ("bdf", {"rtol": 1e-7}),
        ("generalized-alpha", {"step": 5e-3}),
        ("ali3p", {"step": 5e-3}),
    ],
)
def test_all_matrices_and_laws(method, options, exact):
    y = mb.simulate(system(), T, loads=LOADS, x0=X0, v0=V0, method=method, **options)
    size = np.abs(y.displacement).max(axis=1)
    off = np.abs(y.displacement - exact(y.t)[:N]).max(axis=1) / size
    assert y.status == "finished" and y.t[-1] == T and y.outputs == ("x0", "x1", "x2", "x3")
    assert np.all(off < 3e-4) and np.all(off < 4.0 * y.error) and np.all(y.error < 200.0 * off)
    np.testing.assert_allclose(y.velocity, exact(y.t)[N:], atol=1e-3 * np.abs(y.velocity).max())
    np.testing.assert_allclose(y.acceleration[:, -1], rate(T, exact(T))[N:], atol=1e-3 * np.abs(y.acceleration).max())


def test_units_of_coordinates_do_not_matter(exact):
    scale = np.array([1e-6, 1.0, 1e3, 2.5e-2])
    loads = [(F / scale, lambda t: np.cos(2.0 * t)), (np.eye(N)[1] / scale, 0.5)]
    t = np.linspace(0.0, T, 20)
    y = mb.simulate(system(scale), t, loads=loads, x0=X0 * scale, v0=V0 * scale, rtol=1e-9)
    x = y.displacement / scale[:, None]
    assert np.all(np.abs(x - exact(t)[:N]).max(axis=1) < 1e-7 * np.abs(x).max(axis=1))
    assert np.all(y.error < 1e-7)


@pytest.mark.parametrize("size", [1e-9, 1e9])
def test_the_tolerance_follows_the_size_of_the_motion(size):
    # x" + 0.1 x' + x + x^3/size^2 = size cos(t): the same motion in other units of length and force
    s = mb.MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[mb.Cubic(size**-2, w=[1.0])])
    y = mb.simulate(s, 20.0, loads={0: mb.Sine(size, 1.0, phase=np.pi / 2)}, rtol=1e-8)
    one = solve_ivp(
        lambda t, z: [z[1], np.cos(t) - 0.1 * z[1] - z[0] - z[0] ** 3],
        (0, 20),
        [0, 0],
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
    )
    assert y.displacement[0, -1] / size == pytest.approx(one.y[0, -1], abs=1e-6)
    assert 1e-12 < y.error[0] < 1e-6 and len(y.t) < 400


def test_the_orbit_of_harmonic_balance_closes():
    s = mb.examples.duffing()
    orbit = mb.harmonic_balance(s, force=[0.18], omega=1.2, harmonics=25)
    loads = {0: mb.Sine(0.18, 1.2, phase=np.pi / 2)}
    start = orbit.displacement([0.0])[:, 0], orbit.velocity([0.0])[:, 0]
    y = mb.simulate(s, orbit.period, loads=loads, x0=start[0], v0=start[1], rtol=1e-10)
    assert y.displacement[:, -1] == pytest.approx(start[0], abs=1e-9)
    assert y.velocity[:, -1] == pytest.approx(start[1], abs=1e-9)
    np.testing.assert_allclose(y.displacement, orbit.displacement(y.t), atol=1e-9)


def test_laws_with_states():
    w = np.array([0.6, -1.1])
    M, K = np.array([[2.0, 0.3], [0.3, 1.0]]), np.array([[6.0, -1.0], [-1.0, 3.0]])
    s = mb.MechanicalSystem(M, None, K, elements=[mb.Maxwell(4.0, 0.7, w=w), mb.Jenkins(5.0, 0.4, w=[0.0, 1.0])])
    y = mb.simulate(s, 4.0, x0=[0.5, -0.05], v0=[0.0, 1.0], rtol=1e-7)

    inverse = np.linalg.inv(M)

    def equations(y, slider):
        x, v, z = y[:2], y[2:4], y[4]
        u = w @ x
        f = w * 4.0 * (u - z) + np.array([0.0, 5.0 * np.clip(x[1] - slider, -0.08, 0.08)])
        return np.array([*v, *(inverse @ (-K @ x - f)), (u - z) / 0.7])

    # classical Runge-Kutta steps; the slider follows after each of them
    h, n = 1e-3, 4000
    z, slider = np.array([0.5, -0.05, 0.0, 1.0, w @ [0.5, -0.05]]), 0.0
    for _ in range(n):
        a = equations(z, slider)
        b = equations(z + 0.5 * h * a, slider)
        c = equations(z + 0.5 * h * b, slider)
        z = z + h / 6.0 * (a + 2.0 * b + 2.0 * c + equations(z + h * c, slider))
        slider = z[1] - np.clip(z[1] - slider, -0.08, 0.08)
    assert abs(slider) > 0.02
    assert y.displacement[:, -1] == pytest.approx(z[:2], abs=1e-5)


def test_what_belongs_to_the_other_kind_is_refused_by_name():
    s = system()
    with pytest.raises(mb.ModelError, match=r"nonlinear elements, Cubic.*mb\.simulate\(system"):
        mb.response(s, [0.0, 1.0], {0: np.cos}, 0)
    parametric = mb.MechanicalSystem([[1.0]], None, [[1.0]], elements=[mb.VaryingStiffness(0.1, w=[1.0])])
    with pytest.raises(mb.ModelError, match=r"elements\[0\].*FunctionLaw"):
        mb.simulate(parametric, 1.0, x0=[1.0])
    with pytest.raises(mb.ModelError, match="x0 must have the shape \\(4,\\)"):
        mb.simulate(s, 1.0, x0=[1.0])
    with pytest.raises(mb.ModelError, match="mass matrix M that is symmetric and positive definite"):
        mb.simulate(mb.MechanicalSystem(np.diag([1.0, 0.0]), None, np.eye(2)), 1.0)
    with pytest.raises(mb.ModelError, match="at= belongs to motions of a Model"):
        mb.simulate(s, 1.0, at=mb.examples.four_bar())
    with pytest.raises(mb.ModelError, match="x0= belongs to motions of a MechanicalSystem"):
        mb.simulate(mb.examples.four_bar(), 1.0, x0=[0.0])


def test_a_motion_that_stops_keeps_what_it_has():
    s = mb.MechanicalSystem([[1.0]], None, [[1.0]], elements=[mb.Cubic(-1.0, w=[1.0])])
    with pytest.raises(mb.ConvergenceError) as stopped:
        mb.simulate(s, 50.0, x0=[2.0])  # x" = x^3 - x: infinity in finite time
    assert stopped.value.result.displacement[0, -1] > 10.0
    assert np.isinf(stopped.value.result.error[0])


def test_a_slider_that_the_start_overloads_has_slipped():
    # x" + clip(5 (x - z), 0.4) = 0 from x = -0.2 with z = -0.12 at once, so that it springs back by 0.08 and goes on
    s = mb.MechanicalSystem([[1.0]], None, [[0.0]], elements=[mb.Jenkins(5.0, 0.4, w=[1.0])])
    y = mb.simulate(s, 0.3, x0=[-0.2], rtol=1e-9)
    assert y.displacement[0, -1] == pytest.approx(-0.12 - 0.08 * np.cos(np.sqrt(5.0) * 0.3), abs=1e-8)
