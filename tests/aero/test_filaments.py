"""Biot and Savart: the core against plain NumPy, vortex rings, helices, and what must not change."""

from __future__ import annotations

import doctest

import mbrs as mb
import mbrs.aero.filaments
import numpy as np
import pytest
from mbrs.aero.filaments import CORES
from mbrs.errors import ModelError
from scipy.integrate import quad
from scipy.spatial.transform import Rotation
from scipy.special import ive, ivp, kve, kvp

RNG = np.random.default_rng(6)
DIRECTION = np.array([0.31, -0.83, 0.46]) / np.linalg.norm([0.31, -0.83, 0.46])


def reference(points, start, end, circulation, radius, core, exponent=2.0):
    """The law as it is printed: Gamma / (4 pi h) (cos b1 - cos b2) K(h) beside each filament, or the exact smoothed integral."""
    total = np.zeros_like(points)
    for a, b, gamma, rc in zip(start, end, circulation, radius, strict=True):
        length = np.linalg.norm(b - a)
        along = (b - a) / length
        s = (points - a) @ along
        side = np.cross(along, points - a)
        h = np.linalg.norm(side, axis=1)
        d2 = h**2 + (rc**2 if core == "rosenhead-moore" else 0.0)
        spread = s / np.sqrt(s**2 + d2) + (length - s) / np.sqrt((length - s) ** 2 + d2)
        k = {
            "rosenhead-moore": 1.0,
            "lamb-oseen": 1 - np.exp(-1.2564312086261697 * h**2 / rc**2),
            "vatistas": h**2 / (h ** (2 * exponent) + rc ** (2 * exponent)) ** (1 / exponent),
        }[core]
        total += (gamma / (4 * np.pi) * spread * k / d2)[:, None] * side
    return total


def filaments(m):
    start = RNG.normal(size=(m, 3))
    return start, start + RNG.normal(size=(m, 3)), RNG.normal(size=m), RNG.uniform(0.02, 0.3, m)


@pytest.mark.parametrize("core, exponent", [(c, 2.0) for c in CORES] + [("vatistas", 1.0), ("vatistas", 5.3)])
def test_the_core_is_the_law(core, exponent):
    start, end, circulation, radius = filaments(57)
    points = RNG.normal(size=(101, 3)) * 2
    found = mb.aero.induced_velocity(points, start, end, circulation, core_radius=radius, core=core, exponent=exponent)
    truth = reference(points, start, end, circulation, radius, core, exponent)
    assert np.abs(found - truth).max() < 1e-11 * np.abs(truth).max()


@pytest.mark.exact
@pytest.mark.parametrize("core", CORES)
def test_bits_are_equal_for_any_number_of_threads(core):
    start, end, circulation, radius = filaments(211)
    points = RNG.normal(size=(7, 19, 3))
    one = mb.aero.induced_velocity(points, start, end, circulation, core_radius=radius, core=core, threads=1)
    for threads in (0, 2, 3, 7, 40):
        same = mb.aero.induced_velocity(points, start, end, circulation, core_radius=radius, core=core, threads=threads)
        assert np.array_equal(one, same)
    alone = mb.aero.induced_velocity(points[3, 5], start, end, circulation, core_radius=radius, core=core)
    assert np.array_equal(one[3, 5], alone)


def ring(n, radius=1.0):
    """Corners of a polygon whose circle has the given radius, with an axis that is not one of the world."""
    e = np.linalg.svd(DIRECTION[None])[2][1:]
    e[1] = np.cross(DIRECTION, e[0])
    t = np.arange(n) * 2 * np.pi / n
    return radius * (np.cos(t)[:, None] * e[0] + np.sin(t)[:, None] * e[1])


def ring_speed(n, a):
    """Of the middle of a segment's neighbour corners: a corner's own two segments meet there."""
    p = ring(n)
    return mb.aero.induced_velocity(p[0], p, np.roll(p, -1, axis=0), 1.0, core_radius=a) @ DIRECTION


