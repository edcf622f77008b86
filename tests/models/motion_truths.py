"""True motions for the zoo of `motion_problems`, from equations written by hand: closed forms, and ordinary differential
equations in the fewest coordinates that SciPy's DOP853 solves at rtol 1e-13 (the error of the latter is about 1e-11 of
the amplitude for the times used there; `test_motion_zoo` measures it by halving the tolerance).
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

G = 9.81
RTOL = 1e-13


def solved(slope, start, times, rtol=RTOL):
    """y at the times (n_t, n), restarted at each of them: dense output would lose an order."""
    start, now, out = np.asarray(start, dtype=float), 0.0, []
    scale = max(1.0, float(np.max(np.abs(start))))
    for t in np.asarray(times, dtype=float):
        if t > now:
            run = solve_ivp(slope, (now, t), start, method="DOP853", rtol=rtol, atol=1e-2 * rtol * scale)
            start, now = run.y[:, -1], t
        out.append(start)
    return np.array(out)


def plane(x, y):
    """Points (n, 3) in the plane z = 0."""
    return np.stack([x, y, 0 * x], axis=1)


def solved_stiff(slope, start, times, rtol=RTOL):
    """The same by backward differences (LSODA), whose error is about 1e-9 at these tolerances."""
    run = solve_ivp(slope, (0.0, np.max(times) or 1.0), start, "LSODA", np.asarray(times), rtol=rtol, atol=1e-14)
    return run.y.T


# --- one degree of freedom -----


def rod_pendulum(times, length=1.0):
    """Angle from the vertical of a uniform rod let go level: sin(phi/2) = k sn(K - w t | k^2), k = sin(pi/4)."""
    w, k2 = np.sqrt(1.5 * G / length), 0.5
    sn, _, _, _ = ellipj(ellipk(k2) - w * np.asarray(times), k2)
    return 2 * np.arcsin(np.sqrt(k2) * sn)


def duffing(times, k, k3, mass, amplitude):
    """x" = -(k x + k3 x^3) / m from rest at the amplitude A: A cn(W t | k3 A^2 / (2 m W^2)), W^2 = (k + k3 A^2) / m."""
    W2 = (k + k3 * amplitude**2) / mass
    _, cn, _, _ = ellipj(np.sqrt(W2) * np.asarray(times), k3 * amplitude**2 / (2 * mass * W2))
    return amplitude * cn


def four_bars(times, n, speed):
    """Angle from the vertical of the posts: ((n+1)/3 + n) phi" = g ((n+1)/2 + n) sin phi, rods of 1 m and 1 kg."""
    inertia, weight = (n + 1) / 3 + n, G * ((n + 1) / 2 + n)
    return solved(lambda _, y: [y[1], weight * np.sin(y[0]) / inertia], [0.0, speed], times)[:, 0]


def slider_crank(times, r, L, angle, speed, masses=(0.38, 0.76, 1.2)):
    """Crank angle, J(a) a" + J'(a) a'^2 / 2 + V'(a) = 0, with J and V from the positions (x, y) of the three bodies."""
    m1, m2, m3 = masses

    def terms(a):
        """dJ/da and J, dV/da: positions over the crank angle by hand, two derivatives each."""
        s, c = np.sin(a), np.cos(a)
        b = np.arcsin(r * s / L)  # the rod slopes by -b
        b1 = r * c / (L * np.cos(b))
        b2 = (-r * s + L * np.sin(b) * b1**2) / (L * np.cos(b))
        # the rod's centre and the slider: velocities over a' and their slopes
        x1 = -r * s - L / 2 * np.sin(b) * b1
        x2 = -r * c - L / 2 * (np.cos(b) * b1**2 + np.sin(b) * b2)
        y1, y2 = r * c / 2, -r * s / 2
        z1 = -r * s - L * np.sin(b) * b1
        z2 = -r * c - L * (np.cos(b) * b1**2 + np.sin(b) * b2)
        J = m1 * r**2 / 3 + m2 * (x1**2 + y1**2) + m2 * L**2 / 12 * b1**2 + m3 * z1**2
        dJ = 2 * (m2 * (x1 * x2 + y1 * y2) + m2 * L**2 / 12 * b1 * b2 + m3 * z1 * z2)
        return J, dJ, G * (m1 * r / 2 * c + m2 * y1)

    def slope(_, y):
        J, dJ, dV = terms(y[0])
        return [y[1], -(0.5 * dJ * y[1] ** 2 + dV) / J]

    return solved(slope, [angle, speed], times)[:, 0]


