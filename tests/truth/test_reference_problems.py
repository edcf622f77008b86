"""The values that docs/theory.md, section 23, prints for the reference problems, computed anew with NumPy and SciPy alone.

Nothing here uses mbrs but for the table of a blade: a digit that the page prints and this file does not find is an error of the
page, on which other tests rely.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from folders import DOCS
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

pytestmark = pytest.mark.slow

PAGE = (DOCS / "theory.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"(?<![\w.])-?\d+\.\d+")


def printed(tag):
    """Numbers of the display with this tag, as text."""
    display = next(d for d in PAGE.split("$$") if rf"\tag{{{tag}}}" in d)
    return NUMBER.findall(display.replace(rf"\tag{{{tag}}}", ""))


def stands(tag, value, spare=0.0):
    """Does the page print this value, rounded to the digits that it gives? ``spare``: what may be missing, in units of the last."""
    unit = {text: 10.0 ** -len(text.partition(".")[2]) for text in printed(tag)}
    return any(abs(float(text) - value) <= (0.5 + spare) * u * (1 + 1e-9) for text, u in unit.items())


def motion(rate, end, start, tol=1e-13, **options):
    return solve_ivp(rate, (0, end), start, method="DOP853", rtol=tol, atol=tol, **options)


# --- Duffing's oscillator with few harmonics -----


def balance(omega, harmonics, k3, c, force):
    """Residual of x" + c x' + x + k3 x^3 = force cos(omega t) on [1, cos, sin], by least squares over many samples."""
    h = np.arange(1, harmonics + 1)
    phase = np.outer(np.arange(256) * 2 * np.pi / 256, h)
    one, zero = np.ones((256, 1)), np.zeros((256, 1))
    x = np.hstack([one, np.cos(phase), np.sin(phase)])
    v = np.hstack([zero, -h * np.sin(phase), h * np.cos(phase)]) * omega
    a = np.hstack([zero, -(h**2) * np.cos(phase), -(h**2) * np.sin(phase)]) * omega**2
    back = np.linalg.pinv(x)
    load = force * np.cos(phase[:, 0])
    return lambda z: back @ (a @ z + c * (v @ z) + x @ z + k3 * (x @ z) ** 3 - load)


def duffing_amplitude(omega, guess):
    z = np.zeros(15)
    z[1], z[8] = guess.real, -guess.imag
    z, info, ok, _ = fsolve(balance(omega, 7, 0.1, 0.05, 0.18), z, full_output=True, xtol=1e-13)
    assert ok == 1 or np.max(np.abs(info["fvec"])) < 1e-13
    return np.hypot(z[1], z[8])


@pytest.mark.parametrize("omega", [0.5, 0.8, 0.9, 1.0, 1.5])
def test_duffing_amplitudes(omega):
    assert stands("23.5", duffing_amplitude(omega, 0.18 / (1 - omega**2 + 0.05j * omega + 0.1 * (omega == 1))))


@pytest.mark.parametrize("size", [2.5, 2.25, 0.42])
def test_duffing_amplitudes_between_the_folds(size):
    phases = np.exp(-1j * np.linspace(0, np.pi, 25))
    amplitudes = [duffing_amplitude(1.2, size * p) for p in phases]
    assert stands("23.5", min(amplitudes, key=lambda a: abs(a - size)))


# --- by shooting -----


def forced(omega, k3, force):
    """Rate of [x, v, fundamental matrix (2, 2)] of x" + 0.05 x' + x + k3 x^3 = force cos(omega t)."""

    def rate(t, s):
        x, v = s[:2]
        P = s[2:].reshape(2, 2)
        slope = np.array([[0.0, 1.0], [-1 - 3 * k3 * x * x, -0.05]])
        return np.concatenate([[v, force * np.cos(omega * t) - 0.05 * v - x - k3 * x**3], (slope @ P).ravel()])

    return rate


def period(omega, start, k3, force):
    """The state after a period, and the fundamental matrix."""
    end = motion(forced(omega, k3, force), 2 * np.pi / omega, [*start, 1, 0, 0, 1]).y[:, -1]
    return end[:2], end[2:].reshape(2, 2)


def fold(guess, k3, force):
    """omega of a fold: a periodic motion with the multiplier one."""

    def equations(z):
        end, P = period(z[2], z[:2], k3, force)
        return [*(end - z[:2]), np.linalg.det(P - np.eye(2))]

    found, info, _, _ = fsolve(equations, guess, full_output=True, xtol=1e-12)
    assert np.max(np.abs(info["fvec"])) < 1e-9
    return found


