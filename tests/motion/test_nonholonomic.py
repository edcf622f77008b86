"""Knife edge and rolling disc in motion, against closed forms derived here."""

from __future__ import annotations

import jitter
import mbrs as mb
import numpy as np
import pytest
from motion_models import G, disc


@pytest.mark.parametrize("lean, precession", [(1.2, 1.5), (0.7, 2.5), (2.0, -0.8)])
def test_steady_rolling_on_a_circle(lean, precession):
    """omega = s n + Omega sin(theta) q with n the axis, q up the disc, theta = angle(n, z). With F = m r s Omega t2 + m g z at the
    contact and H = C s n + A Omega sin(theta) q, dH/dt = c x F along the track gives

        (C + m r^2) s Omega sin(theta) - A Omega^2 sin(theta) cos(theta) + m g r cos(theta) = 0,

    and the centre goes around a circle of radius r s / Omega with the velocity r s n x q.
    """
    mass, r, A, C = 2.0, 0.3, 0.05, 0.09
    sin, cos = np.sin(lean), np.cos(lean)
    s = (A * precession**2 * sin * cos - mass * G * r * cos) / ((C + mass * r * r) * precession * sin)
    n = np.array([sin, 0, cos])
    q = (np.array([0, 0, 1.0]) - cos * n) / sin
    start = r * s * np.cross(n, q)
    m = disc(lean, start, s * n + precession * sin * q)
    t = np.linspace(0, 2 * np.pi / abs(precession), 9)
    traj = mb.simulate(m, t=t, rtol=1e-10)
    turn = precession * t
    velocity = np.stack(
        [np.cos(turn) * start[0] - np.sin(turn) * start[1], np.sin(turn) * start[0] + np.cos(turn) * start[1]], 1
    )
    normal = traj.rotation("disc")[:, :, 2] if hasattr(traj, "rotation") else None
    worst = {
        "velocity": np.abs(traj.velocity("disc")[:, :2] - velocity).max(),
        "height": np.abs(traj.position("disc")[:, 2] - r * sin).max(),
        "closing": np.abs(traj.position("disc")[-1] - traj.position("disc")[0]).max(),
        "lean": np.abs(normal[:, 2] - cos).max(),
        "rows": traj.residual.max(),
    }
    print(lean, worst)
    assert max(worst.values()) < 1e-7
    # normal force m g and the centripetal one at the contact, moved to the disc's centre
    force = traj.reaction("rolling")[0, :3]
    assert force == pytest.approx([mass * r * s * precession, 0, mass * G], abs=1e-8)


def test_a_wobbling_disc_keeps_its_energy_and_does_not_slip():
    m = disc(1.3, (0.0, 0.8, 0.0), (-2.5, 0.3, 0.4))
    with pytest.warns(mb.MbrsWarning, match="contradict"):
        traj = mb.simulate(m, t=np.linspace(0, 3, 61), rtol=1e-10)
    n = traj.rotation("disc")[:, :, 2]
    rho = np.sqrt(1 - n[:, 2] ** 2)
    contact = 0.3 * (n[:, 2:] * n - [0, 0, 1]) / rho[:, None]
    slip = traj.velocity("disc") + np.cross(traj.angular_velocity("disc"), contact)
    print("slip", np.abs(slip).max(), "energy", np.ptp(np.asarray(traj.energy)), "lean", np.ptp(n[:, 2]))
    assert np.abs(slip).max() < 1e-10 and np.ptp(np.asarray(traj.energy)) < 1e-8
    assert np.ptp(n[:, 2]) > 0.1
    assert np.abs(traj.position("disc")[:, 2] - 0.3 * rho).max() < 1e-10


def test_without_its_velocity_rows_a_disc_slides():
    """A disc that starts with slip keeps its velocity on ice; on the ground it cannot start so."""
    m = disc(np.pi / 2, (0, 1.0, 0))
    traj = mb.simulate(m, t=[1.0], without=("nonholonomic",))
    assert np.allclose(traj.position("disc")[0], [0, 1, 0.3], atol=1e-9)
    with pytest.warns(mb.MbrsWarning, match="contradict"):
        rolling = mb.simulate(m, t=[1.0])
    spin = rolling.angular_velocity("disc")[0]
    assert rolling.velocity("disc")[0] == pytest.approx(np.cross(spin, [0, 0, 0.3]), abs=1e-10)
    assert rolling.velocity("disc")[0, 1] > 0.1


def test_roots_of_a_disc_at_rest(case):
    """Three velocity freedoms: lean (unstable: s^2 = m g r / (A + m r^2)), heading and rolling, which are neutral."""
    m = disc()
    assert mb.System(m).dof == 3
    modes = mb.modes(m)
    assert len(modes.roots) == 6
    known = np.sqrt(2 * G * 0.3 / (0.05 + 2 * 0.09))
    case("disc on its rim at rest: roots of falling", topic="modes", ours=np.sort(np.real(modes.roots))[[0, -1]], known=[-known, known],
         within=1e-9, source="s^2 = m g r / (A + m r^2)", estimate=None, unit="1/s")  # fmt: skip
    # double roots at 0: the square root of the noise, times a rate of 7 1/s
    assert np.sort(np.abs(modes.roots))[:4] == pytest.approx(0, abs=1e-6 + 10 * np.sqrt(jitter.level()))


def test_chaplygin_sleigh(case):
    """Knife edge a behind the centre of mass: u' = a w^2, (I + m a^2) w' = -m a u w; from u = 0 on
    w = w0 / cosh(k t), u = (a w0^2 / k) tanh(k t), k^2 = m a^2 w0^2 / (I + m a^2).
    """
    mass, inertia, a, w0 = 1.5, 0.2, 0.4, 3.0
    m = mb.Model("sleigh")
    b = m.body(
        "sleigh",
        mass=mass,
        inertia=(0.1, 0.1, inertia),
        at=(a, 0, 0),
        velocity=(0, a * w0, 0),
        angular_velocity=(0, 0, w0),
    )
    m.planar("ice", m.ground, b, at=(0, 0, 0), axis="z")
    m.knife_edge("blade", m.ground, b, at=(0, 0, 0), axis="y")
    m.marker("P", b, at=(0, 0, 0))
    t = np.linspace(0, 3, 13)
    traj = mb.simulate(m, t=t, rtol=1e-11)
    k = w0 * a * np.sqrt(mass / (inertia + mass * a * a))
    w = traj.angular_velocity("sleigh")[:, 2]
    ahead = traj.rotation("sleigh")[:, :, 0]
    u = np.sum(traj.velocity("sleigh") * ahead, axis=1)
    worst = np.abs(w - w0 / np.cosh(k * t)).max(), np.abs(u - a * w0**2 / k * np.tanh(k * t)).max()
    heading = np.abs(traj.joint("ice")[:, 2] - 2 * w0 / k * np.arctan(np.tanh(k * t / 2))).max()
    print("sleigh", worst, heading)
    assert max(*worst, heading) < 1e-8
    case("Chaplygin's sleigh: angular velocity over 3 s", topic="motion", ours=w, known=w0 / np.cosh(k * t), within=1e-8,
         source="w0 / cosh(k t) (Neimark and Fufaev, 1972)", estimate=traj.error, unit="rad/s")  # fmt: skip
    # the blade's force N = m (u w + a w')
    force = traj.reaction("blade")[:, :3]
    side = np.sum(force * traj.rotation("sleigh")[:, :, 1], axis=1)
    known = mass * (u * w - a * k * w * np.tanh(k * t))
    assert np.abs(side - known).max() < 1e-7
