"""
A push that lasts
=================

A constant force is switched on. Claim: the computed response of an oscillator is the closed form to twelve digits at
any density of output times, since the method is exact for loads that are linear between the times.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

mass, k, zeta, force = 2.0, 3.2e3, 0.05, 5.0
w = np.sqrt(k / mass)
wd = w * np.sqrt(1 - zeta**2)
m = mb.Model("oscillator")
b = m.body("b", mass=mass, inertia=(1, 1, 1))
m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=k, c=2 * zeta * w * mass)

for n in (12, 300):
    t = np.linspace(0, 1, n)
    y = mb.response(m, t=t, loads={b.force("x"): np.full(n, force)}, outputs=b.motion("x"))
    exact = force / k * (1 - np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta * w / wd * np.sin(wd * t)))
    assert np.max(np.abs(y.value[0] - exact)) < 1e-12 * force / k * 100
    plt.plot(t, 1e3 * y.value[0], "o" if n == 12 else "-", label=f"{n} times")
plt.xlabel("t [s]")
plt.ylabel("x [mm]")
picture = plt.legend()
