"""The zoo: models with known answers and where these come from, for tests, docs and benches.

Each function returns a `Problem`; numbers without a source are invented. Answers are closed forms, evaluated here.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Any

import mbrs as mb
import numpy as np
import scipy.sparse as sp
from mbrs._lib.rotations import quaternion_matrix
from mbrs.model.rotations import rotation
from numpy.polynomial import laguerre
from scipy.optimize import brentq

G = 9.81


@dataclass
class Problem:
    """A model, what is known about it, and the source."""

    model: Any
    answer: dict[str, Any]
    source: str
    notes: dict[str, Any] = field(default_factory=dict)


def rod(m, name, at, length, mass=1.0, angle=0.0):
    """A uniform rod along its local x axis, turned by ``angle`` about z; its slight inertia about x is invented."""
    transverse = mass * length**2 / 12
    turn = rotation("z", angle) if angle else None
    return m.body(name, mass=mass, inertia=(1e-3 * transverse, transverse, transverse), at=at, orientation=turn)


def point_mass(m, name, mass, at):
    """A mass without inertia of its own, which joints must make up for."""
    return m.body(name, mass=mass, inertia=(0.0, 0.0, 0.0), at=at)


# --- one and two degrees of freedom -----


def hanging_rod():
    m = mb.Model("hanging rod", gravity=(0, -G, 0))
    r = rod(m, "rod", (0, -0.5, 0), 1.0, angle=-np.pi / 2)
    m.revolute("hinge", m.ground, r, at=(0, 0, 0), axis="z")
    return Problem(m, {"frequency": [np.sqrt(1.5 * G) / (2 * np.pi)]}, "uniform rod, omega^2 = 3 g / 2 L")


def inverted_rod():
    m = mb.Model("inverted rod", gravity=(0, -G, 0))
    r = rod(m, "rod", (0, 0.5, 0), 1.0, angle=np.pi / 2)
    m.revolute("hinge", m.ground, r, at=(0, 0, 0), axis="z")
    return Problem(m, {"roots": np.array([1, -1]) * np.sqrt(1.5 * G)}, "uniform rod upside down, s^2 = 3 g / 2 L")


def level_rod():
    m = mb.Model("level rod", gravity=(0, -G, 0))
    r = rod(m, "rod", (0.5, 0, 0), 1.0)
    m.revolute("hinge", m.ground, r, at=(0, 0, 0), axis="z")
    return Problem(m, {"position": {"rod": (0, -0.5, 0)}}, "it falls and hangs")


def hanging_four_bar(reverse=False):
    """Three uniform rods of 1 m and 1 kg: 5/3 of a rod's m L^2 turns, 2 m g L restores."""
    m = mb.Model("hanging four-bar", gravity=(0, -G, 0))
    a = rod(m, "left", (0, -0.5, 0), 1.0, angle=-np.pi / 2)
    c = rod(m, "right", (1, -0.5, 0), 1.0, angle=-np.pi / 2)
    b = rod(m, "coupler", (0.5, -1, 0), 1.0)
    for name, one, two, at in (
        ("A", m.ground, a, (0, 0, 0)),
        ("B", a, b, (0, -1, 0)),
        ("C", b, c, (1, -1, 0)),
        ("D", c, m.ground, (1, 0, 0)),
    ):
        m.revolute(name, *((two, one) if reverse else (one, two)), at=at, axis="z")
    return Problem(
        m, {"frequency": [np.sqrt(1.2 * G) / (2 * np.pi)]}, "rods: T = 5/6 m L^2 phi'^2, V = -2 m g L cos phi"
    )


def hanging_masses(n, mass=1.0, length=0.7):
    """n equal point masses on equal massless links in the plane, one below the other."""
    m = mb.Model("hanging masses", gravity=(0, -G, 0))
    before = m.ground
    for i in range(n):
        b = point_mass(m, f"b{i}", mass, (0, -length * (i + 1), 0))
        m.revolute(f"h{i}", before, b, at=(0, -length * i, 0), axis="z")
        before = b
    roots = laguerre.lagroots(np.eye(n + 1)[n])
    answer = {"frequency": np.sort(np.sqrt(G / length * roots)) / (2 * np.pi)}
    return Problem(m, answer, "D. Bernoulli's chain: omega^2 l/g are the zeros of the Laguerre polynomial L_n")


