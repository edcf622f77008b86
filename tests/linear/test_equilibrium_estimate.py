"""The error estimate of equilibria against 40-digit solutions."""

from __future__ import annotations

import jitter
import mbrs as mb
import mpmath as mp
import numpy as np
import pytest


def sagging_chain(rng):
    """A drawn-level chain of up to four links on sprung hinges, and the 40-digit moments about its hinges. Invented data."""
    n = int(rng.integers(1, 5))
    length, mass, k = rng.uniform(0.2, 1.5, n), 10 ** rng.uniform(-1, 1, n), 10 ** rng.uniform(0, 2.5, n)
    m, before, at, points = mb.Model("sagging", gravity=(0, 0, -9.81)), None, 0.0, []
    for i in range(n):
        centre = at + float(length[i]) / 2
        b = m.body(f"b{i}", mass=float(mass[i]), inertia=(1, 1, 1), at=(centre, 0, 0))
        m.revolute(f"j{i}", before or m.ground, b, at=(at, 0, 0), axis="y", k=float(k[i]))
        points.append((mp.mpf(at), mp.mpf(centre)))
        before, at = b, at + float(length[i])

    def moments(*angles):
        turned = [mp.fsum(angles[: i + 1]) for i in range(n)]

        def arm(i, j):
            links = (points[h + 1][0] - points[h][0] for h in range(i, j))
            inner = mp.fsum(a * mp.cos(turned[h]) for h, a in zip(range(i, j), links, strict=True))
            return inner + (points[j][1] - points[j][0]) * mp.cos(turned[j])

        weight = [mp.mpf(float(v)) * mp.mpf(9.81) for v in mass]
        return [mp.mpf(float(k[i])) * angles[i] - mp.fsum(weight[j] * arm(i, j) for j in range(i, n)) for i in range(n)]

    return m, n, moments


def angle_error(m, n, moments):
    """Largest true error of a link's angle and the estimate."""
    eq = mb.equilibrium(m)
    rotation = eq.poses["rotation"]
    angle = [float(np.arctan2(-r[2, 0], r[0, 0])) for r in rotation]
    relative = [(b - a + np.pi) % (2 * np.pi) - np.pi for a, b in zip([0.0, *angle[:-1]], angle, strict=True)]
    exact = mp.findroot(moments if n > 1 else lambda t: moments(t)[0], relative if n > 1 else relative[0], tol=1e-60)
    turned, true = mp.mpf(0), 0.0
    for i in range(n):
        turned += exact[i] if n > 1 else exact
        sine, cosine = mp.mpf(float(-rotation[i][2, 0])), mp.mpf(float(rotation[i][0, 0]))
        true = max(true, abs(float(sine * mp.cos(turned) - cosine * mp.sin(turned))))
    return true, eq.error


@pytest.mark.slow
@pytest.mark.exact
def test_estimated_error_is_the_true_one_over_random_cases():
    """true/estimated in [.01, 10] in 95 % of 200 random chains."""
    rng = np.random.default_rng(1)
    with mp.workdps(40):
        ratios = np.array([true / error for true, error in (angle_error(*sagging_chain(rng)) for _ in range(200))])
    good = int(np.sum((ratios >= 0.01) & (ratios <= 10)))
    print(f"estimates within [.01, 10]: {good} of 200, median {np.median(ratios):.2g}")
    assert good >= 190


@pytest.mark.parametrize("seed", range(12))
def test_converged_is_a_claim_about_the_forces(seed):
    """A load on a spring far from the origin, in random units: what is left over at the place found, and what the result calls it."""
    rng = np.random.default_rng([61, seed])
    unit, force = 10.0 ** rng.uniform(-4, 4, 2)
    stiff = 10.0 ** rng.uniform(0, 8)  # displacements by the load are lengths over this
    far = rng.normal(size=3) * 10.0 ** rng.uniform(0, 4) * unit
    down, k = rng.normal(size=3), stiff * force / unit
    down *= rng.uniform(0.3, 1.0) / np.linalg.norm(down)
    m = mb.Model("loaded", gravity=tuple(down * force))
    points = [far, far + unit * rng.normal(size=3)]
    for i, at in enumerate(points):
        b = m.body(f"b{i}", mass=1.0, inertia=np.full(3, 0.1 * unit**2), at=at)
        m.bushing(f"k{i}", m.ground, b, at=at, k=(k, k, k, *[k * unit**2] * 3))
    eq = mb.equilibrium(m)
    left = [down * force - k * (eq.position(f"b{i}") - np.array(m.value(f"b{i}.at"))) for i in range(2)]
    size = np.linalg.norm(down * force)
    residual = np.abs(left).max() / size
    print(
        f"stiffness {stiff:.0e}, {np.linalg.norm(far) / unit:.0e} lengths away: {residual:.1e}, {eq.residual:.1e}, {eq.status}"
    )
    noise = stiff * jitter.level() * 2 * np.linalg.norm(points) / unit  # the two points of a bushing
    assert eq.residual <= 4 * residual + 1e-12 or noise > 0
    if eq.status == "converged":
        assert residual < 2e-9 + noise / 0.3
    else:
        assert eq.status == "unresolved" and eq.residual > 1e-9 and any("rounding of places" in s for s in eq.doubts)
        assert eq.residual > 1e-9 and eq.error < 1e-9


