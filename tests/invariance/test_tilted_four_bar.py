"""A four-bar in a random plane, its hinge axes off the normal by delta: within the accuracy of a drawing (1e-7) it is the
planar one in every analysis, beyond it is locked in every analysis, and what is between is named.
"""

import re
import warnings
from functools import lru_cache

import mbrs as mb
import numpy as np
import pytest

SEEDS = (3, 4, 5)


def four_bar(delta, seed, **given):
    """Three rods and a spring in a plane through the origin; each of four hinges is tilted at random."""
    random = np.random.default_rng(seed)
    n = random.normal(size=3)
    n /= np.linalg.norm(n)
    u = np.cross(n, random.normal(size=3))
    u /= np.linalg.norm(u)
    v = np.cross(n, u)

    def place(p):
        return tuple(p[0] * u + p[1] * v)

    def axis():
        return tuple(n + delta * (np.column_stack([u, v]) @ random.standard_normal(2)))

    m = mb.Model("four-bar", gravity=tuple(-9.81 * v), **given)
    a, b, c, d = (np.array(p) for p in ((0.0, 0.0), (0.3, 0.8), (1.2, 1.0), (1.1, 0.0)))
    crank, coupler, rocker = (
        m.body(name, mass=1.0, inertia=(0.1, 0.1, 0.1), at=place((p + q) / 2))
        for name, p, q in (("crank", a, b), ("coupler", b, c), ("rocker", d, c))
    )
    for name, one, two, at in (
        ("A", m.ground, crank, a),
        ("B", crank, coupler, b),
        ("D", m.ground, rocker, d),
        ("C", coupler, rocker, c),
    ):
        m.revolute(name, one, two, at=place(at), axis=axis())
    m.spring_damper("s", m.ground, crank, at=(place((-1.0, 0.6)), place(b)), k=200.0)
    return m


def dof(m):
    return float(mb.System(m).dof)


def frequency(m):
    return float(mb.modes(m, at=mb.equilibrium(m)).frequency[0])


def motion(method, **given):
    def way(m):
        traj = mb.simulate(m, t=0.5, method=method, **given)
        assert traj.status == "finished"
        x = traj.position("crank")
        return float(np.linalg.norm(x[-1] - x[0]))

    return way


ANALYSES = {
    "System": dof,
    "modes": frequency,
    "auto": motion("auto", rtol=1e-7),
    "explicit": motion("explicit", rtol=1e-7),
    "generalized-alpha": motion("generalized-alpha", step=5e-3),
    "bdf": motion("bdf", rtol=1e-7),
    "ali3p": motion("ali3p", step=5e-3),
    "radau": motion("radau", rtol=1e-7),
    "bdf-bfgs": motion("bdf-bfgs", rtol=1e-7),
}
INTEGRATORS = [name for name in ANALYSES if name not in ("System", "modes")]
FREE = [1e-15, 1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 3e-9, 1e-8]
LOCKING = [1e-6, 1e-5, 1e-4]


@lru_cache
def as_drawn_exactly(analysis):
    """The planar answer, of axes that are parallel to rounding; it does not depend on the plane."""
    return ANALYSES[analysis](four_bar(0.0, SEEDS[0]))


def test_the_planar_answers():
    """1.46534 Hz and .018320 m: by hand-reduced equations of the planar four-bar in plain NumPy."""
    f, moved = planar_truth()
    assert frequency(four_bar(0.0, 3)) == pytest.approx(f, rel=1e-7)
    assert ANALYSES["explicit"](four_bar(0.0, 3)) == pytest.approx(moved, rel=1e-5)


@lru_cache
def planar_truth():
    """Frequency at rest and way of the crank's centre in half a second: one angle, T = I(q) q'^2 / 2, V(q)."""
    from scipy.integrate import solve_ivp
    from scipy.optimize import brentq, minimize_scalar

    a, b, c, d = (np.array(p) for p in ((0.0, 0.0), (0.3, 0.8), (1.2, 1.0), (1.1, 0.0)))
    foot = np.array([-1.0, 0.6])
    crank, coupler, rocker = np.linalg.norm(b - a), np.linalg.norm(c - b), np.linalg.norm(c - d)
    free = np.linalg.norm(b - foot)

    def pose(q):
        head = crank * np.array([np.cos(q), np.sin(q)])
        line = d - head
        far = np.linalg.norm(line)
        along = (coupler**2 - rocker**2 + far**2) / (2 * far)
        e = line / far
        return head, head + along * e + np.sqrt(coupler**2 - along**2) * np.array([-e[1], e[0]])

    def coordinates(q):
        """Centres of the rods and their angles."""
        head, top = pose(q)
        angle = [q, np.arctan2(*(top - head)[::-1]), np.arctan2(*(top - d)[::-1])]
        return np.concatenate([head / 2, (head + top) / 2, (d + top) / 2, angle])

    weight = np.array([1.0] * 6 + [0.1] * 3)

    def potential(q):
        x = coordinates(q)
        return 9.81 * (x[1] + x[3] + x[5]) + 100.0 * (np.linalg.norm(pose(q)[0] - foot) - free) ** 2

    def slope(f, q, h=1e-3):
        """Fourth-order difference."""
        return (8 * (f(q + h) - f(q - h)) - (f(q + 2 * h) - f(q - 2 * h))) / (12 * h)

    def inertia(q):
        return weight @ slope(coordinates, q) ** 2

    def rate(t, y):
        q, w = y
        return [w, -(slope(potential, q) + 0.5 * slope(inertia, q) * w * w) / inertia(q)]

    start = float(np.arctan2(0.8, 0.3))
    end = solve_ivp(rate, (0, 0.5), [start, 0.0], rtol=1e-10, atol=1e-12).y[0, -1]
    moved = np.linalg.norm(pose(end)[0] - pose(start)[0]) / 2
    near = minimize_scalar(potential, (start - 0.1, start)).x
    rest = brentq(lambda q: slope(potential, q), near - 0.05, near + 0.05, xtol=1e-14)
    return np.sqrt(slope(lambda q: slope(potential, q), rest) / inertia(rest)) / (2 * np.pi), moved