def against_stop(times, mass, k, stop, gap, speed):
    """x of a mass on a spring that strikes an elastic stop, piece by piece: harmonic about 0, then about the point where
    spring and stop balance. No damping: the motion repeats.
    """
    w, wc, x0 = np.sqrt(k / mass), np.sqrt((k + stop) / mass), stop * gap / (k + stop)
    A = speed / w
    if gap >= A:
        return A * np.sin(w * np.asarray(times))
    reach = np.arcsin(gap / A) / w
    v = speed * np.cos(w * reach)
    # about x0 the motion is (gap - x0) cos + v/wc sin until it comes back to gap
    stay = 2 * np.arctan2(v / wc, gap - x0) / wc
    half = np.pi / w
    period = 2 * reach + stay + half
    out = []
    for t in np.mod(np.asarray(times, dtype=float), period):
        if t < reach:
            out.append(A * np.sin(w * t))
        elif t < reach + stay:
            s = wc * (t - reach)
            out.append(x0 + (gap - x0) * np.cos(s) + v / wc * np.sin(s))
        else:
            out.append(A * np.sin(w * (t - stay - 2 * reach) + np.pi))
    return np.array(out)


# --- planes -----


def swing(times, length=2.0, mass=336.14, rate=np.pi / 3):
    """Angle of the free rod from level (docs/theory.md (23.11)): its hinge on a rod that turns at a constant rate."""
    inertia, half = mass * length**2 / 12 + mass * length**2 / 4, mass * length / 2

    def slope(t, y):
        return [y[1], half * (length * rate**2 * np.sin(rate * t - y[0]) - G * np.cos(y[0])) / inertia]

    return solved(slope, [0.0, 0.0], times)[:, 0]


def rod_chain(times, lengths, masses, angles, rates=None):
    """Angles from level (n_t, n) of hanging rods in a row: M_ij cos(a_i - a_j) a_j" + M_ij sin(a_i - a_j) a_j'^2 + g w_i
    cos a_i = 0.
    """
    L, m = np.asarray(lengths, dtype=float), np.asarray(masses, dtype=float)
    n = len(L)
    beyond = np.array([m[i + 1 :].sum() for i in range(n)])
    couple = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            k = max(i, j)
            couple[i, j] = L[i] * L[j] * (m[i] / 3 + beyond[i] if i == j else m[k] / 2 + beyond[k])
    weight = G * L * (m / 2 + beyond)

    def slope(_, y):
        a, v = y[:n], y[n:]
        d = a[:, None] - a[None, :]
        return np.concatenate(
            [v, np.linalg.solve(couple * np.cos(d), -(couple * np.sin(d)) @ v**2 - weight * np.cos(a))]
        )

    start = np.concatenate([angles, np.zeros(n) if rates is None else rates])
    return solved(slope, start, times)[:, :n]


def rod_chain_end(angles, lengths):
    """(n_t, 3) of the chain's free end."""
    return plane(np.cos(angles) @ lengths, np.sin(angles) @ lengths)


def bead_on_arm(times, arm, bead, inertia, k, drawn, speed):
    """Distance and angle of a bead on a spring along an arm that turns freely: (J + m r^2) phi' = L, m r" = m r phi'^2 -
    k (r - r0), r0 the drawn distance; ``inertia`` of both about z, ``arm`` unused mass apart.
    """
    J = inertia + arm
    L = (J + bead * drawn**2) * speed

    def slope(_, y):
        rate = L / (J + bead * y[0] ** 2)
        return [y[1], y[0] * rate**2 - k / bead * (y[0] - drawn), rate]

    found = solved(slope, [drawn, 0.0, 0.0], times)
    return found[:, 0], found[:, 2]