def sprung_door(rng):
    """A heavy body on an oblique hinge far from the origin, held by a stiff spring at a short lever, in random units, and the 50-digit
    moment about the hinge. Invented data."""
    unit, force = 10.0 ** rng.uniform(-3, 3, 2)
    far = rng.normal(size=3) * 10.0 ** rng.uniform(0, 4) * unit
    axis, down = rng.normal(size=(2, 3))
    lever, stiff = 10.0 ** rng.uniform(-2, 0), 10.0 ** rng.uniform(1, 9)
    centre, end = far + unit * rng.normal(size=3), far + lever * unit * rng.normal(size=3)
    start = end + unit * rng.normal(size=3)
    k, rest = stiff * force / unit, float(np.linalg.norm(end - start)) * rng.uniform(0.9, 1.1)
    m = mb.Model("door", gravity=tuple(down * force))
    b = m.body("b", mass=1.0, inertia=np.full(3, 0.1 * unit**2), at=centre)
    m.revolute("h", m.ground, b, at=far, axis=axis)
    m.spring_damper("s", m.ground, b, at=(start, end), k=k, length=rest)

    def exact(v):
        return mp.matrix([mp.mpf(float(x)) for x in v])

    def dot(u, v):
        return mp.fdot(u, v)

    def cross(u, v):
        return mp.matrix([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])

    a = exact(axis) / mp.norm(exact(axis))
    weight, arms = exact(down * force), [exact(p) - exact(far) for p in (centre, end)]
    anchor, length = exact(start) - exact(far), mp.mpf(rest)

    def moment(angle):
        c, e = (p * mp.cos(angle) + cross(a, p) * mp.sin(angle) + a * (dot(a, p) * (1 - mp.cos(angle))) for p in arms)
        along = e - anchor
        pull = mp.mpf(k) * (mp.norm(along) - length) / mp.norm(along)
        return dot(a, cross(c, weight) - cross(e, along) * pull) / (mp.mpf(force) * mp.mpf(unit))

    return m, moment


@pytest.mark.exact
@pytest.mark.parametrize("seed", [*range(10), *(pytest.param(s, marks=pytest.mark.slow) for s in range(10, 100))])
def test_the_error_of_a_stiff_spring_far_away_is_stated(seed):
    """Against 50 digits: the stated error is at least a third of the true one, and no more than the rounding of places explains."""
    if jitter.level():
        pytest.skip("noise on far places moves points")
    with mp.workdps(50):
        m, moment = sprung_door(np.random.default_rng([62, seed]))
        eq = mb.equilibrium(m)
        angle = float(eq.state.q[0])
        true = abs(float(mp.findroot(moment, angle, tol=1e-60) - mp.mpf(angle)))
    print(
        f"true {true:.1e}, stated {eq.error:.1e}, residual {eq.residual:.1e}, {eq.status}, {eq.iterations} iterations"
    )
    assert true <= 3 * eq.error
    assert eq.error < 1e-7 and eq.iterations < 100
    assert (eq.status == "converged") == (eq.residual <= 1e-9)


