"""Laws whose state has a rate (`Maxwell`, `BoucWen`, `LuGre`) in every analysis, against equations written by hand.

A block of mass MASS slides along an axis of no special direction, so that the model is MASS u" + K u + C u' + f(u, u', z) = load,
z' = g(u, u', z). Data invented.
"""

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import ModelError
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.optimize import brentq

MASS, K, C = 1.7, 41.0, 0.3
AXIS = np.array([1.0, -2.0, 0.7]) / np.linalg.norm([1.0, -2.0, 0.7])


def maxwell(k=(31.0, 12.0), tau=(0.17, 1.9)):
    k, tau = np.array(k), np.array(tau)
    return mb.Maxwell(k, tau), lambda u, v, z: k @ (u - z), lambda u, v, z: (u - z) / tau, len(k)


def bouc_wen(k=53.0, alpha=0.2, beta=31.0, gamma=12.0, n=1.4):
    def rate(u, v, z):
        return v - beta * abs(v) * abs(z) ** (n - 1) * z - gamma * v * abs(z) ** n

    return mb.BoucWen(k, alpha, beta, gamma, n), lambda u, v, z: (alpha * k * u + (1 - alpha) * k * z)[0], rate, 1


def lugre(f_c=1.1, f_s=1.6, v_s=0.07, s0=420.0, s1=3.1, s2=0.4):
    def rate(u, v, z):
        return v - s0 * abs(v) * z / (f_c + (f_s - f_c) * np.exp(-((v / v_s) ** 2)))

    return mb.LuGre(f_c, f_s, v_s, s0, s1, s2), lambda u, v, z: (s0 * z + s1 * rate(u, v, z) + s2 * v)[0], rate, 1


LAWS = {"maxwell": maxwell, "bouc_wen": bouc_wen, "lugre": lugre}


def block(law, speed=0.0, k=K, c=C, gravity=0.0):
    m = mb.Model("block", gravity=tuple(gravity * AXIS))
    b = m.body(
        "block",
        mass=MASS,
        inertia=(0.1, 0.2, 0.3),
        at=tuple(0.4 * AXIS + (0.1, 0.2, 0.3)),
        velocity=tuple(speed * AXIS),
    )
    m.prismatic("guide", m.ground, b, at=(0.1, 0.2, 0.3), axis=tuple(AXIS), k=k, c=c, law=law)
    return m


def truth(law, t, v0=0.0, load=lambda t: 0.0, k=K, c=C, longest=0.01):
    _, force, rate, n = law

    def slope(t, y):
        u, v, z = y[0], y[1], y[2:]
        return np.concatenate([[v, (load(t) - k * u - c * v - force(u, v, z)) / MASS], rate(u, v, z)])

    start = np.concatenate([[0.0, v0], np.zeros(n)])
    return solve_ivp(slope, (0, t[-1]), start, method="LSODA", t_eval=t, rtol=1e-11, atol=1e-13, max_step=longest).y


@pytest.mark.some(8)
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("method", ["explicit", "generalized-alpha", "radau", "bdf", "ali3p", "bdf-bfgs"])
def test_every_integrator(name, method):
    law = LAWS[name]()
    t = np.linspace(0, 1.5, 31)
    loose = method in ("generalized-alpha", "ali3p")
    traj = mb.simulate(block(law[0], speed=0.8), t, rtol=1e-5 if loose else 1e-8, method=method)
    exact = truth(law, t, v0=0.8)
    error = np.abs(traj.joint("guide") - exact[0]).max() / np.abs(exact[0]).max()
    state = np.abs(traj.memory[:, : law[3]] - exact[2:].T).max() / np.abs(exact[2:]).max()
    print(f"{name} {method}: displacement {error:.1e}, state {state:.1e} in {len(traj.steps) - 1} steps")
    assert max(error, state) < (3e-4 if loose else 2e-6)


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize(("method", "order"), [("generalized-alpha", 2), ("ali3p", 2)])
def test_order_of_fixed_steps(name, method, order):
    """Before the rate changes its sign, where the laws have kinks."""
    law = LAWS[name]()
    t = np.array([0.0, 0.16])
    exact = truth(law, t, v0=0.8)[:, -1]

    def error(steps):
        traj = mb.simulate(block(law[0], speed=0.8), t, step=0.16 / steps, method=method)
        return np.array([traj.joint("guide")[-1] - exact[0], *(traj.memory[-1, : law[3]] - exact[2:])])

    coarse, fine = np.abs(error(64)), np.abs(error(128))
    measured = np.log2(coarse / fine)
    print(name, method, coarse, fine, measured)
    assert np.all((measured > order - 0.3) | (fine < 1e-11))