def ziegler(load, k=1.0, mass=1.0, length=1.0):
    """Two links with hinge springs, masses 2 m and m at their ends, a follower force pressing on the second."""
    m = mb.Model("Ziegler")
    one = point_mass(m, "one", 2 * mass, (length, 0, 0))
    two = point_mass(m, "two", mass, (2 * length, 0, 0))
    m.revolute("base", m.ground, one, at=(0, 0, 0), axis="z", k=k)
    m.revolute("middle", one, two, at=(length, 0, 0), axis="z", k=k)
    m.force("follower", two, at=(2 * length, 0, 0), value=(-load, 0, 0), frame="body")
    unit = k / (mass * length**2)
    p = load * length / k
    squares = np.roots([2.0, (7 - 2 * p) * unit, unit**2]).astype(complex)
    roots = np.concatenate([np.sqrt(squares), -np.sqrt(squares)])
    answer = {"roots": roots, "critical": (3.5 - np.sqrt(2)) * k / length}
    return Problem(m, answer, "Ziegler, Ing.-Arch. 20 (1952) 49-56, without damping: 2 s^4 + (7 - 2p) s^2 + 1 = 0")


def buckled_link(load, k=10.0, length=1.0, angle=0.1):
    """A link on a hinge spring under a dead force along it, drawn slightly off: k (phi - drawn) = P l sin phi."""
    m = mb.Model("buckled link")
    x, y = length * np.cos(angle), length * np.sin(angle)
    b = rod(m, "link", (x / 2, y / 2, 0), length, angle=angle)
    m.revolute("hinge", m.ground, b, at=(0, 0, 0), axis="z", k=k)
    m.force("push", b, at=(x, y, 0), value=(-load, 0, 0))
    phi = brentq(lambda q: k * (q - angle) - load * length * np.sin(q), angle, np.pi, xtol=1e-15, rtol=1e-15)
    answer = {"phi": phi, "frequency": [np.sqrt((k - load * length * np.cos(phi)) / (length**2 / 3)) / (2 * np.pi)]}
    return Problem(m, answer, "moment about the hinge; the root by bracketing")


def spring_pendulum(k=200.0, mass=2.0, natural=0.5):
    """A mass on a rail below a spring: it sags by m g / k; drawn at the natural length."""
    m = mb.Model("sagging mass", gravity=(0, 0, -G))
    b = m.body("mass", mass=mass, inertia=(0.01, 0.01, 0.01), at=(0, 0, -natural))
    m.prismatic("rail", m.ground, b, at=(0, 0, -natural), axis="z")
    m.spring_damper("spring", m.ground, b, at=((0, 0, 0), (0, 0, -natural)), k=k)
    answer = {"position": {"mass": (0, 0, -natural - mass * G / k)}, "frequency": [np.sqrt(k / mass) / (2 * np.pi)]}
    return Problem(m, answer, "Hooke")


def preloaded_string(tension=50.0, mass=0.5, half=1.0):
    """A mass in the middle of two stretched springs: across them only the tension restores, 2 T / l."""
    m = mb.Model("string")
    b = m.body("bead", mass=mass, inertia=(0.01, 0.01, 0.01), at=(0, 0, 0))
    m.planar("glide", m.ground, b, at=(0, 0, 0), axis="z", k=(0, 0, 5.0))
    k = 300.0
    m.spring_damper("left", m.ground, b, at=((-half, 0, 0), (0, 0, 0)), k=k, preload=tension)
    m.spring_damper("right", m.ground, b, at=((half, 0, 0), (0, 0, 0)), k=k, preload=tension)
    squares = [2 * tension / half / mass, 2 * k / mass, 5.0 / 0.01]
    return Problem(m, {"frequency": np.sort(np.sqrt(squares)) / (2 * np.pi)}, "taut string: lateral stiffness 2 T / l")