def sprung_four_bar(rng):
    """A four-bar on parallel oblique hinges far from the origin, its coupler on a stiff spring, in random units: redundant rows. With it
    the work of its forces over a small turn of the crank, from a crank angle by 60 digits. Invented data."""
    unit, force = 10.0 ** rng.uniform(-3, 3, 2)
    far = rng.normal(size=3) * 10.0 ** rng.uniform(0, 6) * unit
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    flat = np.array([[0, 0], [0.6, 1.1], [2.3, 1.5], [2.1, 0.1]]) + 0.2 * rng.normal(size=(4, 2))
    points = far + unit * flat @ frame[:2]
    stiff, down = 10.0 ** rng.uniform(1, 9), frame[:2].T @ rng.normal(size=2) * force
    names, ends = ("crank", "coupler", "rocker"), [(0, 1), (1, 2), (3, 2)]
    centres = [points[list(e)].mean(axis=0) + 0.1 * unit * rng.normal(size=2) @ frame[:2] for e in ends]
    tip, start = (far + unit * (flat[1:3].mean(axis=0) + 0.5 * rng.normal(size=2)) @ frame[:2] for _ in range(2))
    k, rest = stiff * force / unit, float(np.linalg.norm(tip - start)) * rng.uniform(0.99, 1.01)
    m = mb.Model("four-bar", gravity=tuple(down))
    bodies = [m.body(b, mass=1.0, inertia=np.full(3, 0.1 * unit**2), at=c) for b, c in zip(names, centres, strict=True)]
    for i, (a, b) in enumerate([(m.ground, bodies[0]), tuple(bodies[:2]), tuple(bodies[1:]), (bodies[2], m.ground)]):
        m.revolute(f"h{i}", a, b, at=points[i], axis=frame[2])
    m.spring_damper("s", m.ground, bodies[1], at=(start, tip), k=k, length=rest)

    def plane(p):
        from_far = [mp.mpf(float(x)) - mp.mpf(float(y)) for x, y in zip(p, points[0], strict=True)]
        return mp.mpc(*(mp.fdot(from_far, [mp.mpf(float(v)) for v in axis]) for axis in frame[:2])) / mp.mpf(unit)

    A, B, C, D = (plane(p) for p in points)
    weight = mp.mpc(
        *(mp.fdot([mp.mpf(float(v)) for v in down], [mp.mpf(float(v)) for v in axis]) for axis in frame[:2])
    )
    side = mp.sign(mp.im(mp.conj(D - B) * (C - B)))

    def turns(angle):
        """Unit complex numbers by which the three bodies turn, and the points B, C."""
        b = A + (B - A) * mp.expj(angle)
        across, r, s = D - b, abs(C - B), abs(C - D)
        along = (abs(across) ** 2 + r**2 - s**2) / (2 * abs(across))
        c = b + across / abs(across) * mp.mpc(along, side * mp.sqrt(r**2 - along**2))
        return (mp.expj(angle), (c - b) / (C - B), (c - D) / (C - D)), b

    def energy(angle):
        (first, second, third), b = turns(angle)
        places = [A + (plane(centres[0]) - A) * first, b + (plane(centres[1]) - B) * second]
        places.append(D + (plane(centres[2]) - D) * third)
        stretch = abs(b + (plane(tip) - B) * second - plane(start)) - mp.mpf(rest) / mp.mpf(unit)
        fall = sum(mp.re(mp.conj(weight) * p) for p in places) / mp.mpf(force)
        return mp.mpf(k) * mp.mpf(unit) / mp.mpf(force) * stretch**2 / 2 - fall

    return m, names, frame, turns, energy


@pytest.mark.exact
@pytest.mark.parametrize("seed", [*range(10), *(pytest.param(s, marks=pytest.mark.slow) for s in range(10, 100))])
def test_the_error_of_a_loop_far_away_is_stated(seed):
    """Against 60 digits: the stated error is at least a third of the true one of each angle."""
    if jitter.level():
        pytest.skip("noise on far places moves points")
    with mp.workdps(60):
        m, names, frame, turns, energy = sprung_four_bar(np.random.default_rng([63, seed]))
        eq = mb.equilibrium(m)
        rotations = dict(zip(eq.bodies, eq.poses["rotation"], strict=True))
        found = [np.arctan2(frame[1] @ rotations[b] @ frame[0], frame[0] @ rotations[b] @ frame[0]) for b in names]
        exact = mp.findroot(lambda a: mp.diff(energy, a), mp.mpf(float(found[0])), tol=1e-40)
        true = max(
            abs(float(mp.arg(z * mp.expj(-mp.mpf(float(a)))))) for z, a in zip(turns(exact)[0], found, strict=True)
        )
    print(
        f"true {true:.1e}, stated {eq.error:.1e}, residual {eq.residual:.1e}, {eq.status}, {eq.iterations} iterations"
    )
    assert true <= 3 * eq.error + 4 * np.finfo(float).eps
    assert eq.error < 1e-3
