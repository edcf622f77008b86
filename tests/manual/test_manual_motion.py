"""Cases of the verification manual: motions in time and their gradients."""

from __future__ import annotations

import mbrs as mb
import mpmath
import numpy as np
import pytest
from manual.record import in_size_of
from scipy import linalg
from scipy.integrate import solve_ivp
from scipy.special import ellipj

G = 9.80665
R = linalg.expm(np.cross(np.eye(3), [-0.42, 0.63, 0.35]))
X, Y, Z = R.T
DOWN = tuple(-G * Z)


def distance(traj, t, of):
    """Angle of a body that hangs below the origin."""
    at = of(traj)
    return np.unwrap(np.arctan2(at @ X, -(at @ Z)))


@pytest.mark.parametrize("method", ["explicit", "bdf", "generalized-alpha", "ali3p"])
def test_a_pendulum_through_a_large_angle(case, method):
    """theta = 2 asin(k sn(w t + K, k)), k = sin(theta0 / 2)."""
    mass, arm, inertia, start = 2.3, 0.7, 0.11, 2.4
    m = mb.Model("pendulum", gravity=DOWN)
    at = arm * (np.sin(start) * X - np.cos(start) * Z)
    b = m.body("bob", mass=mass, inertia=R @ np.diag([0.05, inertia, 0.07]) @ R.T, at=at)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=Y)
    t = np.linspace(0, 3, 31)
    order_two = method in ("generalized-alpha", "ali3p")
    traj = mb.simulate(m, t=t, rtol=1e-7 if order_two else 1e-10, method=method)
    w, k = np.sqrt(mass * G * arm / (inertia + mass * arm**2)), np.sin(start / 2)
    full = float(mpmath.ellipk(k * k))
    known = 2 * np.arcsin(k * ellipj(w * t + full, k * k)[0])
    case(
        f"pendulum from 137.5 degrees, {method}: angle over 3 s",
        topic="motion",
        kind="high precision",
        ours=distance(traj, t, lambda s: s.position("bob")),
        known=known,
        within=2e-4 if order_two else 1e-6,
        uncertainty=1e-12,
        source="elliptic functions: 2 asin(k sn(w t + K, k))",
        estimate=traj.error,
        unit="rad",
    )


def test_a_free_symmetric_top(case):
    """Euler's top: the body's axis goes around the fixed angular momentum with the rate L / I."""
    inertia, axial = 0.31, 0.19
    spin = np.array([1.3, -0.4, 7.1])
    m = mb.Model("top")
    m.body("top", mass=2.0, inertia=(inertia, inertia, axial), angular_velocity=spin)
    L = np.array([inertia, inertia, axial]) * spin
    t = np.linspace(0, 4, 41)
    traj = mb.simulate(m, t=t, rtol=1e-10)
    rate, unit = np.linalg.norm(L) / inertia, L / np.linalg.norm(L)
    axis = np.array([0.0, 0.0, 1.0])
    c, s = np.cos(rate * t)[:, None], np.sin(rate * t)[:, None]
    known = c * axis + s * np.cross(unit, axis) + (1 - c) * (unit @ axis) * unit
    case(
        "free symmetric top: its axis over 4 s",
        topic="motion",
        ours=traj.rotation("top")[:, :, 2],
        known=known,
        within=1e-7,
        source="Euler: precession about L with L / I (Goldstein, section 5.6)",
        estimate=traj.error,
    )