# --- ill-scaled and special -----


def two_on_rails(k1, k2, m1=1.0, m2=1.0, c1=None):
    """ground - k1 - m1 - k2 - m2 along x."""
    m = mb.Model("two masses")
    a = m.body("a", mass=m1, inertia=(1, 1, 1), at=(0, 0, 0))
    b = m.body("b", mass=m2, inertia=(1, 1, 1), at=(1, 0, 0))
    m.prismatic("first", m.ground, a, at=(0, 0, 0), axis="x", k=k1, c=c1)
    m.prismatic("second", a, b, at=(1, 0, 0), axis="x", k=k2)
    # s^4 + s^2 (k1/m1 + k2/m1 + k2/m2) + k1 k2/(m1 m2): the smaller square from the product, to avoid cancellation
    total, product = (k1 + k2) / m1 + k2 / m2, k1 / m1 * (k2 / m2)
    high = 0.5 * (total + np.sqrt(max(total**2 - 4 * product, 0.0)))
    answer = {"frequency": np.sqrt([product / high, high]) / (2 * np.pi)}
    return Problem(m, answer, "quadratic in s^2")


def critical_damper(k=50.0, mass=2.0):
    m = mb.Model("critical")
    b = m.body("b", mass=mass, inertia=(1, 1, 1), at=(0, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=k, c=2 * np.sqrt(k * mass))
    return Problem(m, {"root": -np.sqrt(k / mass)}, "c = 2 sqrt(k m): one double root, one vector")


def free_pair(k=500.0, m1=2.0, m2=3.0):
    """Two bodies in space joined by a slider along x: six rigid modes and one vibration with the reduced mass."""
    m = mb.Model("free pair")
    a = m.body("a", mass=m1, inertia=(0.2, 0.3, 0.4), at=(0, 0, 0))
    b = m.body("b", mass=m2, inertia=(0.5, 0.4, 0.3), at=(1, 0, 0))
    m.prismatic("slide", a, b, at=(0.5, 0, 0), axis="x", k=k)
    reduced = m1 * m2 / (m1 + m2)
    return Problem(m, {"frequency": [0.0] * 6 + [np.sqrt(k / reduced) / (2 * np.pi)]}, "reduced mass")


def spinning_top(speed, k=40.0, polar=0.02, transverse=0.012, carrier=1e-3):
    """A disc on a shaft held by two crossed hinges with equal springs, spinning at ``speed``.

    (I_t + I_c) (a", b") + polar * speed (b', -a') + k (a, b) = 0: s = i w, w^2 (I) -+ w p O - k = 0.
    """
    m = mb.Model("spinning top")
    g = m.body("gimbal", mass=1.0, inertia=(carrier, carrier, carrier), at=(0, 0, 0))
    d = m.body("disc", mass=1.0, inertia=(transverse, transverse, polar), at=(0, 0, 0), angular_velocity=(0, 0, speed))
    m.universal("support", m.ground, g, at=(0, 0, 0), axis="x", axis2="y", k=(k, k))
    m.revolute("shaft", g, d, at=(0, 0, 0), axis="z")
    i = transverse + carrier
    h = polar * speed
    fast = (h + np.sqrt(h * h + 4 * i * k)) / (2 * i)
    answer = {"omega": [0.0, k / i / fast, fast]}
    return Problem(m, answer, "linear gyroscope on an isotropic support; the slow root from the product k/I")


def cubic_hexapod():
    """The isolator of the examples: 15.9155 Hz three times, 18.3776 twice, 36.7553 (docs/theory.md (23.1))."""
    known = hexapod_matrices()
    return Problem(mb.examples.cubic_hexapod(), {"frequency": known.answer["omega"] / (2 * np.pi)}, known.source)


def hexapod_matrices(edge=0.2, k=1e5, c=30.0, mass=20.0, inertia=0.15):
    """Six struts along the edges of a cube that do not meet one body diagonal, as matrices; the payload's centre is the cube's."""
    corners = edge * np.array([[1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 1]]) - edge / 2
    rows = []
    for a, b in itertools.pairwise([*corners, corners[0]]):
        along = (b - a) / np.linalg.norm(b - a)
        rows.append([*along, *np.cross((a + b) / 2, along)])
    g = np.array(rows)
    omega = np.sqrt([2 * k / mass] * 3 + [k * edge**2 / 2 / inertia] * 2 + [2 * k * edge**2 / inertia])
    model = mb.MechanicalSystem(np.diag([mass] * 3 + [inertia] * 3), c * g.T @ g, k * g.T @ g)
    return Problem(model, {"omega": omega, "damping": omega * c / k / 2}, "struts in three orthogonal pairs")


# --- closed loops -----


def parallelogram(height=0.0, gravity=True):
    """A parallelogram of four hinges, cranks of 1 m; with height 0 all lie on one line, the flat singular pose."""
    m = mb.Model("parallelogram", gravity=(0, -G, 0) if gravity else None)
    phi = np.arcsin(height)
    end = np.array([np.cos(phi), np.sin(phi), 0.0])
    base = np.array([2.0, 0, 0])
    a = rod(m, "a", tuple(end / 2), 1.0, angle=phi)
    b = rod(m, "b", tuple(end + base / 2), 2.0)
    c = rod(m, "c", tuple(base + end / 2), 1.0, angle=phi)
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("B", a, b, at=tuple(end), axis="z")
    m.revolute("C", b, c, at=tuple(end + base), axis="z")
    m.revolute("D", c, m.ground, at=tuple(base), axis="z")
    return Problem(m, {"dof": 1}, "planar linkage")


def bricard(edge=1.0, springs=True):
    """Bricard's orthogonal linkage: six equal bars along edges of a cube, hinges perpendicular to both of their bars.

    The closed path 000-100-110-111-011-001 turns at right angles at each corner; neighbouring hinges are perpendicular, with
    twists of alternately -90 and 90 degrees and no offsets, and a12^2 + a34^2 + a56^2 = a23^2 + a45^2 + a61^2: the condition
    of mobility of the trihedral case. Six hinges in a loop would in general be rigid.
    """
    corners = edge * np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1)], float)
    m = mb.Model("Bricard")
    bars = [m.ground]  # from corner 0 to corner 1
    for i in range(1, 6):
        middle = 0.5 * (corners[i] + corners[(i + 1) % 6])
        bars.append(m.body(f"bar{i}", mass=1.0 + 0.1 * i, inertia=(0.1, 0.12, 0.14), at=tuple(middle)))
    for i in range(6):
        before, after = corners[i] - corners[i - 1], corners[(i + 1) % 6] - corners[i]
        k = {"k": 1.0 + i} if springs else {}
        m.revolute(f"H{i}", bars[i - 1], bars[i], at=tuple(corners[i]), axis=tuple(np.cross(before, after)), **k)
    return Problem(m, {"dof": 1}, "R. Bricard, Lecons de cinematique II, 1927; the tests move it, which proves it")


