"""What meshes and shapes of beams leave modes open to, `ModalResult.discretisation`: closed forms, and frames by a NumPy script."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import pairwise

import jitter
import mbrs as mb
import numpy as np
import pytest
import scipy.linalg as sl
from mbrs.errors import ModelError
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

# beta L of Euler-Bernoulli beams
ROOTS = {
    "free": lambda x: np.cos(x) - 1 / np.cosh(x),
    "clamped": lambda x: np.cos(x) + 1 / np.cosh(x),
    "pinned": np.sin,
    "propped": lambda x: np.sin(x) / np.cos(x) - np.tanh(x),
}
FIRST = {"free": 1.5, "clamped": 0.5, "pinned": 1.0, "propped": 1.25}
STRETCHED = 1e6
KNOWN = 1e-11  # below, rounding of the frequencies counts beside the error of the mesh


def beta(ends: str, n: int) -> np.ndarray:
    """The first n roots, each in an interval of its own."""
    if ends == "propped":
        return np.array(
            [brentq(ROOTS[ends], (k + 0.05) * np.pi, (k + 0.45) * np.pi, xtol=1e-15) for k in range(1, n + 1)]
        )
    return np.array(
        [
            brentq(ROOTS[ends], (k + FIRST[ends] - 0.5) * np.pi, (k + FIRST[ends] + 0.5) * np.pi, xtol=1e-15)
            for k in range(n)
        ]
    )


def compared(found: mb.ModalResult, exact: np.ndarray, n: int, stretched: float = 0.0) -> None:
    """The n lowest elastic frequencies (rad/s): the estimate is within a factor of three of the error where that is above rounding;
    ``stretched``: the axial stiffness over that of bending, of beams that are held between two points, whose drawn distance pulls them.
    """
    elastic = np.flatnonzero(found.kind != "rigid")[:n]
    error = np.abs(found.omega[elastic] / exact[:n] - 1)
    estimate = found.discretisation[elastic]
    print(f"errors {error.min():.1e} to {error.max():.1e}, over the estimate {(error / estimate).round(3)}")
    known = KNOWN + jitter.level() * (found.condition[elastic] + stretched)
    seen = error > known
    assert np.all(error[seen] < 3 * estimate[seen]) and np.all(estimate < 3 * np.maximum(error, known))
    assert np.isnan(found.discretisation[found.kind == "rigid"]).all()


def turned(m: mb.Model, seed: int) -> dict:
    rng = np.random.default_rng(seed)
    return dict(at=rng.normal(size=3), orientation=mb.rotation(rng.normal(size=3), rng.uniform(0.3, 3)))


@pytest.mark.some(3)
@pytest.mark.parametrize("elements", [6, 25, 60])
@pytest.mark.parametrize("ends", list(ROOTS))
def test_single_beams(ends, elements):
    """Two planes of bending; clamped and pinned ends by joints, which need the shapes of ``attach``."""
    rng = np.random.default_rng([elements, len(ends)])
    length, mass, *stiffness = np.exp(rng.uniform(-2, 2, 4))
    thin = 1e-14 * mass * length**2
    given = dict(mass=mass, EI_flap=stiffness[0], EI_edge=stiffness[1], inertia_flap=thin, inertia_edge=thin)
    if ends in ("pinned", "propped"):
        given["EA"] = STRETCHED * max(stiffness) / length**2  # what does not stretch cannot bend between two points
    kinds = {
        "free": dict(fixed=None),
        "clamped": {},
        "pinned": dict(fixed=None, attach=["root", "tip"]),
        "propped": dict(attach=["tip"]),
    }
    beam = mb.flexible.beam(length, elements=elements, modes=10, **given, **kinds[ends])
    m = mb.Model("beam")
    b = m.flexible_body("b", beam, **turned(m, elements))
    if ends in ("clamped", "propped"):
        m.fixed("root", m.ground, b.node("root"))
    if ends == "pinned":
        across = np.cross(b.node("tip").at - b.node("root").at, [0.3, 0.5, -0.7])
        m.universal(
            "root", m.ground, b.node("root"), axis=across, axis2=np.cross(across, b.node("tip").at - b.node("root").at)
        )
    if ends in ("pinned", "propped"):
        m.spherical("tip", m.ground, b.node("tip"))
    exact = np.sort(np.concatenate([np.sqrt(k / mass) * (beta(ends, 4) / length) ** 2 for k in stiffness]))
    compared(mb.modes(m), exact, 4, STRETCHED if "EA" in given else 0.0)


@pytest.mark.parametrize("seed", range(2))
def test_shapes_that_are_left_out_are_in_the_estimate(seed):
    """A tip that is held though it has no shapes of its own: few shapes err more than the mesh, up to a tenth."""
    rng = np.random.default_rng(seed)
    length, mass, *stiffness = np.exp(rng.uniform(-2, 2, 4))
    m = mb.Model("propped")
    b = m.flexible_body(
        "b",
        mb.flexible.beam(
            length, mass=mass, EI_flap=stiffness[0], EI_edge=stiffness[1], EA=1e4 * max(stiffness) / length**2, modes=16
        ),
        **turned(m, seed),
    )
    m.fixed("root", m.ground, b.node("root"))
    m.spherical("tip", m.ground, b.node("tip"))
    found = mb.modes(m)
    exact = np.sort(np.concatenate([np.sqrt(k / mass) * (beta("propped", 4) / length) ** 2 for k in stiffness]))
    compared(found, exact, 3)
    assert found.discretisation[:3].max() > 1e-5 > 1e5 * found.error[:3].max()


@pytest.mark.parametrize("pieces", [2, 3])
def test_welded_beams(pieces):
    """A beam in pieces of different meshes is the whole one."""
    rng = np.random.default_rng(pieces)
    length, mass, *stiffness = np.exp(rng.uniform(-2, 2, 4))
    m = mb.Model("pieces")
    at, R = rng.normal(size=3), Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
    thin = 1e-10 * mass * length**2
    last = None
    for i in range(pieces):
        part = mb.flexible.beam(
            length / pieces,
            mass=mass,
            EI_flap=stiffness[0],
            EI_edge=stiffness[1],
            inertia_flap=thin,
            inertia_edge=thin,
            GJ=max(stiffness),
            elements=3 + 2 * i,
            modes=9,
            attach=["tip"] if i else ["root", "tip"],
            fixed="root" if i else None,
        )
        b = m.flexible_body(f"b{i}", part, at=at + i * length / pieces * R[:, 0], orientation=R)
        if last is not None:
            m.fixed(f"weld{i}", last.node("tip"), b.node("root"))
        last = b
    exact = np.sort(np.concatenate([np.sqrt(k / mass) * (beta("free", 4) / length) ** 2 for k in stiffness]))
    compared(mb.modes(m), exact, 4)


# --- frames -----


def frame_element(length: float, given: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """M and K (12, 12) of a Bernoulli element along x, u v w rx ry rz at both ends, by Gauss points on cubic and linear shapes."""
    M, K = np.zeros((12, 12)), np.zeros((12, 12))
    for xi, weight in zip(*np.polynomial.legendre.leggauss(5), strict=True):
        s, w = (xi + 1) / 2, weight * length / 2
        cubic = np.array(
            [1 - 3 * s**2 + 2 * s**3, length * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, length * (s**3 - s**2)]
        )
        slope = (
            np.array(
                [-6 * s + 6 * s**2, length * (1 - 4 * s + 3 * s**2), 6 * s - 6 * s**2, length * (3 * s**2 - 2 * s)]
            )
            / length
        )
        bend = np.array([-6 + 12 * s, length * (-4 + 6 * s), 6 - 12 * s, length * (6 * s - 2)]) / length**2
        line, stretch = np.array([1 - s, s]), np.array([-1, 1]) / length
        v, ends = [1, 5, 7, 11], [0, 6]
        z, twist = [2, 4, 8, 10], [3, 9]
        sign = np.array([1, -1, 1, -1])  # ry = -w'
        for places, signs, EI, inertia in (
            (v, np.ones(4), given["EI_edge"], given["inertia_edge"]),
            (z, sign, given["EI_flap"], given["inertia_flap"]),
        ):
            M[np.ix_(places, places)] += w * (
                given["mass"] * np.outer(cubic * signs, cubic * signs)
                + inertia * np.outer(slope * signs, slope * signs)
            )
            K[np.ix_(places, places)] += w * EI * np.outer(bend * signs, bend * signs)
        polar = given["inertia_edge"] + given["inertia_flap"]
        for places, density, stiffness in ((ends, given["mass"], given["EA"]), (twist, polar, given["GJ"])):
            M[np.ix_(places, places)] += w * density * np.outer(line, line)
            K[np.ix_(places, places)] += w * stiffness * np.outer(stretch, stretch)
    return M, K


def frame(
    beams: list[tuple[int, int]], points: np.ndarray, given: list[dict], turns: list[np.ndarray], parts: int
) -> np.ndarray:
    """Circular frequencies of beams that are clamped to each other at points, of which the first is held, each of so many elements."""
    n = len(points) + len(beams) * (parts - 1)
    M, K = np.zeros((6 * n, 6 * n)), np.zeros((6 * n, 6 * n))
    fresh = len(points)
    for (a, b), one, R in zip(beams, given, turns, strict=True):
        nodes = [a, *range(fresh, fresh + parts - 1), b]
        fresh += parts - 1
        m, k = frame_element(np.linalg.norm(points[b] - points[a]) / parts, one)
        T = np.kron(np.eye(4), R.T)
        for i, j in pairwise(nodes):
            at = [*range(6 * i, 6 * i + 6), *range(6 * j, 6 * j + 6)]
            M[np.ix_(at, at)] += T.T @ m @ T
            K[np.ix_(at, at)] += T.T @ k @ T
    return np.sqrt(sl.eigh(K[6:, 6:], M[6:, 6:], eigvals_only=True))


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", range(4))
def test_random_frames(seed):
    """Trees of beams in all directions that bend, twist and stretch, of few elements; against the same of many."""
    rng = np.random.default_rng(seed)
    points, beams = [np.zeros(3)], []
    for i in range(3):
        a = int(rng.integers(len(points)))
        points.append(points[a] + rng.normal(size=3))
        beams.append((a, i + 1))
    points = np.array(points)
    m = mb.Model("frame")
    held = m.ground
    given, turns, handles = [], [], {}
    for i, (a, b) in enumerate(beams):
        along = points[b] - points[a]
        size, x = np.linalg.norm(along), along / np.linalg.norm(along)
        y = np.cross(x, rng.normal(size=3))
        R = np.stack([x, y / np.linalg.norm(y), np.cross(x, y / np.linalg.norm(y))], axis=1)
        mass, radius = rng.uniform(0.5, 2), rng.uniform(0.005, 0.02, 2)
        E = 1e4 * mass
        one = dict(mass=mass, EI_flap=E * radius[0] ** 2, EI_edge=E * radius[1] ** 2, EA=E, GJ=0.4 * E * (radius @ radius),
                   inertia_flap=mass * radius[0] ** 2, inertia_edge=mass * radius[1] ** 2)  # fmt: skip
        beam = mb.flexible.beam(size, elements=int(rng.integers(4, 9)), modes=10, attach=["tip"], **one)
        handles[b] = m.flexible_body(f"b{i}", beam, at=points[a], orientation=R)
        m.fixed(f"weld{i}", handles[a].node("tip") if a else held, handles[b].node("root"))
        given.append(one)
        turns.append(R)
    coarse, exact = frame(beams, points, given, turns, 24), frame(beams, points, given, turns, 48)
    assert np.abs(coarse[:6] / exact[:6] - 1).max() < 1e-4
    compared(mb.modes(m), exact, 6)


def test_parameters_equilibria_and_large_models():
    """The finer model follows parameters that were set since, sags as far as the given one, and has the lowest modes of a large one."""
    rng = np.random.default_rng(5)
    m = mb.Model("boom", gravity=(0.4, -0.7, -9.1))
    E = m.parameter("E", 7.3e10)
    beam = mb.flexible.beam(1.7, mass=2.9, EI_flap=2e-8 * E, EI_edge=5e-8 * E, elements=5, modes=4, attach=["tip"])
    b = m.flexible_body("b", beam, **turned(m, 3))
    m.fixed("root", m.ground, b.node("root"))
    E_now = 3.1e10
    m.set({"E": E_now})
    exact = np.sort(np.concatenate([np.sqrt(k * E_now / 2.9) * (beta("clamped", 3) / 1.7) ** 2 for k in (2e-8, 5e-8)]))
    compared(mb.modes(m, without=["gravity"]), exact, 4)
    sagging = mb.modes(m, at=mb.equilibrium(m))
    drawn = mb.modes(m, without=["gravity"])
    assert np.allclose(sagging.discretisation[:2], drawn.discretisation[:2], rtol=0.2)
    few = mb.modes(m, without=["gravity"], n=2, shift=float(drawn.frequency[2]))
    those = np.searchsorted(drawn.frequency, few.frequency - 1e-9)
    assert np.allclose(few.discretisation, drawn.discretisation[those])
    rigid = mb.Model("rigid")
    body = rigid.body("a", mass=1.0, inertia=(0.1, 0.2, 0.3), at=rng.normal(size=3))
    rigid.bushing("k", rigid.ground, body, at=(0.1, 0.2, 0.3), k=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    assert np.array_equal(mb.modes(rigid).discretisation, np.zeros(6))


def test_it_is_found_beside_the_error():
    """The table says where it is, shows it once it was asked for, and copies and files do not ask for it."""
    m = mb.Model("beam")
    m.fixed(
        "root",
        m.ground,
        m.flexible_body("b", mb.flexible.beam(1.3, mass=1.1, EI_flap=2.0, EI_edge=3.0, elements=4)).node("root"),
    )
    found = mb.modes(m)
    assert ".discretisation" in str(found) and "meshes" not in str(found).split("\n")[1]
    copy = pickle.loads(pickle.dumps(found.replaced(status="other")))
    assert copy.discretisation is None
    largest = found.discretisation.max()
    assert 1e-6 < largest < 0.1 and "meshes" in str(found)
    assert np.array_equal(pickle.loads(pickle.dumps(found)).discretisation, found.discretisation)
    rigid = mb.Model("rigid")
    rigid.prismatic(
        "rail",
        rigid.ground,
        rigid.body("a", mass=1.0, inertia=(0.1, 0.2, 0.3)),
        at=(0, 0, 0),
        axis=(0.3, 0.2, 0.1),
        k=3.0,
    )
    assert "discretisation" not in str(mb.modes(rigid))


def test_what_has_no_estimate_is_refused():
    system = mb.MechanicalSystem(np.eye(2), K=np.diag([1.0, 2.0]))
    with pytest.raises(ModelError, match="plain matrices"):
        _ = mb.modes(system).discretisation
    beam = mb.flexible.beam(1.3, mass=1.1, EI_flap=2.0, EI_edge=3.0, elements=4)

    def model(body, **kwargs):
        m = mb.Model("m", **kwargs)
        m.fixed("root", m.ground, m.flexible_body("b", body).node("root"))
        return m

    with pytest.raises(ModelError, match="mesh of this modal body is not known"):
        _ = mb.modes(model(replace(beam, recipe=None))).discretisation
    varied = model(beam)
    varied.set({"b.K[0,0]": 1.1 * beam.K[0, 0]})
    with pytest.raises(ModelError, match="stiffness that was changed"):
        _ = mb.modes(varied).discretisation
