"""
A rolling disc rights itself
============================

A disc that rolls straight is stable above a speed: s^2 (A + m r^2) = m g r - C (C + m r^2) W^2 / A. Claim: the
largest real part of its roots follows this formula, and is zero above v = r sqrt(m g r A / (C (C + m r^2))).
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

mass, r, A, C, g = 2.0, 0.3, 0.05, 0.09, 9.81
limit = r * np.sqrt(mass * g * r * A / (C * (C + mass * r * r)))
speeds = np.linspace(0.1, 1.6 * limit, 12)
growth = []
for v in speeds:
    m = mb.Model("disc", gravity=(0, 0, -g))
    b = m.body("disc", mass=mass, inertia=(A, C, A), at=(0, 0, r), velocity=(v, 0, 0), angular_velocity=(0, v / r, 0))
    m.rolling_disc("track", m.ground, b, at=((0.5, 0.2, 0), (0, 0, r)), axis="z", axis2="y", radius=r)
    growth.append(mb.modes(m).roots.real.max())
    square = (mass * g * r - C * (C + mass * r * r) * (v / r) ** 2 / A) / (A + mass * r * r)
    assert abs(growth[-1] - np.sqrt(max(square, 0))) < 1e-5
plt.plot(speeds, growth, "o-")
plt.axvline(limit, color="k", ls=":", label="upright above this speed")
plt.legend()
plt.xlabel("speed [m/s]")
picture = plt.ylabel("growth [1/s]")