def spring_pendulum(times, mass, k, length, start, velocity):
    """Position (n_t, 3) of a point mass on a spring from the origin: r" = g - k/m (1 - L0/|r|) r."""

    def slope(_, y):
        r = y[:3]
        pull = k / mass * (1 - length / np.linalg.norm(r))
        return np.concatenate([y[3:], -pull * r + np.array([0, -G, 0])])

    return solved(slope, np.concatenate([start, velocity]), times)[:, :3]


def spherical_pendulum(times, start, velocity):
    """Position (n_t, 3) of a point mass at a constant distance l from the origin: r" = g - (v.v + g.r) r / l^2."""
    start, g = np.asarray(start, dtype=float), np.array([0, 0, -G])
    square = start @ start

    def slope(_, y):
        r, v = y[:3], y[3:]
        return np.concatenate([v, g - (v @ v + g @ r) * r / square])

    return solved(slope, np.concatenate([start, velocity]), times)[:, :3]


def governor(times, arm, collar, inertia, spring, gravity, start, solve=solved_stiff):
    """Turn, lean of the arms and way of the collar of a governor whose two arms drive it through springs.

    ``arm``: moment of inertia about the hinge and about the rod, mass times the distance of its centre; ``inertia`` of shaft and
    collar about the axis; ``spring``: k, c, natural length, its place along the arm; ``start``: speed, lean, way.
    """
    (across, along, moment), (k, c, natural, b) = arm, spring

    def slope(_, y):
        lean, s, w, lean_rate, s_rate = y[1:]
        sin, cos = np.sin(lean), np.cos(lean)
        long = np.sqrt((b * sin) ** 2 + (s - b * cos) ** 2)
        by_lean, by_s = b * s * sin / long, (s - b * cos) / long
        force = k * (long - natural) + c * (by_lean * lean_rate + by_s * s_rate)
        turned = inertia + 2 * (across * sin**2 + along * cos**2)
        return [
            w,
            lean_rate,
            s_rate,
            -4 * (across - along) * sin * cos * lean_rate * w / turned,
            ((across - along) * sin * cos * w**2 - moment * gravity * sin - force * by_lean) / across,
            gravity - 2 * force * by_s / collar,
        ]

    speed, lean, s = start
    y = solve(slope, [0.0, lean, s, speed, 0.0, 0.0], times)
    return y[:, :3]


def five_bar_start():
    """Points 1, 2, 3 of docs/theory.md (23.12), between A (0, 0) and B (1, 0)."""
    return np.array([[-1.0, -1.0], [0.5, -2.0], [2.0, -1.0]])


