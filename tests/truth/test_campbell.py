"""Critical speeds, whirl and what unbalance excites, against closed forms and an independent rotor of finite elements."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from scipy.linalg import eig, eigh
from test_steady_rotation import (
    AREA,
    LENGTH,
    RHO,
    SECOND,
    YOUNG,
    Setting,
    cases,
    hub_and_disc,
    shaft,
    supported_disc,
    unequal_shaft,
    whirl,
)


@pytest.mark.some(1)
@cases
def test_the_forward_critical_speed_of_a_shaft(seed, units, backwards):
    """(rho A - rho I l^2) W^2 = E I l^4 forward, (rho A + 3 rho I l^2) W^2 = E I l^4 backward, l = pi/L."""
    s = Setting(seed, units, backwards)
    found = mb.campbell(shaft(s), "spin.rx", speed=np.linspace(0.0, 4000.0, 5), n=6)
    q = np.pi / LENGTH
    forward = np.sqrt(YOUNG * SECOND * q**4 / (RHO * AREA - RHO * SECOND * q**2))
    backward = np.sqrt(YOUNG * SECOND * q**4 / (RHO * AREA + 3 * RHO * SECOND * q**2))
    assert forward == pytest.approx(2592.729, abs=5e-4)
    assert [c.whirl for c in found.critical] == [-1, 1]
    assert [c.speed for c in found.critical] == pytest.approx([backward, forward], rel=1e-5)
    first, second = found.critical
    assert not first.excited and second.excited and first.unbalance < 1e-9 < 1 - 1e-6 < second.unbalance
    assert second.rpm == pytest.approx(forward * 30 / np.pi, rel=1e-5)
    assert second.frequency == pytest.approx(forward / (2 * np.pi), rel=1e-5)
    text = str(found)
    assert "forward" in text and "r/min" in text and "unbalance excites" in text


@cases
def test_a_disc_on_unequal_supports_has_both_critical_speeds_excited(seed, units, backwards):
    """(k1 - (I - 0) W^2)(k2 - I W^2) = J^2 W^4: I^2 - J^2 < 0 leaves one critical speed for J > I, two for J < I."""
    s = Setting(seed, units, backwards)
    across, J, k1, k2 = 0.05, 0.03, 1e4, 2e4
    m = supported_disc(s, inertia=(J, across, across))
    found = mb.campbell(m, "spin", speed=np.linspace(0.0, 1500.0, 4))
    W2 = np.roots([across**2 - J * J, -across * (k1 + k2), k1 * k2])
    assert [c.speed for c in found.critical] == pytest.approx(np.sqrt(np.sort(W2)), rel=1e-6)
    assert all(c.excited and c.unbalance < 1 for c in found.critical)


def rayleigh(n: int, disc: tuple[float, float, float], k: float, length: float, radius: float):
    """M, G/W and K of a fine shaft with a rigid disc at mid-span in springs at both ends, from Hermite elements in NumPy; complex
    displacement y + i z: M q" - i W G q' + K q = 0.
    """
    A, second, h = np.pi * radius**2, np.pi * radius**4 / 4, length / n
    mass = RHO * A * h / 420 * np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h],
                                         [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]])  # fmt: skip
    slope = np.array([[36, 3 * h, -36, 3 * h], [3 * h, 4 * h * h, -3 * h, -h * h], [-36, -3 * h, 36, -3 * h],
                      [3 * h, -h * h, -3 * h, 4 * h * h]]) / (30 * h)  # fmt: skip
    bend = YOUNG * second / h**3 * np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
                                        [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]])  # fmt: skip
    M, G, K = (np.zeros((2 * n + 2,) * 2) for _ in range(3))
    for e in range(n):
        p = np.ix_(range(2 * e, 2 * e + 4), range(2 * e, 2 * e + 4))
        M[p] += mass + RHO * second * slope
        G[p] += 2 * RHO * second * slope
        K[p] += bend
    m, polar, across = disc
    M[n, n] += m
    M[n + 1, n + 1] += across
    G[n + 1, n + 1] += polar
    K[0, 0] += k
    K[2 * n, 2 * n] += k
    return M, G, K


def test_an_elastic_shaft_with_a_disc_in_springs():
    """Whirl and critical speeds of a shaft in elastic bearings with a disc in between: 0.3 % at most was left without the shaft's own
    gyroscopic terms; here both sides have them.
    """
    s = Setting(41)
    length, radius, k, disc = 1.0, 0.015, 5e6, (20.0, 0.3, 0.16)
    A, second = np.pi * radius**2, np.pi * radius**4 / 4
    half = 0.5 * length
    body = mb.flexible.beam(length, mass=RHO * A, EI_flap=YOUNG * second, EI_edge=YOUNG * second, inertia_flap=RHO * second,
                            inertia_edge=RHO * second, modes=16, fixed=None, nodes={"mid": half},
                            attach=["root", "mid", "tip"])  # fmt: skip
    m = mb.Model("shaft and disc")
    rotor = m.flexible_body("shaft", body, at=s.place(0, 0, 0), orientation=s.R)
    m.free("spin", m.ground, rotor.node("root"), at=s.place(0, 0, 0), orientation=s.R)
    wheel = s.body(m, "disc", disc[0], (disc[1], disc[2], disc[2]), (half, 0, 0))
    m.fixed("fit", rotor.node("mid"), wheel, at=s.place(half, 0, 0))
    for node, x in (("root", 0.0), ("tip", length)):
        s.bushing(m, f"bearing {node}", m.ground, rotor.node(node), (k if x == 0 else 0.0, k, k, 0, 0, 0), (x, 0, 0))
    M, G, K = rayleigh(40, disc, k, length, radius)

    def exact(W: float) -> np.ndarray:
        n = len(M)
        A1 = np.block([[np.zeros((n, n)), np.eye(n)], [K, W * G]])
        w = eig(A1, np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), M]]), right=False)
        return np.asarray(np.sort(np.abs(w.real))[:4] / (2 * np.pi))

    for W in (0.0, 400.0):
        found = mb.modes(m, at=mb.steady_motion(m, {"spin.rx": W}))
        f = np.sort(found.frequency_damped[found.kind != "rigid"])
        known = exact(W)
        print(W, f[:5], known)
        for one in known:
            assert np.min(np.abs(f - one)) < 2e-4 * one
    critical = mb.campbell(m, "spin.rx", speed=np.linspace(0.0, 600.0, 4)).critical
    forward = eigh(K, M - G, eigvals_only=True) if np.all(np.linalg.eigvalsh(M - G) > 0) else eig(K, M - G, right=False)
    backward = eigh(K, M + G, eigvals_only=True)
    for c in critical:
        if c.whirl:
            pool = np.sqrt(np.abs((forward if c.whirl > 0 else backward).real))
            assert np.min(np.abs(pool - c.speed)) < 2e-4 * c.speed, c
    assert {c.whirl for c in critical} >= {1, -1}
    assert all(c.excited == (c.whirl > 0) for c in critical if c.whirl)


def test_in_turning_axes_unbalance_acts_at_order_zero():
    """The flat shaft's critical speeds are its two frequencies at rest, between which it is unstable."""
    s = Setting(42)
    found = mb.campbell(unequal_shaft(s), "spin", speed=np.linspace(1.0, 300.0, 5))
    assert found.frame == "rotating"
    at = [c.speed for c in found.critical if c.order == 0.0 and c.excited]
    assert at == pytest.approx([100.0, 200.0], rel=1e-9)


