"""Harmonic balance of functions of several coordinates: against laws of one coordinate, linear algebra, and motion in time."""

import mbrs as mb
import numpy as np
import pytest
from mbrs import ModelError
from mbrs.nonlinear.system import nonlinear_system
from scipy.integrate import solve_ivp

# directions that are those of no coordinate, and cubic springs along them
TURNED = np.array([[0.62, -0.41, 0.17], [0.23, 0.77, -0.35]])
STIFF = np.array([0.83, 0.37])
MIX = np.array([[0.6, 1.3], [-0.9, 0.45]])


def matrices():
    """M, C, K of three coupled coordinates, none of which is a mode."""
    rng = np.random.default_rng(41)
    A, B = rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    M, K = A @ A.T + 1.7 * np.eye(3), B @ B.T + 2.3 * np.eye(3)
    return M, 0.06 * M + 0.03 * K, K


def springs():
    """Cubic springs along MIX @ TURNED as laws of one coordinate."""
    return [mb.Cubic(k, w=w) for k, w in zip(STIFF, MIX @ TURNED, strict=True)]


def joined(derivatives=None):
    """The same springs as one function of the two coordinates along TURNED."""

    def force(t, u, v):
        s = [MIX[i, 0] * u[0] + MIX[i, 1] * u[1] for i in range(2)]
        f = [STIFF[i] * s[i] ** 3 for i in range(2)]
        return np.array([MIX[0, j] * f[0] + MIX[1, j] * f[1] for j in range(2)])

    return mb.FunctionLaw(force, derivatives, w=TURNED)


def slopes(t, u, v):
    s = [MIX[i, 0] * u[0] + MIX[i, 1] * u[1] for i in range(2)]
    k = [3 * STIFF[i] * s[i] ** 2 for i in range(2)]
    by_u = [[sum(MIX[i, a] * MIX[i, b] * k[i] for i in range(2)) for b in range(2)] for a in range(2)]
    return by_u, np.zeros((2, 2))


FORCE = np.array([1.9, -0.7, 1.1])


@pytest.mark.parametrize("law", [joined(), joined(slopes)], ids=["traced", "called"])
@pytest.mark.parametrize("condense", [False, True])
def test_a_function_of_two_coordinates_is_the_springs_that_it_holds(law, condense):
    M, C, K = matrices()
    options = {"omega": (0.5, 2.4), "harmonics": 5, "condense": condense, "tol": 1e-2}
    one = mb.frequency_response(mb.MechanicalSystem(M, C, K, elements=springs()), force=FORCE, **options)
    other = mb.frequency_response(mb.MechanicalSystem(M, C, K, elements=[law]), force=FORCE, **options)
    assert one.status == other.status and len(one) > 10
    peaks = [curve.peak(0) for curve in (one, other)]
    assert abs(peaks[0].omega - peaks[1].omega) < 1e-7
    assert np.max(np.abs(peaks[0].X - peaks[1].X)) < 1e-7 * np.max(np.abs(peaks[0].X))
    assert sorted({e.kind for e in one.events}) == sorted({e.kind for e in other.events})
    for w in (0.7, 1.31, 2.2):
        a, b = (
            mb.harmonic_balance(mb.MechanicalSystem(M, C, K, elements=e), omega=w, force=FORCE, harmonics=7)
            for e in (springs(), [law])
        )
        assert np.max(np.abs(a.X - b.X)) < 1e-9 * np.max(np.abs(a.X)), w
        assert np.max(np.abs(np.sort_complex(a.multipliers) - np.sort_complex(b.multipliers))) < 1e-6
        assert b.verify() < 1e-5


def test_a_linear_function_is_its_matrices():
    """Unsymmetric slopes by displacements and rates, with the exact transfer function and exponents beside it."""
    M, C, K = matrices()
    S, D = np.array([[0.9, 0.4], [-0.7, 0.3]]), np.array([[0.11, -0.2], [0.26, 0.05]])
    law = mb.FunctionLaw(lambda t, u, v: S @ u + D @ v, w=TURNED)
    system = mb.MechanicalSystem(M, C, K, elements=[law])
    full = (M, C + TURNED.T @ D @ TURNED, K + TURNED.T @ S @ TURNED)
    for w in (0.61, 1.47, 3.3):
        made = mb.harmonic_balance(system, omega=w, force=FORCE, harmonics=3)
        x = np.linalg.solve(full[2] - w**2 * full[0] + 1j * w * full[1], FORCE)
        assert np.max(np.abs(made.X[:, 1] - 1j * made.X[:, 2] - x)) < 1e-11 * np.max(np.abs(x))
        A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, full[2]), -np.linalg.solve(M, full[1])]])
        exact = np.exp(np.linalg.eigvals(A) * made.period)
        assert np.max(np.abs(np.sort_complex(made.multipliers) - np.sort_complex(exact))) < 1e-7


def test_two_frequencies():
    M, C, K = matrices()
    forces = [{"force": FORCE, "omega": 0.83}, {"force": [0.3, 0.9, -0.5], "omega": 1.37}]
    one, other = (
        mb.quasi_periodic(mb.MechanicalSystem(M, C, K, elements=e), forces, harmonics=4)
        for e in (springs(), [joined()])
    )
    assert np.max(np.abs(one.X - other.X)) < 1e-7 * np.max(np.abs(one.X))