def five_bar(times):
    """Points 1, 2, 3 (n_t, 3, 2) of the five-bar of docs/theory.md (23.12) in natural coordinates: [M P^T; P 0] [q"; lam] = [Q;
    -P' q'].
    """
    A, B, start = np.zeros(2), np.array([1.0, 0.0]), five_bar_start()
    m = np.array([1.0, 1.5, 1.5, 1.0])
    M1 = np.array(
        [[(m[0] + m[1]) / 3, m[1] / 6, 0], [m[1] / 6, (m[1] + m[2]) / 3, m[2] / 6], [0, m[2] / 6, (m[2] + m[3]) / 3]]
    )
    M = np.kron(M1, np.eye(2))
    weight = np.kron([(m[0] + m[1]) / 2, (m[1] + m[2]) / 2, (m[2] + m[3]) / 2], [0, -G])
    springs = [(2, A, np.sqrt(2**2 + 1**2)), (1, A, np.sqrt(0.5**2 + 2**2))]

    def jacobian(p):
        """Rows of (|.|^2)/2 of the four bars; linear in the points, so that P' is P of the velocities."""
        P = np.zeros((4, 3, 2))
        P[0, 0], P[3, 2] = p[0], p[2]
        P[1, 0], P[1, 1] = p[0] - p[1], p[1] - p[0]
        P[2, 1], P[2, 2] = p[1] - p[2], p[2] - p[1]
        return P

    def slope(_, y):
        p, v = y[:6].reshape(3, 2), y[6:].reshape(3, 2)
        P = jacobian(p)
        P[3, 2] = p[2] - B
        Q = weight.reshape(3, 2).copy()
        for point, anchor, natural in springs:
            d = p[point] - anchor
            Q[point] -= 100.0 * (1 - natural / np.linalg.norm(d)) * d
        J = P.reshape(4, 6)
        drift = jacobian(v).reshape(4, 6) @ v.reshape(6)
        big = np.block([[M, J.T], [J, np.zeros((4, 4))]])
        return np.concatenate([y[6:], np.linalg.solve(big, np.concatenate([Q.reshape(6), -drift]))[:6]])

    found = solved(slope, np.concatenate([start.reshape(6), np.zeros(6)]), times)
    return found[:, :6].reshape(-1, 3, 2)


def linear_chain(times, masses, k, c, start):
    """Displacements (n_t, n) of masses in a row from ground with springs k and dampers c between them, from rest at
    ``start``: modes of [0 1; -M^-1 K, -M^-1 C].
    """
    n = len(masses)
    D = np.eye(n) - np.eye(n, k=-1)
    K, C = D.T @ np.diag(k) @ D, D.T @ np.diag(c) @ D
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-K / np.asarray(masses)[:, None], -C / np.asarray(masses)[:, None]]])
    s, V = np.linalg.eig(A)
    weights = np.linalg.solve(V, np.concatenate([start, np.zeros(n)]))
    return np.real(np.exp(np.outer(times, s)) * weights @ V.T)[:, :n]


# --- rotations -----


def symmetric_top_axis(times, mass, arm, across, along, spin, axis, rate):
    """Unit axis (n_t, 3) of a heavy symmetric top about a fixed point, weight along -z: with L = J e x e' + S e,
    L' = arm e x m g, S = along * spin constant.
    """

    def slope(_, y):
        e, L = y[:3], y[3:]
        return np.concatenate([np.cross(L, e) / across, np.cross(arm * e, [0, 0, -mass * G])])

    e = np.asarray(axis, dtype=float)
    start = across * np.cross(e, rate) + along * spin * e
    return solved(slope, np.concatenate([e, start]), times)[:, :3]


def free_rotation(times, inertia, w):
    """Orientations (n_t, 3, 3) of a free body, identity at first; ``w`` about body axes, ``inertia`` principal."""

    def slope(_, y):
        p, v = y[:4], y[4:]
        turn = 0.5 * np.concatenate([[-p[1:] @ v], p[0] * v + np.cross(p[1:], v)])
        return np.concatenate([turn, -np.cross(v, inertia * v) / inertia])

    found = solved(slope, np.concatenate([[1, 0, 0, 0], w]), times)
    return np.array([matrix(q / np.linalg.norm(q)) for q in found[:, :4]])


def matrix(q):
    """Rotation matrix of a unit quaternion."""
    w, v = q[0], q[1:]
    S = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * S + 2 * S @ S