@pytest.mark.some(18)
@pytest.mark.parametrize("delta", FREE)
@pytest.mark.parametrize("analysis", ANALYSES)
def test_a_little_tilt_is_the_planar_four_bar(analysis, delta):
    exact = as_drawn_exactly(analysis)
    for seed in SEEDS:
        assert ANALYSES[analysis](four_bar(delta, seed)) == pytest.approx(exact, rel=1e-6)


def is_free(analysis, m):
    """Whether an analysis lets it move; an analysis that refuses does not."""
    try:
        return ANALYSES[analysis](m) > 1e-4
    except mb.MbrsError:
        return False


@pytest.mark.parametrize("seed", SEEDS)
def test_at_the_tolerance_all_analyses_agree(seed):
    m = four_bar(1e-7, seed)
    assert len({is_free(analysis, m) for analysis in ANALYSES}) == 1


@pytest.mark.some(13)
@pytest.mark.parametrize("delta", LOCKING)
@pytest.mark.parametrize("analysis", ANALYSES)
def test_much_tilt_locks_it(analysis, delta):
    assert not any(is_free(analysis, four_bar(delta, seed)) for seed in SEEDS)


def what_is_said(analysis, m):
    """All that a user reads: warnings, and the error or the printed result."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            result = str(analysis(m))
        except mb.MbrsError as reason:
            result = str(reason)
    return "\n".join([result, *(str(w.message) for w in caught)])


WHOLE = {
    "System": mb.System,
    "modes": mb.modes,
    "equilibrium": mb.equilibrium,
    "auto": lambda m: mb.simulate(m, t=0.01),
    "explicit": lambda m: mb.simulate(m, t=0.01, method="explicit"),
    "generalized-alpha": lambda m: mb.simulate(m, t=0.01, method="generalized-alpha", step=5e-3),
    "bdf": lambda m: mb.simulate(m, t=0.01, method="bdf"),
    "ali3p": lambda m: mb.simulate(m, t=0.01, method="ali3p", step=5e-3),
    "radau": lambda m: mb.simulate(m, t=0.01, method="radau"),
    "bdf-bfgs": lambda m: mb.simulate(m, t=0.01, method="bdf-bfgs"),
}


@pytest.mark.parametrize("delta", LOCKING)
@pytest.mark.parametrize("analysis", WHOLE)
def test_a_locked_one_says_what_would_free_it(analysis, delta):
    """ "would move if the hinges A, B, C, D were parallel: free one rotation, or tolerance=..."."""
    said = what_is_said(WHOLE[analysis], four_bar(delta, SEEDS[0]))
    assert "tolerance=" in said and all(re.search(rf"\b{name}\b", said) for name in "ABCD")


@pytest.mark.parametrize("delta", [1e-12, 1e-10, 1e-8])
@pytest.mark.parametrize("analysis", WHOLE)
def test_a_doubtful_one_names_its_hinges(analysis, delta):
    said = what_is_said(WHOLE[analysis], four_bar(delta, SEEDS[0]))
    assert "less than the tolerance" in said and all(f"'{name}'" in said for name in "ABCD")


@pytest.mark.parametrize("delta", LOCKING)
@pytest.mark.parametrize("analysis", ANALYSES)
def test_it_moves_again_with_the_tolerance_that_the_message_gives(analysis, delta):
    """The planar answer, up to the tilt."""
    said = what_is_said(mb.System, four_bar(delta, SEEDS[0]))
    tolerance = float(re.search(r"tolerance=([0-9.e+-]*[0-9])", said).group(1))
    assert delta / 10 < tolerance < 100 * delta
    found = ANALYSES[analysis](four_bar(delta, SEEDS[0], tolerance=tolerance))
    assert found == pytest.approx(as_drawn_exactly(analysis), rel=100 * delta)