def test_an_unsymmetric_top(case):
    """The free asymmetric body by Jacobi's elliptic functions."""
    inertia = np.array([0.5, 0.3, 0.2])
    w0 = np.array([1.1, 0.0, 3.0])
    m = mb.Model("body")
    m.body("body", mass=1.0, inertia=inertia, angular_velocity=w0)
    t = np.linspace(0, 6, 25)
    traj = mb.simulate(m, t=t, rtol=1e-11)
    ours = np.einsum("tji,tj->ti", traj.rotation("body"), traj.angular_velocity("body"))
    a, b, c = inertia
    # energy and momentum
    twice, square = inertia @ w0**2, (inertia**2) @ w0**2
    if square > twice * b:
        first, last = (a, c), (0, 2)
    else:
        first, last = (c, a), (2, 0)
    p, q = first
    rate = np.sqrt((p - b) * (square - twice * q) / (p * b * q))
    k2 = (b - q) * (twice * p - square) / ((p - b) * (square - twice * q))
    sn, cn, dn, _ = ellipj(rate * t, k2)
    known = np.zeros((t.size, 3))
    known[:, last[0]] = np.sign(w0[last[0]]) * np.sqrt((square - twice * q) / (p * (p - q))) * dn
    known[:, last[1]] = np.sign(w0[last[1]]) * np.sqrt((twice * p - square) / (q * (p - q))) * cn
    size = np.sqrt((twice * p - square) / (b * (p - b)))
    # the sign of the middle component from Euler's equation at the start
    start = (c - a) * w0[2] * w0[0] / b
    known[:, 1] = np.sign(start) * size * sn
    case(
        "free unsymmetric body: angular velocity in body axes over 6 s",
        topic="motion",
        kind="high precision",
        ours=ours,
        known=known,
        within=1e-7,
        uncertainty=1e-12,
        source="Jacobi's elliptic functions (Landau and Lifshitz, Mechanics, section 37)",
        unit="rad/s",
    )


def test_a_projectile(case):
    m = mb.Model("throw", gravity=DOWN)
    start = np.array([3.0, -1.0, 5.5])
    m.body("ball", mass=0.7, inertia=(0.1, 0.1, 0.1), velocity=start)
    t = np.linspace(0, 2, 11)
    traj = mb.simulate(m, t=t, rtol=1e-9)
    case(
        "projectile: path over 2 s",
        topic="motion",
        ours=traj.position("ball"),
        known=t[:, None] * start - 0.5 * G * t[:, None] ** 2 * Z,
        within=1e-9,
        source="x = v t - g t^2 / 2",
        estimate=in_size_of(traj, t[:, None] * start - 0.5 * G * t[:, None] ** 2 * Z),
        unit="m",
    )


def test_kepler(case):
    """A mass on a spring through the origin in space moves on an ellipse about the spring's end."""
    mass, k = 1.7, 41.0
    at, v = np.array([0.9, 0.2, -0.3]), np.array([0.5, 2.0, 1.1])
    m = mb.Model("ellipse")
    b = m.body("ball", mass=mass, inertia=(0.1, 0.1, 0.1), at=at, velocity=v)
    m.spring_damper("spring", m.ground, b, at=((0, 0, 0), tuple(at)), k=k, length=0.0)
    w = np.sqrt(k / mass)
    t = np.linspace(0, 3, 25)
    traj = mb.simulate(m, t=t, rtol=1e-10)
    known = np.cos(w * t)[:, None] * at + np.sin(w * t)[:, None] * v / w
    case(
        "mass on a spring without length, in space: path over 3 s",
        topic="motion",
        ours=traj.position("ball"),
        known=known,
        within=1e-7,
        source="x = x0 cos(w t) + v0/w sin(w t)",
        estimate=in_size_of(traj, known),
        unit="m",
    )