def test_order_of_radau_with_states():
    """Maxwell's law, whose rate is smooth."""
    law = maxwell()
    t = np.array([0.0, 0.16])
    exact = truth(law, t, v0=0.8)[:, -1]
    errors = []
    for steps in (4, 8):
        traj = mb.simulate(block(law[0], speed=0.8), t, step=0.16 / steps, method="radau")
        errors.append(np.abs([traj.joint("guide")[-1] - exact[0], *(traj.memory[-1, : law[3]] - exact[2:])]))
    measured = np.log2(errors[0] / errors[1])
    print(errors, measured)
    assert np.all(np.abs(measured - 5.0) < 0.4)


@pytest.mark.parametrize("name", LAWS)
def test_energy_goes_into_the_elements(name):
    law = LAWS[name]()
    traj = mb.simulate(block(law[0], speed=0.8), np.linspace(0, 1.0, 4001), rtol=1e-9)
    (power,), (stored,) = traj.energy.power.values(), traj.energy.stored.values()
    work = cumulative_simpson(power, x=traj.t, initial=0)
    kinetic = traj.energy.kinetic
    assert np.abs(kinetic + work - kinetic[0]).max() < 2e-6 * kinetic[0]
    dissipated = work - (stored - stored[0])
    assert np.diff(dissipated).min() > -1e-6 * kinetic[0] and dissipated[-1] > 0.05 * kinetic[0]


def test_stick_slip_of_a_pulled_block():
    """A spring whose other end moves at a constant speed drags a block of LuGre friction: it sticks and slips."""
    law = lugre()
    pull, speed = 45.0, 0.02
    t = np.linspace(0, 8.0, 161)
    traj = mb.simulate(_dragged(law[0], pull, speed), t, rtol=1e-7)
    exact = truth(law, t, load=lambda s: pull * speed * s, k=pull, c=0.0)
    error = np.abs(traj.joint("guide") - exact[0]).max() / np.abs(exact[0]).max()
    slips = np.sum(np.diff(np.sign(exact[1] - speed)) > 0)
    print(f"stick-slip: error {error:.1e}, {slips} slips, {traj.method}")
    assert slips >= 2 and error < 1e-4


def _dragged(law, pull, speed):
    m = block(law, k=pull, c=0.0)
    m.force("drag", m["block"], at=(0.1, 0.2, 0.3), value=tuple(mb.Ramp(pull * speed * a) for a in AXIS))
    return m


@pytest.mark.parametrize("name", LAWS)
def test_equilibrium_is_that_of_slow_loading(name):
    """A load that grows slowly and stays."""
    law = LAWS[name]()
    pull = 1.3
    m = block(law[0], gravity=pull / MASS, c=20.0)
    rest = mb.equilibrium(m)
    u = float(mb.simulate(m, [0.0, 1e-9], at=rest).joint("guide")[0])
    slow = 400.0
    exact = truth(
        law, np.array([0.0, slow, slow + 30.0]), load=lambda s: pull * min(s / slow, 1.0), c=20.0, longest=1.0
    )[0, -1]
    print(name, u, exact)
    assert abs(u - exact) < 2e-3 * abs(exact)
    stays = mb.simulate(m, [0.0, 2.0], at=rest, rtol=1e-9).joint("guide")
    assert np.ptp(stays) < 1e-8


def test_maxwell_in_transfer_functions():
    law, *_ = maxwell()
    k, tau = np.array([31.0, 12.0]), np.array([0.17, 1.9])
    m = block(law)
    w = np.array([0.0, 0.03, 0.7, 4.9, 21.0])
    H = mb.frf(m, m["block"].force(AXIS), m["block"].motion(AXIS), omega=w).value[0, 0]
    x = 1j * w[:, None] * tau
    exact = 1 / (K + 1j * w * C - MASS * w**2 + (k * x / (1 + x)).sum(1))
    assert np.abs(H - exact).max() < (1e-13 + 10 * jitter.level()) * np.abs(exact).max()


def state_matrix():
    k, tau = np.array([31.0, 12.0]), np.array([0.17, 1.9])
    A = np.zeros((4, 4))
    A[0, 1], A[1, 0], A[1, 1], A[1, 2:] = 1, -(K + k.sum()) / MASS, -C / MASS, k / MASS
    A[2:, 0], A[2:, 2:] = 1 / tau, -np.diag(1 / tau)
    return A


def test_maxwell_adds_its_roots():
    r = mb.modes(block(maxwell()[0]))
    exact = np.linalg.eigvals(state_matrix())
    assert len(r.roots) == 4 and np.all([np.abs(r.roots - s).min() < 1e-12 * abs(s) for s in exact])
    assert sorted(r.kind) == ["relaxation", "relaxation", "vibration"] and r.status == "converged"
    assert np.all(np.diff(r.omega) >= 0) and r.shape.shape == (1, 3) and np.all(r.error < 1e-13)