def two_supports(unit=1.0, length=2.0, load=100.0, at=0.5):
    """A beam clamped at both ends, rigid: six redundant constraints. ``unit`` = 1000 draws it in millimetres (force: mN)."""
    m = mb.Model("two supports")
    L = length * unit
    b = m.body("beam", mass=1.0, inertia=(0.01 * unit**2, 0.3 * unit**2, 0.3 * unit**2), at=(L / 2, 0, 0))
    m.fixed("left", m.ground, b, at=(0, 0, 0))
    m.fixed("right", m.ground, b, at=(L, 0, 0))
    m.force("load", b, at=(at * L, 0, 0), value=(0, 0, -load * unit))
    return Problem(m, {"share": 0.5 if at == 0.5 else None}, "symmetry")


# --- long structures -----


def spring_row(k):
    """Stiffness (n, n) of masses in a row: spring i between masses i - 1 and i, the first to ground."""
    D = np.eye(len(k)) - np.eye(len(k), k=-1)
    return D.T @ (np.asarray(k, dtype=float)[:, None] * D)


LADDER_TURN = np.array([0.31, -0.52, 0.47, 0.64]) / np.linalg.norm([0.31, -0.52, 0.47, 0.64])
LADDERS = (
    {"m_r": 1.0, "m_s": 0.5, "k_h": 10.0, "length": 0.2},
    {"m_r": 0.37, "m_s": 2.3, "k_h": 4.1e3, "length": 13.7},
)