def started(amplitude, omega, k3, force):
    """State at t = 0 of a motion with one harmonic of this amplitude: the phase from its balance."""
    x = force / (1 - omega**2 + 0.75 * k3 * amplitude**2 + 0.05j * omega)
    x *= amplitude / abs(x)
    return x.real, -omega * x.imag


def test_folds_of_the_duffing_oscillator():
    for amplitude, omega in ((2.825, 1.2696), (1.082, 1.1157)):
        found = fold([*started(amplitude, omega, 0.1, 0.18), omega], 0.1, 0.18)[2]
        assert f"{found:.5f}" in PAGE, found


def shot(omega, start):
    """The periodic state of the hard oscillator near this one."""
    for _ in range(20):
        end, P = period(omega, start, 1.0, 0.3)
        step = np.linalg.solve(P - np.eye(2), start - end)
        start = start + step
        if np.max(np.abs(step)) < 1e-12:
            return start
    raise AssertionError(f"no periodic motion at {omega}")


def followed(omegas, amplitude):
    """The state at the last of these frequencies, each the guess of the next."""
    start = np.array(started(amplitude, omegas[0], 1.0, 0.3))
    for omega in omegas:
        start = shot(omega, start)
    return start


UPPER = np.concatenate([np.linspace(1.8, 2.38, 12), [2.393, 2.398, 2.3991]])
LOWER = np.concatenate([np.linspace(1.8, 1.36, 12), [1.345, 1.337, 1.333]])


@pytest.mark.parametrize(("omegas", "amplitude"), [(UPPER, 1.8), (LOWER, 0.14)], ids=["upper", "lower"])
def test_folds_of_the_hard_duffing_oscillator(omegas, amplitude):
    guess = [*followed(omegas, amplitude), omegas[-1]]
    found = fold(guess, 1.0, 0.3)[2]
    assert stands("23.6", found, spare=1.0), found


def test_peak_of_the_hard_duffing_oscillator():
    """Largest |x| over omega on the upper branch, from a polynomial through nine frequencies."""

    def largest(omega):
        cycle = motion(
            lambda t, s: [s[1], 0.3 * np.cos(omega * t) - 0.05 * s[1] - s[0] - s[0] ** 3],
            2 * np.pi / omega,
            shot(omega, near),
            events=lambda _, s: s[1],
        )
        return max(abs(s[0]) for s in cycle.y_events[0])

    near = shot(2.3993, followed(UPPER, 1.8))
    offsets = np.linspace(-1.0, 1.0, 9)
    curve = np.polynomial.Polynomial.fit(offsets, [largest(2.39933 + 2e-5 * x) for x in offsets], 6)
    turn = brentq(curve.deriv(), -1.0, 1.0)
    assert stands("23.6", 2.39933 + 2e-5 * turn, spare=30.0)  # flat: its place is known to the root of rounding
    assert stands("23.6", curve(turn), spare=1.0)


@pytest.mark.parametrize(("mu", "end"), [(1, 60), (5, 70), (20, 120)])
def test_periods_of_van_der_pol(mu, end):
    def rate(_, s):
        return [s[1], mu * (1 - s[0] ** 2) * s[1] - s[0]]

    def top(_, s):
        return s[1]

    top.direction = -1
    times = motion(rate, end, [2, 0], events=top).t_events[0]
    assert stands("23.10", times[-1] - times[-2])


# --- two frequencies -----