def test_dry_friction_stops_a_block(case):
    """A block with regularised friction: u' = -(F/m) tanh(u / v): sinh(u / v) = sinh(u0 / v) exp(-F t / (m v))."""
    mass, force, v, start = 2.2, 9.0, 0.05, 1.4
    m = mb.Model("block")
    b = m.body("block", mass=mass, inertia=(0.1, 0.1, 0.1), velocity=start * X)
    m.prismatic("floor", m.ground, b, at=(0, 0, 0), axis=X, law=mb.CoulombTanh(force, v))
    t = np.linspace(0, 0.5, 21)
    traj = mb.simulate(m, t=t, rtol=1e-9)
    with mpmath.workdps(50):
        known = [float(v * mpmath.asinh(mpmath.sinh(start / v) * mpmath.exp(-force * s / (mass * v)))) for s in t]
    case(
        "block slowed by regularised friction: velocity over 0.5 s",
        topic="motion",
        kind="high precision",
        ours=traj.velocity("block") @ X,
        known=known,
        within=1e-6,
        uncertainty=1e-15,
        source="sinh(u/v) = sinh(u0/v) exp(-F t / (m v))",
        unit="m/s",
    )

    def speed(s):
        return v * mpmath.asinh(mpmath.sinh(start / v) * mpmath.exp(-force * s / (mass * v)))

    with mpmath.workdps(20):
        parts = [mpmath.quad(speed, [t[i - 1], t[i]], maxdegree=4) for i in range(1, len(t))]
    place = np.cumsum([0.0, *map(float, parts)])
    case(
        "block slowed by regularised friction: path over 0.5 s",
        topic="motion",
        kind="high precision",
        ours=traj.position("block") @ X,
        known=place,
        within=1e-8,
        uncertainty=1e-14,
        source="integral of asinh(sinh(u0/v) exp(-F t / (m v))) v",
        estimate=in_size_of(traj, place),
        unit="m",
    )


def test_a_bouncing_mass_on_a_stop(case):
    """A mass with gravity on a one-sided spring: parabola and half cycle in turn; the time of a whole bounce."""
    mass, k, height = 1.3, 8.1e3, 0.11
    m = mb.Model("bounce", gravity=DOWN)
    b = m.body("ball", mass=mass, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0))
    m.prismatic("guide", m.ground, b, at=(0, 0, 0), axis=-Z, law=mb.Gap(k, height))
    w, fall = np.sqrt(k / mass), np.sqrt(2 * height / G)
    v, sag = G * fall, G / w**2
    touch = 2 * (np.pi - np.arctan2(v / w, sag)) / w
    period = 2 * fall + touch
    traj = mb.simulate(m, t=np.array([0, fall, fall + touch / 2, period]), rtol=1e-10)
    known = [0, -height, -(height + sag + np.hypot(sag, v / w)), 0]
    case(
        "mass that falls on an elastic stop: height after each phase",
        topic="motion",
        ours=traj.position("ball") @ Z,
        known=known,
        within=1e-5,
        uncertainty=1e-14,
        source="free fall, then half a cycle about the loaded rest position",
        estimate=in_size_of(traj, known),
        unit="m",
    )


def test_a_double_pendulum_of_rods(case):
    """Lagrange's equations of two rods written here, integrated by SciPy with 13 digits."""
    mass, arm, start = 1.4, 0.9, (1.9, -0.7)

    def rate(_, s):
        a, b, u, w = s
        c, d = np.cos(a - b), np.sin(a - b)
        M = mass * arm * arm * np.array([[4 / 3, c / 2], [c / 2, 1 / 3]])
        f = (
            mass
            * arm
            * np.array([-1.5 * G * np.sin(a) - arm * w * w * d / 2, -0.5 * G * np.sin(b) + arm * u * u * d / 2])
        )
        return [u, w, *np.linalg.solve(M, f)]

    t = np.linspace(0, 2, 21)
    truth = solve_ivp(rate, (0, 2), [*start, 0, 0], t_eval=t, method="DOP853", rtol=1e-13, atol=1e-13).y[:2]
    m = mb.Model("double", gravity=DOWN)
    down = [np.sin(a) * X - np.cos(a) * Z for a in start]
    last, top = m.ground, np.zeros(3)
    for i, (angle, d) in enumerate(zip(start, down, strict=True)):
        side = np.array([np.cos(angle), 0, np.sin(angle)]) @ np.array([X, Y, Z])
        T = np.stack([side, Y, np.cross(side, Y)], axis=1)
        b = m.body(
            f"rod{i}", mass=mass, inertia=T @ np.diag([1, 1, 1e-3]) @ T.T * mass * arm * arm / 12, at=top + d * arm / 2
        )
        m.revolute(f"h{i}", last, b, at=top, axis=Y)
        last, top = b, top + d * arm
    traj = mb.simulate(m, t=t, rtol=1e-10)
    ends = np.stack([np.sin(truth[0]) * arm / 2, np.sin(truth[0]) * arm + np.sin(truth[1]) * arm / 2], axis=1)
    ours = np.stack([traj.position("rod0") @ X, traj.position("rod1") @ X], axis=1)
    case(
        "double pendulum of rods: centres over 2 s",
        topic="motion",
        kind="independent script",
        ours=ours,
        known=ends,
        within=1e-6,
        uncertainty=1e-10,
        source="Lagrange's equations by DOP853, 13 digits",
        estimate=in_size_of(traj, ends),
        unit="m",
    )