def ladder(n, *, m_r, m_s, k_h, length, order=False):
    """n layers whose rungs sway, turned in space: stiles of mass m_s and ``length`` turn by (x_i - x_(i-1))/length on four hinges with
    springs k_h in each layer, rungs of mass m_r (the last one half) shift by x_i.

    ``order``: the upper hinges of each layer are defined before the lower ones, which cuts other joints.
    """
    R, width = quaternion_matrix(LADDER_TURN), 0.7 * length
    m, below = mb.Model("ladder"), None

    def at(x, y):
        return tuple(R @ np.array([x, y, 0.0]))

    for i in range(1, n + 1):
        around = (m_s * length**2 / 12, 0.03 * m_s * length**2, m_s * length**2 / 12)
        stiles = [
            m.body(
                f"S{i},{u}",
                mass=m_s,
                inertia=around,
                at=at((u - 0.5) * width, (i - 0.5) * length),
                orientation=LADDER_TURN,
            )
            for u in (0, 1)
        ]
        mass = m_r if i < n else m_r / 2
        rung = m.body(
            f"R{i}", mass=mass, inertia=(0.02 * m_r * length**2,) * 3, at=at(0.0, i * length), orientation=LADDER_TURN
        )
        carrier = m.ground if below is None else below
        lower = [(f"a{i},{u}", carrier, stiles[u], at((u - 0.5) * width, (i - 1) * length)) for u in (0, 1)]
        upper = [(f"b{i},{u}", stiles[u], rung, at((u - 0.5) * width, i * length)) for u in (0, 1)]
        for name, a, b, point in upper + lower if order else lower + upper:
            m.revolute(name, a, b, at=point, axis=tuple(R[:, 2]), k=k_h)
        below = rung
    p = (2 * np.arange(1, n + 1) - 1) * np.pi / (2 * n)
    k = 4 * k_h / length**2
    omega = np.sqrt(4 * k * np.sin(p / 2) ** 2 / (m_r + (2 * m_s / 3) * (2 + np.cos(p))))
    return Problem(
        m, {"omega": omega}, "Bloch waves: omega^2 = 2 k (1 - cos p)/(m_r + (2 m_s/3)(2 + cos p)), k = 4 k_h/l^2"
    )


def hinged_beam(elements, h):
    """An Euler beam on hinges by cubic elements of length h with lumped mass: M and K (CSC) and the coordinate of its middle.

    Bending stiffness and mass per length are 1.
    """
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2], [-12, -6 * h, 12, -6 * h],
                  [6 * h, 2 * h**2, -6 * h, 4 * h**2]]) / h**3  # fmt: skip
    m = np.array([h / 2, h**3 / 24, h / 2, h**3 / 24])
    places = 2 * np.arange(elements)[:, None] + np.arange(4)
    rows, columns = np.repeat(places, 4, axis=1).ravel(), np.tile(places, (1, 4)).ravel()
    n = 2 * (elements + 1)
    K = sp.csc_matrix((np.tile(k.ravel(), elements), (rows, columns)), shape=(n, n))
    M = sp.csc_matrix((np.tile(m, elements), (places.ravel(), places.ravel())), shape=(n, n))
    free = np.setdiff1d(np.arange(n), [0, n - 2])
    K, M = K[free][:, free], M[free][:, free]
    middle = int(np.searchsorted(free, 2 * (elements // 2)))
    omega = (np.arange(1, elements) * np.pi / (elements * h)) ** 2
    return Problem((M, K), {"omega": omega}, "Euler: (j pi/L)^2, by elements to second order", {"middle": middle})
