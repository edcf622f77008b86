"""
A ball on an elastic stop
=========================

Free fall, half a cycle on the stop, and up again. Claim: after one whole bounce, computed in closed form, the ball is
back where it began.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

mass, k, height, g = 1.0, 5e3, 0.1, 9.81
m = mb.Model("bounce", gravity=(0, 0, -g))
b = m.body("ball", mass=mass, inertia=(0.1, 0.1, 0.1))
m.prismatic("guide", m.ground, b, at=(0, 0, 0), axis=(0, 0, -1), law=mb.Gap(k, height))
w, fall = np.sqrt(k / mass), np.sqrt(2 * height / g)
period = 2 * fall + 2 * (np.pi - np.arctan2(g * fall / w, g / w**2)) / w
traj = mb.simulate(m, t=np.linspace(0, 3 * period, 301), rtol=1e-9)
z = traj.position("ball")[:, 2]
print("height after one, two and three bounces:", z[[100, 200, 300]])
assert np.max(np.abs(z[[100, 200, 300]])) < 1e-5
plt.plot(traj.t, z)
plt.axhline(-height, color="k", ls=":", label="stop")
plt.legend(loc="upper right")
plt.xlabel("t [s]")
picture = plt.ylabel("height [m]")
