"""Time response and state space against closed forms, SciPy's exact discretisation and high-order integration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mbrs.errors import ModelError, NameNotFoundError, SingularError
from mbrs.linear.matrices import MechanicalSystem
from mbrs.linear.response import response, response_sensitivity
from mbrs.linear.state_space import state_space
from problems import spring_row
from scipy.signal import lsim


def random_system(rng, n, damping=0.2, gyroscopic=False):
    """Invented."""
    X, Y, W, Q = (rng.normal(size=(n, n)) for _ in range(4))
    G = 0.3 * (Q - Q.T) if gyroscopic else None
    return MechanicalSystem(X @ X.T / n + np.eye(n), damping * W @ W.T / n, Y @ Y.T + 0.5 * np.eye(n), G=G)


def first_order_hold(system, t, u, port_in, port_out, x0=None):
    """SciPy's own piecewise linear simulation of the same system."""
    A, B, C, D = state_space(system, port_in, port_out)
    _, y, _ = lsim((A, B, C, D), u, t, X0=np.zeros(2 * system.n) if x0 is None else x0, interp=True)
    return y


def harmonic(system, t, omega, j, i):
    """Exact response at coordinate i to sin(omega t) on coordinate j from rest, by complex modes in the time domain."""
    n = system.n
    D = sum((a for a in (system.C, system.G) if a is not None), np.zeros((n, n)))
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(system.M, system.K), -np.linalg.solve(system.M, D)]])
    s, V = np.linalg.eig(A)
    b = np.linalg.solve(V, np.concatenate([np.zeros(n), np.linalg.solve(system.M, np.eye(n)[:, j])]))
    # integral of e^{s (t - r)} e^{i w r}: (e^{iwt} - e^{st}) / (i w - s); its imaginary combination gives the sine
    plus = b[:, None] * (np.exp(1j * omega * t) - np.exp(s[:, None] * t)) / (1j * omega - s[:, None])
    minus = b[:, None] * (np.exp(-1j * omega * t) - np.exp(s[:, None] * t)) / (-1j * omega - s[:, None])
    return (V[i] @ ((plus - minus) / 2j)).real


def test_step_on_one_mass_is_the_closed_form():
    m, c, k = 2.0, 0.4, 8.0
    w0 = math.sqrt(k / m)
    zeta = c / (2 * m * w0)
    wd = w0 * math.sqrt(1 - zeta**2)
    t = np.linspace(0.0, 20.0, 301)
    y = response(MechanicalSystem([[m]], [[c]], [[k]]), t, {0: np.ones_like(t)}, 0)
    decay = np.exp(-zeta * w0 * t)
    expected = (1 - decay * (np.cos(wd * t) + zeta * w0 / wd * np.sin(wd * t))) / k
    np.testing.assert_allclose(y.value[0], expected, atol=1e-14)
    np.testing.assert_allclose(y.velocity[0], decay * np.sin(wd * t) / (m * wd), atol=1e-14)
    np.testing.assert_allclose(m * y.acceleration[0] + c * y.velocity[0] + k * y.value[0], 1.0, atol=1e-13)
    assert y.error[0] < 1e-14


@pytest.mark.parametrize("zeta", [0.0, 1e-6, 0.5, 1.0, 3.0, 1e3])
def test_free_motion_at_every_damping(zeta):
    t = np.linspace(0.0, 5.0, 41)
    y = response(MechanicalSystem([[1.0]], [[2 * zeta]], [[1.0]]), t, {}, 0, x0=[1.0], v0=[-0.3])
    s = np.roots([1.0, 2 * zeta, 1.0]).astype(complex)
    if zeta == 1.0:
        expected = np.exp(-t) * (1.0 + 0.7 * t)
    else:
        a = (-0.3 - s[1]) / (s[0] - s[1])
        expected = (a * np.exp(s[0] * t) + (1 - a) * np.exp(s[1] * t)).real
    np.testing.assert_allclose(y.value[0], expected, atol=2e-12)