def test_two_shafts_by_a_dict_of_speeds():
    s = Setting(43)
    m = supported_disc(s)
    other = s.body(m, "second disc", 2.0, (0.02, 0.03, 0.03), (0.5, 0, 0))
    ring = s.body(m, "second ring", 0.1, (1e-6,) * 3, (0.5, 0, 0))
    s.bushing(m, "second support", m.ground, ring, (1e7, 1e7, 1e7, 1e5, 5e3, 5e3), (0.5, 0, 0))
    m.revolute("second spin", ring, other, at=s.place(0.5, 0, 0), axis=s.axis)
    speed = np.linspace(0.0, 300.0, 4)
    both = mb.campbell(m, speed={"spin": speed, "second spin": -2.0 * speed})
    assert both.joint == "spin"
    alone = mb.modes(m, at=mb.steady_motion(m, {"spin": 300.0, "second spin": -600.0}))
    known = np.sort(alone.frequency_damped[alone.kind != "rigid"])
    assert np.sort(both.frequency[-1]) == pytest.approx(known, rel=1e-9)
    with pytest.raises(mb.ModelError, match="second spin"):
        mb.campbell(m, speed={"spin": speed, "second spin": speed[:2]})


def test_modes_that_are_rigid_at_rest_only():
    """A free disc has no frequency at rest and precesses at J/I W when it turns: a column more, not an IndexError."""
    m = mb.Model("free disc")
    m.body("disc", mass=1.0, inertia=(0.1, 0.05, 0.05), at=(0, 0, 0))
    found = mb.campbell(m, "disc.rx", speed=[0.0, 50.0, 100.0])
    assert found.frequency == pytest.approx(np.array([[0.0], [50.0], [100.0]]) * 2 / (2 * np.pi), abs=1e-9)
    assert found.whirl[-1, 0] == 1 and len(found.critical) == 0


def test_the_picture_shows_the_range_that_matters():
    s = Setting(44)
    m = hub_and_disc(s)
    m.set({"hub.mass": 1e-5, "hub.inertia": np.full(3, 1e-7)})
    found = mb.campbell(m, "spin", speed=np.linspace(0.0, 800.0, 9))
    axes = found.plot().axes[0]
    assert axes.get_ylim()[1] < 2000.0 < 1.05 * np.max(found.frequency)
    assert axes.get_xlabel() == "speed [rad/s]" and axes.get_ylabel() == "frequency [Hz]"
    drawn = [line for line in axes.get_lines() if line.get_label() in ("forward", "backward")]
    assert drawn and all(np.all(np.isfinite(line.get_ydata())) for line in drawn)
    marks = [line for line in axes.get_lines() if str(line.get_label()).startswith("critical")]
    inside = [c for c in found.critical if c.frequency < axes.get_ylim()[1]]
    assert sum(len(line.get_xdata()) for line in marks) == len(inside) > 0
    assert whirl(1, 0.0).shape == (2,)