@pytest.mark.parametrize("eta", [2.0, 1.5])
def test_coefficients_of_two_tones(eta):
    """Balance on the torus by samples in two dimensions, |k1| + |k2| <= 7, Newton's method with the exact Jacobian."""
    m, n = 7, 40
    k = np.array([(i, j) for i in range(m + 1) for j in range(-m, m + 1) if abs(i) + abs(j) <= m and (i > 0 or j > 0)])
    w = k @ np.array([eta, np.sqrt(2) * eta])
    a, b = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    phase = (2 * np.pi / n) * (np.outer(a.ravel(), k[:, 0]) + np.outer(b.ravel(), k[:, 1]))
    basis = np.hstack([np.ones((n * n, 1)), np.cos(phase), np.sin(phase)])
    back = np.hstack([np.full((n * n, 1), 1.0), 2 * np.cos(phase), 2 * np.sin(phase)]).T / n**2
    K = len(k)
    linear = np.zeros((2 * K + 1, 2 * K + 1))
    linear[0, 0] = 1.0
    i = np.arange(1, K + 1)
    linear[i, i] = linear[K + i, K + i] = 1 - w**2
    linear[i, K + i], linear[K + i, i] = 0.1 * w, -0.1 * w
    load = np.zeros(2 * K + 1)
    for tone in ((1, 0), (0, 1)):
        load[K + 1 + int(np.flatnonzero((k == tone).all(axis=1))[0])] = 0.25
    z = np.linalg.solve(linear, load)
    for level in (*np.linspace(0.1, 1.0, 10), *[1.0] * 8):
        x = basis @ z
        residual = linear @ z + back @ (1.5 * level * x**3) - load
        z = z - np.linalg.solve(linear + back @ ((4.5 * level * x**2)[:, None] * basis), residual)
    for index in ((1, 0), (0, 1), (2, -1)):
        at = 1 + int(np.flatnonzero((k == index).all(axis=1))[0])
        assert stands("23.9", z[at]) and stands("23.9", z[K + at]), (index, z[at], z[K + at])


# --- motions -----


def test_angles_of_the_swing():
    m, length, g, w = 336.14, 2.0, 9.81, np.pi / 3
    reach, inertia = length / 2, m * length**2 / 12

    def rate(t, s):
        moment = m * reach * length * w**2 * np.sin(w * t - s[0]) - m * g * reach * np.cos(s[0])
        return [s[1], moment / (inertia + m * reach**2)]

    found = motion(rate, 5, [0, 0], t_eval=[0.5, 1, 2, 3, 5]).y[0]
    assert all(stands("23.11", angle) for angle in found), found


A, B = np.zeros(2), np.array([1.0, 0.0])
DRAWN = np.array([-1, -1, 0.5, -2, 2, -1.0])


def five_bar(lengths, end):
    """q (6,) at the end and psi, in the points' coordinates: [M J^T; J 0] [q"; lam] = [Q; -(rate of J) q']."""
    m1, m2, m3, m4 = 1, 1.5, 1.5, 1
    M = np.array([[(m1 + m2) / 3, m2 / 6, 0], [m2 / 6, (m2 + m3) / 3, m3 / 6], [0, m3 / 6, (m3 + m4) / 3]])
    M = np.kron(M, np.eye(2))
    weight = -9.81 / 2 * np.array([0, m1 + m2, 0, m2 + m3, 0, m3 + m4])

    def rate(_, s):
        q, v = s[:6].reshape(3, 2), s[6:12].reshape(3, 2)
        ends, speeds = np.vstack([A, q, B]), np.vstack([A * 0, v, A * 0])
        bars, turns = np.diff(ends, axis=0), np.diff(speeds, axis=0)
        J = np.zeros((4, 5, 2))
        for i in range(4):
            J[i, i], J[i, i + 1] = -bars[i], bars[i]
        J = J[:, 1:4].reshape(4, 6)
        Q = weight.copy()
        for point, natural in zip((2, 1), lengths, strict=True):
            d = q[point] - A
            r = np.hypot(*d)
            Q[2 * point : 2 * point + 2] -= 100.0 * (r - natural) * d / r
        full = np.block([[M, J.T], [J, np.zeros((4, 4))]])
        a = np.linalg.solve(full, np.concatenate([Q, -np.sum(turns**2, axis=1)]))[:6]
        return np.concatenate([s[6:12], a, [np.sum((q[1] - DRAWN[2:4]) ** 2)]])

    end = motion(rate, end, np.concatenate([DRAWN, np.zeros(7)]), tol=1e-12).y[:, -1]
    return end[:6], end[-1]


NATURAL = np.array([np.sqrt(5.0), np.sqrt(4.25)])


@pytest.mark.parametrize("end", [1, 2, 5])
def test_five_bar(end):
    q, psi = five_bar(NATURAL, end)
    assert stands("23.12", psi, spare=1.0)
    if end != 2:
        assert all(f"{x:.8f}" in PAGE for x in q), q
    step = 1e-3
    for i in range(2):
        # differences of order four
        values = [five_bar(NATURAL + k * step * np.eye(2)[i], end)[1] for k in (-2, -1, 1, 2)]
        slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
        near = min(abs(float(text) - slope) for text in printed("23.12"))
        assert near < 2e-8, slope