@pytest.mark.parametrize("n", [1, 2, 6, 40])
@pytest.mark.parametrize("gyroscopic", [False, True])
def test_piecewise_linear_loads_are_exact(n, gyroscopic):
    rng = np.random.default_rng([n, gyroscopic])
    s = random_system(rng, n, gyroscopic=gyroscopic)
    t = np.linspace(0.0, 6.0, 61)
    u = rng.normal(size=(61, 2))
    x0, v0 = rng.normal(size=n), rng.normal(size=n)
    a, b = rng.normal(size=n), rng.normal(size=n)
    y = response(s, t, [(a, u[:, 0]), (b, u[:, 1])], list(range(n)), x0=x0, v0=v0)
    expected = first_order_hold(s, t, u, np.column_stack([a, b]), np.eye(n), np.concatenate([x0, v0]))
    expected = expected.reshape(61, n)
    measured = np.abs(y.value.T - expected).max() / np.abs(expected).max()
    print(f"n={n} gyroscopic={gyroscopic}: {measured:.1e} from SciPy, route {y.stats.route}")
    assert measured < 1e-11
    assert y.stats.counts["propagators"] == y.stats.counts["blocks"]


def test_large_system_takes_uncoupled_modes():
    rng = np.random.default_rng(1)
    n = 40
    s = MechanicalSystem(np.eye(n), np.diag(rng.uniform(0.01, 0.1, n)), spring_row(np.ones(n)))
    t = np.linspace(0.0, 30.0, 101)
    y = response(s, t, {0: np.sin(t)}, [0, 20])
    assert y.stats.route == "complex modes"
    expected = first_order_hold(s, t, np.sin(t), 0, [0, 20])
    assert np.abs(y.value.T - expected).max() < 1e-11 * np.abs(expected).max()
    undamped = response(s, t, {0: np.sin(t)}, [0, 20], without=("damping",))
    assert undamped.stats.route == "real modes"
    assert not np.allclose(undamped.value, y.value)


def test_defective_state_matrix_takes_the_exponential():
    s = MechanicalSystem(np.eye(2), 2.0 * np.eye(2), np.eye(2), N=[[0.0, 0.5], [-0.5, 0.0]])
    t = np.linspace(0.0, 4.0, 21)
    y = response(s, t, {0: np.cos(t)}, [0, 1])
    assert y.stats.route == "exponential"
    expected = first_order_hold(s, t, np.cos(t), 0, [0, 1])
    assert np.abs(y.value.T - expected).max() < 1e-13


def test_uneven_times_give_the_same_motion():
    rng = np.random.default_rng(4)
    s = random_system(rng, 3)
    coarse = np.sort(rng.uniform(0.0, 5.0, 12))
    fine = np.union1d(coarse, np.linspace(coarse[0], coarse[-1], 57))
    u = rng.normal(size=12)
    a = response(s, coarse, {0: u}, [0, 1, 2])
    b = response(s, fine, {0: np.interp(fine, coarse, u)}, [0, 1, 2])
    np.testing.assert_allclose(b.value[:, np.isin(fine, coarse)], a.value, atol=1e-12)
    uniform = response(s, np.linspace(0.0, 5.0, 500), {0: np.ones(500)}, 0)
    assert uniform.stats.counts["propagators"] == 1


def test_rigid_modes_drift():
    """A free mass under a constant force: t^2 / 2m and nothing infinite."""
    t = np.linspace(0.0, 10.0, 11)
    y = response(MechanicalSystem([[2.0]], None, [[0.0]]), t, {0: np.ones(11)}, 0)
    np.testing.assert_allclose(y.value[0], t**2 / 4, rtol=1e-13)
    pair = MechanicalSystem(np.eye(2), 0.1 * np.array([[1.0, -1.0], [-1.0, 1.0]]), [[1.0, -1.0], [-1.0, 1.0]])
    y = response(pair, t, {0: np.ones(11)}, [0, 1])
    np.testing.assert_allclose(y.value.mean(axis=0), t**2 / 4, rtol=1e-12)


def test_stiffness_ratio_1e12_and_steps_longer_than_periods():
    k = 1e12
    s = MechanicalSystem(np.eye(2), None, [[k + 1.0, -k], [-k, k + 1.0]])
    t = np.linspace(0.0, 3.0, 31)
    y = response(s, t, {0: np.ones(31), 1: np.ones(31)}, [0, 1])
    # symmetric loads see the soft mode only: y = 1 - cos t
    measured = np.abs(y.value - (1 - np.cos(t))).max()
    print(f"stiffness ratio 1e12: {measured:.1e}")
    assert measured < 1e-3  # eps * 2e12 = 4e-4 is what the entries of K leave of the soft spring


