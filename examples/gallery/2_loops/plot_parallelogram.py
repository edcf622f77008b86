"""
A parallelogram is a pendulum
=============================

Two equal cranks carry a coupler that only translates. Claim: hanging, it swings with w^2 = (m + m_c) g r / (2 I + m
r^2/2 + m_c r^2), whatever the pose in which it was drawn.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

g, r, d, mass, inertia = 9.81, 0.8, 1.1, 1.2, 0.05


def drawn(turn, coupler):
    m = mb.Model("parallelogram", gravity=(0, 0, -g))
    up = r * np.array([np.sin(turn), 0, np.cos(turn)])
    along = np.array([d, 0, 0])
    a = m.body("left", mass=mass, inertia=(0.06, inertia, 0.06), at=up / 2)
    b = m.body("right", mass=mass, inertia=(0.06, inertia, 0.06), at=up / 2 + along)
    c = m.body("coupler", mass=coupler, inertia=(0.1, 0.1, 0.1), at=up + along / 2)
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="y")
    m.revolute("B", a, c, at=up, axis="y")
    m.revolute("C", c, b, at=up + along, axis="y")
    m.revolute("D", b, m.ground, at=along, axis="y")
    return m


def closed_form(coupler):
    return np.sqrt((mass + coupler) * g * r / (2 * inertia + mass * r**2 / 2 + coupler * r**2)) / (2 * np.pi)


loads = np.linspace(0.1, 8, 9)
for turn in (2.0, 2.6, 3.4):
    found = []
    for coupler in loads:
        m = drawn(turn, coupler)
        found.append(mb.modes(m, at=mb.equilibrium(m)).frequency[0])
    worst = np.max(np.abs(found / closed_form(loads) - 1))
    print(f"drawn at {np.degrees(turn):5.1f} degrees: largest distance from the closed form {worst:.0e}")
    assert worst < 1e-7
plt.plot(loads, found, "o", label="mbrs")
plt.plot(loads, closed_form(loads), "k:", label="closed form")
plt.xlabel("mass of the coupler [kg]")
plt.ylabel("frequency [Hz]")
picture = plt.legend()