def test_the_ring_moves_with_the_constant_of_its_core(case):
    a = 0.02
    # the smoothed law on the circle itself, and its asymptotic form
    exact = quad(
        lambda t: 2 * np.sin(t / 2) ** 2 / (4 * np.sin(t / 2) ** 2 + a**2) ** 1.5 / (2 * np.pi),
        0,
        np.pi,
        points=[0.02, 0.1],
        epsabs=1e-13,
    )[0]
    assert exact == pytest.approx(0.397180, abs=5e-7)
    assert exact == pytest.approx((np.log(8 / a) - 1) / (4 * np.pi), rel=3e-4)
    speeds = [ring_speed(n, a) for n in (800, 1600, 3200)]
    errors = np.abs(np.array(speeds) - exact)
    assert np.all(np.abs(errors[:-1] / errors[1:] - 4) < 0.05) and errors[2] < 2e-4
    # extrapolated, the polygon is the circle
    assert (4 * speeds[2] - speeds[1]) / 3 == pytest.approx(exact, abs=2e-9)
    case("vortex ring with the core of Rosenhead and Moore, .02 R, 3200 filaments: speed over Gamma / R", topic="aero",
         kind="independent script",
         ours=speeds[2], known=exact, within=4e-4, uncertainty=1e-12, estimate=abs(speeds[2] - speeds[1]) / exact,
         source="quadrature of the smoothed law on the circle (P. G. Saffman, Vortex Dynamics, 10.2-10.3): .397180")  # fmt: skip


def test_a_ring_is_a_dipole_far_away():
    p = ring(4000)
    far = RNG.normal(size=(5, 3))
    far *= 300.0 / np.linalg.norm(far, axis=1)[:, None]
    found = mb.aero.induced_velocity(far, p, np.roll(p, -1, axis=0), 1.7, core_radius=0.01)
    m = 1.7 * np.pi * DIRECTION
    r = np.linalg.norm(far, axis=1)[:, None]
    truth = (3 * (far @ m)[:, None] * far / r**2 - m) / (4 * np.pi * r**3)
    assert np.abs(found - truth).max() < 1e-4 * np.abs(truth).max()


def hardin(r, turn, radius, pitch, terms=60):
    """Axial and radial, tangential velocity of an infinite helix (circulation 1) at r < radius, turned by ``turn`` from it.

    J. C. Hardin, Phys. Fluids 25 (1982) 1949, written with l = pitch / 2 pi and scaled Bessel functions.
    """
    ell = pitch / (2 * np.pi)
    m = np.arange(1, terms + 1)
    inner, outer = m * r / ell, m * radius / ell
    scale = np.exp(inner - outer)
    i, di = ive(m, inner) * scale, ivp(m, inner) * np.exp(-outer)
    dk = kvp(m, outer) * np.exp(outer)
    assert np.all(np.isfinite(dk)) and np.all(kve(m, outer) > 0)
    axial = 1 / pitch - 2 * radius / (pitch * ell) * np.sum(m * dk * i * np.cos(m * turn))
    tangential = 2 * radius / (pitch * r) * np.sum(m * dk * i * np.cos(m * turn))
    radial = 2 * radius / (pitch * ell) * np.sum(m * dk * di * np.sin(m * turn))
    return axial, tangential, radial