def free_spin(times, inertia, w1, w3):
    """Angular velocity (n_t, 3) in body axes of a free body that starts with (w1, 0, w3), inertias ascending, by Jacobi's
    elliptic functions (Landau and Lifshitz, Mechanics, 37).
    """
    I1, I2, I3 = inertia
    E2, M2 = I1 * w1**2 + I3 * w3**2, (I1 * w1) ** 2 + (I3 * w3) ** 2
    if M2 < E2 * I2:
        raise ValueError("this branch needs M^2 > 2 E I2: more spin about the third axis")
    tau = np.asarray(times) * np.sqrt((I3 - I2) * (M2 - E2 * I1) / (I1 * I2 * I3))
    k2 = (I2 - I1) * (E2 * I3 - M2) / ((I3 - I2) * (M2 - E2 * I1))
    sn, cn, dn, _ = ellipj(tau, k2)
    a1 = np.sqrt((E2 * I3 - M2) / (I1 * (I3 - I1)))
    a2 = np.sqrt((E2 * I3 - M2) / (I2 * (I3 - I2)))
    a3 = np.sqrt((M2 - E2 * I1) / (I3 * (I3 - I1)))
    return np.stack([a1 * cn, a2 * sn, a3 * dn], axis=1)


def skate(times, tilt, speed, spin):
    """Position (n_t, 3) of a blade under the centre of mass on a plane whose gravity pulls along -y by g sin(tilt): the
    blade starts along x with ``speed`` and turns at the constant rate ``spin`` (Neimark and Fufaev, Dynamics of
    Nonholonomic Systems, III.2): u' = -g sin(tilt) sin(w t), x' = u cos(w t), y' = u sin(w t).
    """
    t, w, a = np.asarray(times), spin, G * np.sin(tilt)
    c = speed - a / w  # u = c + (a/w) cos wt
    x = c * np.sin(w * t) / w + a / w * (t / 2 + np.sin(2 * w * t) / (4 * w))
    y = c * (1 - np.cos(w * t)) / w + a / w * np.sin(w * t) ** 2 / (2 * w)
    return plane(x, y)


def rolling(times, mass, radius, across, along, axis, centre, w):
    """Centre (n_t, 3) of a disc that rolls on z = 0: with r from the contact to the centre and v = w x r,
    J w' + m r x (w' x r) = -w x J w - m r x (w x r' + g z), all about the world's axes.
    """
    z = np.array([0.0, 0.0, 1.0])

    def slope(_, y):
        n, spin = y[:3], y[3:6]
        up = z - (z @ n) * n
        size = np.linalg.norm(up)
        dn = np.cross(spin, n)
        d_up = -(z @ dn) * n - (z @ n) * dn
        r, dr = radius * up / size, radius * (d_up / size - up * (up @ d_up) / size**3)
        J = across * np.eye(3) + (along - across) * np.outer(n, n)
        S = np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
        right = -np.cross(spin, J @ spin) - mass * np.cross(r, np.cross(spin, dr) + G * z)
        return np.concatenate([dn, np.linalg.solve(J - mass * S @ S, right), np.cross(spin, r)])

    return solved(slope, np.concatenate([axis, w, centre]), times)[:, 6:]


def over_bump(times, masses, springs, dampers, height, duration):
    """Displacements (n_t, 2) of wheel and body, and that of the road, whose bump is h (1 - cos w t) / 2: the exponential of
    x' = A x with the road's motion (1, cos w t, sin w t) among the states, up to the bump's end and after it.
    """
    from scipy.linalg import expm

    (m1, m2), (kt, ks), (ct, cs), w = masses, springs, dampers, 2 * np.pi / duration
    A = np.zeros((7, 7))
    A[0, 2], A[1, 3] = 1, 1
    A[2, :4] = np.array([-(kt + ks), ks, -(ct + cs), cs]) / m1
    A[3, :4] = np.array([ks, -ks, cs, -cs]) / m2
    A[2, 4:] = 0.5 * height / m1 * np.array([kt, -kt, ct * w])
    A[5, 6], A[6, 5] = -w, w
    start = np.array([0, 0, 0, 0, 1.0, 1.0, 0.0])
    end = expm(A * duration) @ start
    free = A[:4, :4]
    out = []
    for t in np.asarray(times, dtype=float):
        state = expm(A * t) @ start if t <= duration else expm(free * (t - duration)) @ end[:4]
        out.append([state[0], state[1], 0.5 * height * (1 - np.cos(w * t)) if t <= duration else 0.0])
    return np.array(out)
