"""Rolling in motion: eigenvalues of a bicycle and a disc at speed against published matrices and a closed form."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import pytest
from scipy.linalg import eigvals

# J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab, Linearized dynamics equations for the balance and steer of a bicycle: a
# benchmark and review, Proc. R. Soc. A 463 (2007) 1955-1982, table 1 and equations (6.4) to (6.7): M q" + v C1 q' + (g K0 + v^2 K2) q.
MASS = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
K0 = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
K2 = np.array([[0.0, 76.59734589573222], [0.0, 2.65431523794604]])
C1 = np.array([[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])
G, WHEELBASE, TRAIL, TILT = 9.81, 1.02, 0.08, np.pi / 10
REAR, FRONT = 0.3, 0.35


def frame(seed: int) -> np.ndarray:
    """Directions of travel, to the side and downwards (or upwards) along any of the world axes; seeds from 100 on lean freely."""
    rng = np.random.default_rng(seed)
    if seed >= 100:
        q, r = np.linalg.qr(rng.normal(size=(3, 3)))
        q = q * np.sign(np.diag(r))
    else:
        q = np.eye(3)[rng.permutation(3)] * rng.choice([-1.0, 1.0], 3)
    return np.asarray(q * np.sign(np.linalg.det(q)))


def bicycle(v: float, seed: int, unit: float = 1.0) -> mb.Model:
    """x forwards, y to the right, z down, in a random frame; ``unit`` lengths to the metre, masses in 1/unit kg."""
    R, kg = frame(seed), 1.0 / unit
    m = mb.Model("bicycle", gravity=tuple(G * unit * R[:, 2]))
    moves = tuple(v * unit * R[:, 0])

    def place(x: float, z: float) -> np.ndarray:
        return np.asarray(unit * R @ [x + 0.3, -0.4, z])

    def body(name: str, mass: float, inertia: np.ndarray, at: np.ndarray, spin: float = 0.0):
        return m.body(name, mass=mass * kg, inertia=inertia * kg * unit**2, at=at, orientation=R, velocity=moves,
                      angular_velocity=tuple(spin * R[:, 1]))  # fmt: skip

    rear = body("rear wheel", 2.0, np.diag([0.0603, 0.12, 0.0603]), place(0, -REAR), -v / REAR)
    back = body("rear frame", 85.0, np.array([[9.2, 0, 2.4], [0, 11, 0], [2.4, 0, 2.8]]), place(0.3, -0.9))
    fork = np.array([[0.05892, 0, -0.00756], [0, 0.06, 0], [-0.00756, 0, 0.00708]])
    head = body("front frame", 4.0, fork, place(0.9, -0.7))
    front = body("front wheel", 3.0, np.diag([0.1405, 0.28, 0.1405]), place(WHEELBASE, -FRONT), -v / FRONT)
    m.revolute("rear axle", back, rear, at=place(0, -REAR), axis=R[:, 1])
    m.revolute("front axle", head, front, at=place(WHEELBASE, -FRONT), axis=R[:, 1])
    m.revolute("steer", back, head, at=place(WHEELBASE + TRAIL, 0.0), axis=R @ [np.sin(TILT), 0, np.cos(TILT)])
    for name, wheel, x, radius in (("rear contact", rear, 0.0, REAR), ("front contact", front, WHEELBASE, FRONT)):
        at = (place(x, 0.0), place(x, -radius))
        m.rolling_disc(name, m.ground, wheel, at=at, axis=-R[:, 2], axis2=R[:, 1], radius=radius * unit)
    return m


def exact(v: float) -> np.ndarray:
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(MASS, np.hstack([G * K0 + v * v * K2, v * C1]))]])
    return np.asarray(eigvals(A))


def holds(roots: np.ndarray, known: np.ndarray, tolerance: float) -> None:
    for s in known:
        assert np.min(np.abs(roots - s)) < tolerance * max(1.0, abs(s)), (s, roots)


def parted(v: float) -> float:
    """What noise makes of the double root of the third freedom, the speed itself, which nothing changes: noise of some twenty numbers
    parts it by the root of itself times the sizes of the terms g/b and (v/b)^2.
    """
    return np.sqrt(20 * jitter.level() * (G / WHEELBASE + (v / WHEELBASE) ** 2))


@pytest.mark.parametrize("v, seed, unit", [(0.0, 1, 1.0), (1.0, 2, 1e3), (3.5, 3, 1.0), (5.0, 4, 1e3), (9.7, 5, 1.0)])
def test_a_bicycle_at_speed(v, seed, unit):
    m = bicycle(v, seed, unit)
    assert mb.System(m).dof == 3
    found = mb.modes(m)
    print(v, np.sort_complex(found.roots), np.sort_complex(exact(v)))
    holds(found.roots, exact(v), 1e-7)
    assert np.sum(np.abs(found.roots) < 1e-6 + parted(v)) == 2


@pytest.mark.parametrize(
    "v, seed, unit",
    [
        (3.5, 101, 1.0),
        (5.0, 102, 1.0),
        (1.0, 103, 1e3),
        (9.7, 104, 1e-2),
        (6.0, 105, 1.0),
        (6.1, 112, 1.0),
        (8.8, 115, 1.0),
    ],
)
def test_a_bicycle_in_any_direction(v, seed, unit):
    """World axes mix heading, lean and spin of the rear wheel, whose body carries the others."""
    found = mb.modes(bicycle(v, seed, unit)).roots
    holds(found, exact(v), 1e-7)
    assert np.sum(np.abs(found) < 1e-6 + parted(v)) == 2


@pytest.mark.parametrize("seed", [101, 102, 112])
def test_a_force_along_the_path_is_refused_in_any_direction(seed):
    """A spring to the side, from 1e-3 N/m on; one of 1e-9 N/m moves roots by less than 1e-10."""

    def held(k: float) -> mb.Model:
        m, R = bicycle(5.0, seed), frame(seed)
        m.bushing("side", m.ground, m["rear frame"], at=R @ [0.6, -0.4, -0.9], orientation=R, k=(0, k, 0, 0, 0, 0))
        return m

    for k in (1e-3, 1.0, 1e3):
        with pytest.raises(mb.ModelError, match="where it has rolled to"):
            mb.modes(held(k))
    holds(mb.modes(held(1e-9)).roots, exact(5.0), 1e-9)


def test_the_published_eigenvalues(case):
    """Table 2 of the same paper at 5 m/s."""
    known = [-0.775341882195845 + 4.464867713788898j, -0.322866429004087, -14.078389692798220]
    found = mb.modes(bicycle(5.0, 6))
    ours = [found.roots[np.argmin(np.abs(found.roots - s))] for s in known]
    case("bicycle at 5 m/s: weave, capsize and castering", topic="modes", kind="publication", ours=ours, known=known, within=1e-7,
         uncertainty=1e-14, source="Meijaard, Papadopoulos, Ruina and Schwab, Proc. R. Soc. A 463 (2007) 1955, table 2",
         estimate=found.error, unit="1/s")  # fmt: skip


def test_a_steady_motion_that_rolls():
    m = bicycle(0.0, 7)
    at = mb.steady_motion(m, {"rear axle": -5.0 / REAR})
    assert at.frame == "fixed"
    assert np.linalg.norm(at.poses["velocity"][1]) == pytest.approx(5.0, rel=1e-9)
    holds(mb.modes(m, at=at).roots, exact(5.0), 1e-7)


def disc(v: float, seed: int, heading: float = 0.0) -> tuple[mb.Model, np.ndarray]:
    """A disc that rolls upright, and its roots; ``heading``: how fast it turns, over its spin.

    A y" = C W f' (heading y, lean f), (A + m r^2) f" = m g r f - (C + m r^2) W y':
    s^2 = (m g r - C (C + m r^2) W^2/A)/(A + m r^2).
    """
    mass, r, A, C = 2.0, 0.3, 0.05, 0.09
    R, W = frame(seed), v / 0.3
    m = mb.Model("disc", gravity=tuple(-G * R[:, 2]))
    b = m.body("disc", mass=mass, inertia=(A, C, A), at=R @ [0, 0, r], orientation=R, velocity=tuple(v * R[:, 0]),
               angular_velocity=tuple(W * R[:, 1] + heading * W * R[:, 2]))  # fmt: skip
    m.rolling_disc("track", m.ground, b, at=(R @ [0.5, 0.2, 0], R @ [0, 0, r]), axis=R[:, 2], axis2=R[:, 1], radius=r)
    s = np.sqrt(complex((mass * G * r - C * (C + mass * r * r) * W * W / A) / (A + mass * r * r)))
    return m, np.array([s, -s])


@pytest.mark.parametrize("v, seed", [(0.3, 20), (2.0, 21), (7.0, 22)])
def test_a_disc_that_rolls_straight(v, seed):
    m, roots = disc(v, seed)
    holds(mb.modes(m).roots, roots, 1e-8)


@pytest.mark.parametrize("seed", [101, 102, 103])
def test_a_path_that_bends_by_a_hundred_millionth_is_a_curve(seed):
    """Over the spin of the disc; by a hundredth of that it is straight, and the roots are those of the straight path."""
    m, roots = disc(2.0, seed, 1e-10)
    holds(mb.modes(m).roots, roots, 1e-8)
    with pytest.raises(mb.ModelError, match="moves on a curve"):
        mb.modes(disc(2.0, seed, 1e-8)[0])


def test_a_disc_on_a_curve_is_refused():
    """Its heading changes, and with it the linearisation in axes that stand."""
    R = frame(131)
    m = mb.Model("curve", gravity=tuple(-G * R[:, 2]))
    b = m.body("disc", mass=2.0, inertia=(0.05, 0.09, 0.05), at=R @ [0, 0, 0.3], orientation=R, velocity=tuple(R[:, 0]),
               angular_velocity=tuple(R @ [0, 1 / 0.3, 0.5]))  # fmt: skip
    m.rolling_disc("track", m.ground, b, at=(R @ [0, 0, 0], R @ [0, 0, 0.3]), axis=R[:, 2], axis2=R[:, 1], radius=0.3)
    with pytest.raises(mb.ModelError, match="'track'"):
        mb.linearize(m)


def test_a_trailer_is_refused():
    """It follows its hitch by an equation of first order, a' = -v/l a."""
    R = frame(131)
    m = mb.Model("trailer")
    front = m.body(
        "tractor", mass=3.0, inertia=(0.1, 0.1, 0.2), at=R @ [0, 0, 0], orientation=R, velocity=tuple(R[:, 0])
    )
    back = m.body(
        "trailer", mass=1.0, inertia=(0.1, 0.1, 0.1), at=R @ [-1.0, 0, 0], orientation=R, velocity=tuple(R[:, 0])
    )
    m.planar("ice", m.ground, front, at=R @ [0, 0, 0], axis=R[:, 2])
    m.knife_edge("front blade", m.ground, front, at=R @ [0, 0, 0], axis=R[:, 1])
    m.revolute("hitch", front, back, at=R @ [-0.3, 0, 0], axis=R[:, 2])
    m.knife_edge("rear blade", m.ground, back, at=R @ [-1.2, 0, 0], axis=R[:, 1])
    with pytest.raises(mb.ModelError, match="blade"):
        mb.linearize(m)