def test_maxwell_in_linear_responses():
    law = maxwell()
    m = block(law[0])
    t = np.linspace(0, 3.0, 601)
    r = mb.response(m, t, [(m["block"].force(AXIS), lambda s: np.sin(3 * s))], m["block"].motion(AXIS))
    exact = truth(law, t, load=lambda s: np.sin(3 * s))
    assert np.abs(r.displacement[0] - exact[0]).max() < 2e-4 * np.abs(exact[0]).max()
    motion = mb.simulate(m, t[::60], rtol=1e-8)
    assert np.abs(motion.joint("guide")).max() < 1e-12


@pytest.mark.parametrize("name", ["bouc_wen", "lugre"])
def test_states_that_stay_at_rest_are_springs(name):
    """At the origin the slope of both laws is k, s0; z is then no state of its own."""
    law, stiffness, damping = (LAWS[name]()[0], *{"bouc_wen": (53.0, 0.0), "lugre": (420.0, 3.5)}[name])
    lin = mb.linearize(block(law))
    # off the origin by the noise of the two points of the guide, the slope of bristles is less by s0 |z| / f_s of itself
    noise = jitter.level() * (1 + 420.0 / 1.6 * 2 * np.linalg.norm([0.1, 0.2, 0.3]))
    assert abs(lin.K[0, 0] - K - stiffness) < 1e-12 * stiffness + noise * (K + stiffness)
    assert abs(lin.C[0, 0] - C - damping) < 1e-12 + noise * (C + damping)
    assert list(mb.modes(block(law)).kind) == ["vibration"]


def test_what_does_not_know_relaxing_states_refuses():
    m = block(maxwell()[0])
    for analysis in (
        lambda: mb.state_space(m, m["block"].force("x"), m["block"].motion("x")),
        lambda: mb.sensitivity(mb.modes(m), ["guide.k"]),
        lambda: mb.sensitivity(mb.frf(m, m["block"].force("x"), m["block"].motion("x"), omega=[1.0]), ["guide.k"]),
    ):
        with pytest.raises(ModelError, match="relax") as refused:
            analysis()
        assert "k= and c=" in str(refused.value)


@pytest.mark.some(1)
@pytest.mark.parametrize("name", [*sorted(set(LAWS) - {"lugre"}), pytest.param("lugre", marks=pytest.mark.slow)])
def test_harmonic_balance_meets_the_motion_in_time(name):
    """The motion after many periods, by solve_ivp."""
    law = LAWS[name]()
    omega, amplitude = 4.3, 6.0
    m = block(law[0])
    r = mb.harmonic_balance(m, omega=omega, force=m["block"].force(AXIS), amplitude=amplitude, harmonics=25)
    periods, n = 30, 64
    T = 2 * np.pi / omega
    t = np.concatenate([[0.0], T * (periods + np.arange(n) / n)])
    exact = truth(law, t, load=lambda s: amplitude * np.cos(omega * s))[0, 1:]
    found = r.displacement(T * np.arange(n) / n)[0]
    error = np.abs(found - exact).max() / np.abs(exact).max()
    print(f"{name}: {error:.1e}, its own estimate {r.error:.1e}")
    assert error < 2e-4


def test_harmonic_balance_of_maxwell_is_linear():
    law, *_ = maxwell()
    m = block(law)
    omega = 4.3
    r = mb.harmonic_balance(m, omega=omega, force=m["block"].force(AXIS), amplitude=2.0, harmonics=3)
    H = mb.frf(m, m["block"].force(AXIS), m["block"].motion(AXIS), omega=[omega]).value[0, 0, 0]
    u = r.displacement(np.array([0.0, 0.3]))[0]
    exact = (2.0 * H * np.exp(1j * omega * np.array([0.0, 0.3]))).real
    assert np.abs(u - exact).max() < 1e-9 * abs(2 * H)


def test_loop_area_of_bouc_wen():
    """n = 1, alpha = 0, gamma = beta: loading is exponential, unloading straight; the area of a cycle in closed form."""
    k, b, amplitude = 53.0, 17.0, 0.11
    law = mb.BoucWen(k, 0.0, b, b)
    m = mb.Model("driven")
    a = m.body("a", mass=1.0, inertia=(1, 1, 1))
    m.prismatic("guide", m.ground, a, at=(0, 0, 0), axis=tuple(AXIS), law=law)
    m.drive("to and fro", "guide", mb.Sine(amplitude, omega=2.0))
    t = np.linspace(0, 6 * np.pi, 60001)
    traj = mb.simulate(m, t, rtol=1e-9)
    u, z = traj.joint("guide"), traj.memory[:, 0]
    last = slice(50000, None)
    area = k * np.sum((z[last][1:] + z[last][:-1]) / 2 * np.diff(u[last]))
    # from -Z straight up to zero (z' = v), then z' = v (1 - 2 b z) to Z
    top = brentq(lambda Z: 1 - np.exp(-2 * b * (2 * amplitude - Z)) - 2 * b * Z, 1e-9, 2 * amplitude)
    loading = 2 * amplitude - top
    up = loading / (2 * b) - top / (2 * b)
    exact = 2 * k * (up - top**2 / 2)
    assert abs(area - exact) < 1e-5 * exact