def test_five_bar_at_its_optimum():
    """Natural lengths with which the drawn position is in equilibrium."""

    def unbalanced(lengths):
        q, _ = five_bar(lengths, 1e-3)
        return (q - DRAWN)[[2, 3]] * 1e6

    found = fsolve(unbalanced, NATURAL, xtol=1e-12)
    assert np.allclose(found, [2.43192357, 1.84486889], rtol=0, atol=2e-7)
    assert "2.43192357" in PAGE and "1.84486889" in PAGE


def particle(k=10.0, m=1.0, b=1.0):
    """[q, v, psi] after 5 s of the point with y' = b z x'."""

    def rate(_, s):
        q, v = s[:3], s[3:6]
        D, slope = np.array([-b * q[2], 1, 0]), np.array([-b * v[2], 0, 0])
        multiplier = (D @ (-k * q) / m + slope @ v) / (D @ D / m)
        return np.concatenate([v, (-k * q - D * multiplier) / m, [q @ q]])

    return motion(rate, 5, [1, 0, 0.5, 1, 0.5 * b, 0, 0], tol=1e-12).y[:, -1]


def test_nonholonomic_point():
    end = particle()
    assert all(stands("23.13", x) for x in (*end[:3], end[-1])), end
    for name, value in (("k", 10.0), ("m", 1.0), ("b", 1.0)):
        step = 1e-3 * value
        values = [particle(**{name: value + i * step})[-1] for i in (-2, -1, 1, 2)]
        slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
        assert min(abs(float(text) - slope) for text in printed("23.13")) < 2e-8, (name, slope)


def test_frequencies_of_the_blade():
    """u = omega^2 int G m u with G(x, y) = int_0^min (x - s)(y - s)/EI ds, which solves (EI u")" = omega^2 m u of a cantilever."""
    import mbrs as mb

    blade = mb.examples.windpact_blade()
    nodes, weights = np.polynomial.legendre.leggauss(16)
    left, width = blade.station[:-1, None], np.diff(blade.station)[:, None]
    x, w = (left + width * (nodes + 1) / 2).ravel(), (width * weights / 2).ravel()
    mass = np.interp(x, blade.station, blade.mass)
    assert f"{w @ mass:.1f} kg" in PAGE

    def moment(k, EI, a, b):
        s = a[:, None] + (b - a)[:, None] * (nodes + 1) / 2
        return ((b - a)[:, None] * weights / 2 * s**k / np.interp(s, blade.station, EI)).sum(axis=1)

    for EI in (blade.EI_flap, blade.EI_edge):
        whole = [
            np.concatenate([[0.0], np.cumsum(moment(k, EI, left.ravel(), blade.station[1:]))[:-1]]) for k in (0, 1, 2)
        ]
        start = np.repeat(left.ravel(), len(nodes))
        upto = [np.repeat(c, len(nodes)) + moment(k, EI, start, x) for k, c in enumerate(whole)]
        first = np.minimum.outer(np.arange(len(x)), np.arange(len(x)))
        G = np.outer(x, x) * upto[0][first] - np.add.outer(x, x) * upto[1][first] + upto[2][first]
        root = np.sqrt(w * mass)
        found = 1 / np.sqrt(np.linalg.eigvalsh(G * root * root[:, None])[-2:][::-1]) / (2 * np.pi)
        assert all(stands("23.14", f) for f in found), found


def test_isolator():
    k, m, inertia, edge = 1e5, 20.0, 0.15, 0.2
    squares = 2 * k / m, k * edge**2 / (2 * inertia), 2 * k * edge**2 / inertia
    assert all(f"{np.sqrt(s) / (2 * np.pi):.4f} Hz" in PAGE for s in squares)


def test_count_of_index_vectors():
    """(12.2) against a count by hand."""
    from itertools import product
    from math import comb

    for p, m in ((1, 4), (2, 3), (2, 7), (3, 5)):
        inside = [k for k in product(range(-m, m + 1), repeat=p) if 0 < sum(map(abs, k)) <= m]
        assert sum(2**i * comb(p, i) * comb(m, i) for i in range(min(p, m) + 1)) - 1 == len(inside)


def test_start_up_orders_and_growth_of_bdf4():
    """Largest root of the recurrence of (17.12) on x" = -omega^2 x: 1.19 at omega h = 2, one at about 4.8."""

    def growth(wh):
        return max(abs(np.roots([25 - 12j * wh, -48, 36, -16, 3])))

    assert growth(2.0) == pytest.approx(1.19, abs=5e-3)
    assert brentq(lambda x: growth(x) - 1, 3.0, 6.0) == pytest.approx(4.8, abs=0.1)