def test_base_motion_history_through_the_core():
    """Absolute motion of one mass over a displacement history of its base: second order in the step, and estimated."""
    from mbrs import _core

    m, c, k, w = 2.0, 0.4, 8.0, 1.3
    one = np.ones((1, 1))
    system = _core.SecondOrder(m * one, c * one, None, k * one, None)
    free = np.roots([m, c, k])
    errors = []
    for n_t in (1001, 2001):
        t = np.linspace(0.0, 30.0, n_t)
        u = np.sin(w * t)[None, :]
        bulge = (np.sin(w * (t[1:] + t[:-1]) / 2) - (u[0, 1:] + u[0, :-1]) / 2)[None, :]
        raw = system.response((one, -m * one, np.array([2]), one), (t, u, bulge, np.zeros(1), np.zeros(1)))
        H = (k + 1j * w * c) / (k + 1j * w * c - w * w * m)
        # absolute rest at t = 0, and the base moves without a jump
        a = np.linalg.solve(np.array([[1, 1], free]), -np.array([H.imag, (1j * w * H).imag]))
        exact = (H * np.exp(1j * w * t)).imag + (a[0] * np.exp(free[0] * t) + a[1] * np.exp(free[1] * t)).real
        true = np.abs(raw["displacement"][0] - exact).max()
        assert 0.8 < true / np.abs(raw["displacement_error"]).max() < 1.25
        errors.append(true)
    print(f"base motion: errors {errors[0]:.1e}, {errors[1]:.1e}")
    assert 3.9 < errors[0] / errors[1] < 4.1


def test_the_estimate_is_the_error_of_the_interpolated_load():
    """true/estimated in [.01, 10] in 95 % of 200 random systems under sine loads, from closed forms."""
    rng = np.random.default_rng(17)
    good = 0
    for case in range(200):
        n = int(rng.integers(1, 6))
        s = random_system(rng, n, damping=10.0 ** rng.uniform(-2, 0.5), gyroscopic=case % 2 == 0)
        omega = rng.uniform(0.5, 5.0)
        t = np.linspace(0.0, 10.0, int(rng.integers(30, 400)))
        i, j = rng.integers(0, n, 2)
        as_array = case % 4 == 1
        load = np.sin(omega * t) if as_array else (lambda r, w=omega: np.sin(w * r))
        y = response(s, t, {int(j): load}, int(i))
        true = np.abs(y.value[0] - harmonic(s, t, omega, j, i)).max() / np.abs(y.value[0]).max()
        good += 0.01 <= true / y.error[0] <= 10.0
    print(f"estimates within [.01, 10]: {good} of 200")
    assert good >= 190


@pytest.mark.parametrize("kind", ["displacement", "velocity", "acceleration"])
def test_sensitivity_against_differences(kind):
    rng = np.random.default_rng(9)
    n = 3
    s = random_system(rng, n)
    dM, dD, dS = (x + x.transpose(1, 0, 2) for x in (0.1 * rng.normal(size=(n, n, 2)) for _ in range(3)))
    a, da = rng.normal(size=n), rng.normal(size=(n, 1, 2))
    c, dc = rng.normal(size=n), rng.normal(size=(1, n, 2))
    t = np.linspace(0.0, 4.0, 41)
    u = rng.normal(size=41)
    x0, v0 = rng.normal(size=n), rng.normal(size=n)

    def at(p, e):
        moved = MechanicalSystem(s.M + e * dM[..., p], s.C + e * dD[..., p], s.K + e * dS[..., p])
        force, output = a + e * da[:, 0, p], c + e * dc[0, :, p]
        return response(moved, t, [(force, u)], output, kind=kind, x0=x0, v0=v0).value

    base = response(s, t, [(a, u)], c, kind=kind, x0=x0, v0=v0)
    result = response_sensitivity(base, ["p", "q"], dM=dM, dD=dD, dS=dS, dF=da, dL=dc)
    for p in range(2):
        e = 1e-3
        # sixth-order central differences
        terms = [(45, 1), (-9, 2), (1, 3)]
        expected = sum(b * (at(p, k * e) - at(p, -k * e)) for b, k in terms) / (60 * e)
        measured = np.abs(result.value[:, :, p] - expected).max() / np.abs(expected).max()
        print(f"{kind}, parameter {p}: {measured:.1e} from differences")
        assert measured < 1e-8


def test_functions_need_not_take_arrays():
    s = MechanicalSystem([[1.0]], None, [[1.0]])
    t = np.linspace(0.0, 2.0, 21)
    loads = [lambda r: math.sin(r), lambda r: 1.0 if r < 1.0 else 0.0, lambda r: 2.0, lambda r: np.sin(r)]
    values = [response(s, t, {0: f}, 0).value for f in loads]
    np.testing.assert_allclose(values[0], values[3], atol=1e-15)
    np.testing.assert_allclose(values[2][0], 2 * (1 - np.cos(t)), atol=1e-14)