@pytest.mark.parametrize("pitch", [0.7, 2.3])
def test_the_infinite_helix_is_hardins(case, pitch):
    turns = 800
    found = {}
    for n in (120, 240):
        t = np.linspace(-turns * np.pi, turns * np.pi, turns * n + 1)
        p = np.c_[np.cos(t), np.sin(t), pitch * t / (2 * np.pi)]
        points = np.array([[0.0, 0.0, 0.1], [0.5, 0.2, 0.03], [-0.1, 0.6, -0.2]])
        found[n] = mb.aero.induced_velocity(points, p[:-1], p[1:], 1.0)
    v = (4 * found[240] - found[120]) / 3
    # the two ends that are missing: half infinite helices seen from afar; across the axis they give as much or less
    missing = 1.0 / pitch * (1 - 1 / np.sqrt(1 + (2 / (turns * pitch)) ** 2))
    assert v[0, 2] == pytest.approx(1 / pitch, abs=1.1 * missing + 1e-8)
    ours, known = [], []
    for q, u in zip(points[1:], v[1:], strict=True):
        r, angle = np.hypot(*q[:2]), np.arctan2(q[1], q[0])
        axial, tangential, radial = hardin(r, angle - 2 * np.pi * q[2] / pitch, 1.0, pitch)
        c, s = np.cos(angle), np.sin(angle)
        ours += [u[2], -s * u[0] + c * u[1], c * u[0] + s * u[1]]
        known += [axial, tangential, radial]
    case(f"helix of 800 turns, pitch {pitch:g} R: velocities at two points inside, over Gamma / R", topic="aero", ours=ours, known=known,
         within=missing + 2e-6, uncertainty=1e-12, scale=1.0, estimate=missing,
         source="infinite helix: J. C. Hardin, Phys. Fluids 25 (1982) 1949; V. L. Okulov, J. Fluid Mech. 521 (2004) 319")  # fmt: skip


@pytest.mark.parametrize("core", CORES)
def test_turning_moving_and_scaling_change_nothing(core):
    start, end, circulation, radius = filaments(31)
    points = RNG.normal(size=(17, 3))
    v = mb.aero.induced_velocity(points, start, end, circulation, core_radius=radius, core=core)
    turn, move, k = Rotation.from_rotvec(0.7 * DIRECTION).as_matrix(), RNG.normal(size=3) * 100, 3.7e-3
    w = mb.aero.induced_velocity(
        k * points @ turn.T + move,
        k * start @ turn.T + move,
        k * end @ turn.T + move,
        circulation,
        core_radius=k * radius,
        core=core,
    )
    assert np.abs(w * k - v @ turn.T).max() < 1e-9 * np.abs(v).max()


def test_on_the_line_and_at_its_ends_a_filament_gives_nothing():
    start, end, circulation, radius = filaments(9)
    share = RNG.uniform(-0.5, 1.5, 9)[:, None]
    for core in CORES:
        for i in range(9):
            for p in (start[i], end[i]):
                v = mb.aero.induced_velocity(p, start[i : i + 1], end[i : i + 1], 1.0, core=core)
                assert np.all(v == 0.0)
        on = start + share * (end - start)
        one = mb.aero.induced_velocity(on[0], start[:1], end[:1], 1.0, core_radius=radius[:1], core=core)
        assert np.abs(one).max() < 1e-12
    nothing = mb.aero.induced_velocity(on, start, start, circulation)
    assert not nothing.any() and not mb.aero.induced_velocity(on, start[:0], end[:0], 1.0).any()
    assert mb.aero.induced_velocity(on[:0], start, end, 1.0).shape == (0, 3)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"points": [[1.0, 2.0]]}, "three coordinates"),
        ({"end": np.zeros((2, 3))}, r"both be \(m, 3\)"),
        ({"circulation": [1.0, 2.0]}, "each of 4 filaments"),
        ({"circulation": np.nan}, "NaN"),
        ({"core_radius": -0.1}, "not be negative"),
        ({"core": "scully"}, "core of filaments"),
        ({"core": "vatistas", "exponent": 0.5}, "at least 1"),
        ({"threads": -1}, "threads"),
    ],
)
def test_input_that_cannot_be(change, message):
    start, end, circulation, radius = filaments(4)
    good = dict(points=[0.0, 0.0, 0.0], start=start, end=end, circulation=circulation, core_radius=radius)
    mb.aero.induced_velocity(**good)
    with pytest.raises(ModelError, match=message):
        mb.aero.induced_velocity(**(good | change))


def test_examples_of_docstrings():
    found = doctest.testmod(mbrs.aero.filaments)
    assert found.attempted > 0 and found.failed == 0