def test_reaction_of_a_pendulum(case):
    """Let go level, the rod's hinge carries at the bottom m g (1 + 2 m l^2 / J) with J about the hinge."""
    mass, arm, inertia = 2.3, 0.7, 0.11
    J = inertia + mass * arm**2
    w = np.sqrt(2 * mass * G * arm / J)
    m = mb.Model("pendulum", gravity=DOWN)
    b = m.body(
        "bob",
        mass=mass,
        inertia=R @ np.diag([0.05, inertia, 0.07]) @ R.T,
        at=-arm * Z,
        velocity=-w * arm * X,
        angular_velocity=w * Y,
    )
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis=Y)
    traj = mb.simulate(m, t=np.array([0.0, 0.01]), rtol=1e-9)
    case(
        "pendulum let go level: force of its hinge at the bottom",
        topic="motion",
        ours=traj.reaction("hinge")[0, :3] @ Z,
        known=mass * G * (1 + 2 * mass * arm**2 / J),
        within=1e-9,
        source="m g + m l w^2, w^2 = 2 m g l / J",
        unit="N",
    )


# --- gradients -----


def test_gradient_of_a_driven_oscillator(case):
    """x(T) of m x" + k x = F from rest: F/k (1 - cos w T), differentiated by m, k and F."""
    mass, k, force, end = 2.0, 50.0, 3.0, 1.1
    m = mb.Model("oscillator")
    b = m.body("b", mass=mass, inertia=(1, 1, 1))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis=X, k=k, preload=-force)
    found = mb.gradient(m, mb.Final(lambda s: s.position("b") @ X), ["b.mass", "rail.k"], t=end, step=end / 4000)
    w = np.sqrt(k / mass)
    c, s = np.cos(w * end), np.sin(w * end)
    known = force * np.array([-s * end * w / (2 * mass * k), -(1 - c) / k**2 + s * end * w / (2 * k * k)])
    case(
        "oscillator under a constant force: dx(T)/dm and dx(T)/dk",
        topic="gradients",
        ours=np.sign(found.value) * found.gradient,
        known=known,
        within=1e-5,
        uncertainty=1e-14,
        source="derivatives of F/k (1 - cos w T)",
    )


def test_gradient_of_a_free_fall(case):
    """Time average of the square of the distance: integral of |v t - g t^2/2|^2, by the velocity."""
    v, end = np.array([1.3, -0.4, 2.2]), 0.8
    m = mb.Model("throw", gravity=DOWN)
    m.body("ball", mass=0.7, inertia=(0.1, 0.1, 0.1), velocity=v)
    found = mb.gradient(
        m, mb.Integral(lambda s: np.sum(s.position("ball") ** 2)), ["ball.velocity"], t=end, step=end / 2000
    )
    known = 2 * v * end**3 / 3 - G * Z * end**4 / 4
    case(
        "projectile: gradient of an integral by the first velocity",
        topic="gradients",
        ours=np.asarray(found.gradient).ravel(),
        known=known,
        within=1e-5,
        uncertainty=1e-15,
        source="d/dv of int |v t - g t^2/2|^2 dt = 2 v T^3/3 - g T^4/4",
    )