@pytest.mark.parametrize(
    "call, error, text",
    [
        (lambda s: response(s, [0.0], {0: np.ones(1)}, 0), ModelError, "at least 2 times"),
        (lambda s: response(s, [0.0, 0.0], {0: np.ones(2)}, 0), ModelError, "increase"),
        (lambda s: response(s, [0.0, np.nan], {0: np.ones(2)}, 0), ModelError, "finite"),
        (lambda s: response(s, "soon", {0: np.ones(2)}, 0), ModelError, "times"),
        (
            lambda s: response(s, [0.0, 1.0], {0: np.ones(3)}, 0),
            ModelError,
            r"load on x0 must .* \(3,\); give one value for",
        ),
        (lambda s: response(s, [0.0, 1.0], {0: [1.0, np.nan]}, 0), ModelError, "NaN"),
        (lambda s: response(s, [0.0, 1.0], {0: lambda t: 1 / 0}, 0), ZeroDivisionError, "division"),
        (lambda s: response(s, [0.0, 1.0], {0: lambda t: "x"}, 0), ModelError, "one number"),
        (lambda s: response(s, [0.0, 1.0], {0: lambda t: float("nan")}, 0), ModelError, "not finite"),
        (lambda s: response(s, [0.0, 1.0], {"y": np.ones(2)}, 0), NameNotFoundError, "'y'"),
        (lambda s: response(s, [0.0, 1.0], 3.0, 0), ModelError, "loads must be"),
        (
            lambda s: response(s, [0.0, 1.0], {0: np.ones(2)}, 0, x0=[1.0]),
            ModelError,
            r"x0 must have the shape \(2,\)",
        ),
        (lambda s: response(s, [0.0, 1.0], {0: np.ones(2)}, 0, kind="jerk"), ModelError, "kind"),
    ],
)
def test_wrong_input_is_named(call, error, text):
    with pytest.raises(error, match=text):
        call(MechanicalSystem(np.eye(2), K=np.eye(2)))


def test_massless_coordinates_are_named():
    with pytest.raises(SingularError, match="coordinate 1"):
        response(MechanicalSystem(np.diag([1.0, 0.0]), K=np.eye(2)), [0.0, 1.0], {0: np.ones(2)}, 0)
    with pytest.raises(SingularError, match="'x1'"):
        state_space(MechanicalSystem(np.diag([1.0, 0.0]), K=np.eye(2)), 0, 0)


@pytest.mark.parametrize("kind, power", [("displacement", 0), ("velocity", 1), ("acceleration", 2)])
def test_state_space_has_the_transfer_function(kind, power):
    from mbrs.linear.frf import frf

    rng = np.random.default_rng(2)
    s = random_system(rng, 4, gyroscopic=True)
    ss = state_space(s, [0, 2], [1, 3], kind=kind)
    A, B, C, D = ss
    omega = np.linspace(0.2, 4.0, 9)
    names = ("receptance", "mobility", "accelerance")
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        h = frf(s, [0, 2], [1, 3], omega=omega, kind=names[power])
    H = np.stack([C @ np.linalg.solve(1j * w * np.eye(8) - A, B) + D for w in omega], axis=-1)
    np.testing.assert_allclose(h.value, H, rtol=1e-10)
    assert ss.inputs == ("x0", "x2") and ss.outputs == ("x1", "x3") and ss.states[4] == "d/dt x0"


def test_state_space_converts():
    s = MechanicalSystem([[2.0]], [[0.4]], [[8.0]], coordinates=["z"])
    ss = state_space(s, "z", "z")
    control = ss.to_control()
    assert control.input_labels == ["z"] and control.nstates == 2
    assert abs(control(2j) - 1 / (0.8j)) < 1e-14
    assert ss.to_scipy().A.shape == (2, 2)


def test_result_prints_labels_and_pickles(tmp_path):
    import pickle

    s = MechanicalSystem(np.eye(2), None, [[2.0, -1.0], [-1.0, 2.0]], coordinates=["left", "right"])
    y = response(s, np.linspace(0, 1, 5), {"left": np.ones(5)}, ["left", "right"])
    assert "right" in str(y)
    assert y.to_xarray().displacement.dims == ("output", "t")
    again = pickle.loads(y.save(tmp_path / "y.pkl").read_bytes())
    np.testing.assert_array_equal(again.value, y.value)