def carried(law):
    """A body on an inclined bushing, drawn off its equilibrium, whose law sees two of its coordinates."""
    m = mb.Model("carried", gravity=(1.3, -2.9, -9.17))
    b = m.body("b", mass=2.37, com=(0.03, -0.02, 0.05), inertia=(0.031, 0.027, 0.043))
    m.bushing(
        "pad",
        m.ground,
        b,
        at=(0.11, -0.07, 0.23),
        orientation=mb.rotation([0.48, -0.6, 0.64], 0.73),
        k=(913.0, 1277.0, 1731.0, 41.0, 37.0, 53.0),
        c=(3.1, 2.7, 4.3, 0.11, 0.13, 0.09),
        law={("x", "z"): law},
    )
    return m, b


def pulled(t, u, v):
    """Springs that see each other, and friction-like rates that are not symmetric."""
    return np.array(
        [
            4.1e5 * u[0] * u[1] ** 2 + 310.0 * u[1] + 0.7 * v[1],
            2.7e5 * u[1] ** 3 + 1.9e5 * u[0] ** 2 * u[1] - 120.0 * u[0] + 60.0 * u[1] ** 2 * v[0],
        ]
    )


def pulled_slopes(t, u, v):
    by_u = [
        [4.1e5 * u[1] ** 2, 8.2e5 * u[0] * u[1] + 310.0],
        [3.8e5 * u[0] * u[1] - 120.0, 8.1e5 * u[1] ** 2 + 1.9e5 * u[0] ** 2 + 120.0 * u[1] * v[0]],
    ]
    return by_u, [[0.0, 0.7], [60.0 * u[1] ** 2, 0.0]]


@pytest.mark.parametrize("derivatives", [None, pulled_slopes], ids=["traced", "called"])
def test_a_bushing_with_a_law_of_two_coordinates(derivatives):
    """About a strained equilibrium: the period in time of the very equations, by SciPy and without the core's samples."""
    m, _ = carried(mb.FunctionLaw(pulled, derivatives))
    at = mb.equilibrium(m)
    assert max(abs(x) for x in at.state.q) > 1e-3
    omega = 0.83 * mb.modes(m, at=at).omega[2]
    made = mb.harmonic_balance(
        m, omega=omega, inputs=["b.force.x", "b.force.z"], amplitude=[3.3, 5.1], at=at, harmonics=9
    )
    assert made.status == "converged" and made.error < 1e-6
    told = made.verify()
    assert told.balanced < 1e-6 and told.full < 0.05
    system = nonlinear_system(m, at=at)
    (law,) = system.elements
    W, u0 = law.directions, law.u0
    C = system.C + (0 if system.G is None else system.G)
    K = system.K + (0 if system.N is None else system.N)
    n, f0 = system.n, pulled(0.0, u0, np.zeros(2))
    load = made.force if isinstance(made.force, np.ndarray) else made.force[1]

    def rate(t, y):
        x, v = y[:n], y[n:]
        push = (load * np.exp(1j * omega * t)).real - W.T @ (pulled(t, u0 + W @ x, W @ v) - f0)
        return np.concatenate([v, np.linalg.solve(system.M, push - C @ v - K @ x)])

    start = np.concatenate([made.displacement(0.0)[:, 0], made.velocity(0.0)[:, 0]])
    run = solve_ivp(rate, (0, made.period), start, rtol=1e-11, atol=1e-13, method="DOP853")
    assert np.max(np.abs(run.y[:, -1] - start)) < 1e-5 * np.max(np.abs(start))


def test_a_function_of_time_is_refused():
    for derivatives in (None, lambda t, u, v: (np.eye(2), np.zeros((2, 2)))):
        m, _ = carried(mb.FunctionLaw(lambda t, u, v: np.array([u[0] + t, u[1]]), derivatives))
        with pytest.raises(ModelError, match=r"'pad' depends on the time t.*VaryingStiffness"):
            mb.harmonic_balance(m, omega=3.0, inputs="b.force.x", at=mb.equilibrium(m))


def test_directions_fit_the_system():
    M, C, K = matrices()
    with pytest.raises(ModelError, match="w has 2 entries but the system 3"):
        law = mb.FunctionLaw(lambda t, u, v: u, w=TURNED[:, :2])
        mb.harmonic_balance(mb.MechanicalSystem(M, C, K, elements=[law]), omega=1.0, force=FORCE)
    with pytest.raises(ModelError, match="w is zero"):
        mb.FunctionLaw(lambda t, u, v: u, w=[[1.0, 0.0], [0.0, 0.0]])


def test_matrices_with_a_function_move_in_time():
    """The response of the system in time against SciPy's."""
    M, C, K = matrices()
    t = np.linspace(0.0, 6.3, 64)
    load = lambda s: 2.3 * np.sin(1.9 * s)  # noqa: E731
    w = np.array([0.4, -0.9, 0.3])
    made = mb.simulate(mb.MechanicalSystem(M, C, K, elements=[joined()]), t, loads=[(w, load)], rtol=1e-9)
    F = joined()

    def rate(s, y):
        x, v = y[:3], y[3:]
        return np.concatenate([v, np.linalg.solve(M, w * load(s) - C @ v - K @ x - TURNED.T @ F.force(TURNED @ x))])

    exact = solve_ivp(rate, (0, 6.3), np.zeros(6), t_eval=t, rtol=1e-12, atol=1e-13, method="DOP853").y[:3]
    assert np.max(np.abs(made.displacement - exact)) < 1e-7 * np.max(np.abs(exact))
