"""
Chaplygin's sleigh
==================

A blade that may not slip sideways, behind the centre of mass: a constraint on velocities that no position remembers.
Claim: the spin decays as w0 / cosh(k t), and the sleigh ends straight.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

mass, inertia, a, w0 = 1.5, 0.2, 0.4, 3.0
m = mb.Model("sleigh")
b = m.body(
    "sleigh", mass=mass, inertia=(0.1, 0.1, inertia), at=(a, 0, 0), velocity=(0, a * w0, 0), angular_velocity=(0, 0, w0)
)
m.planar("ice", m.ground, b, at=(0, 0, 0), axis="z")
m.knife_edge("blade", m.ground, b, at=(0, 0, 0), axis="y")
traj = mb.simulate(m, t=np.linspace(0, 3, 100), rtol=1e-10)
k = w0 * a * np.sqrt(mass / (inertia + mass * a * a))
assert np.allclose(traj.angular_velocity("sleigh")[:, 2], w0 / np.cosh(k * traj.t), atol=1e-8)
at = traj.position("sleigh")
plt.plot(at[:, 0], at[:, 1])
plt.axis("equal")
plt.xlabel("x [m]")
picture = plt.ylabel("y [m]")
