"""
A pendulum through a large angle
================================

Let go at 137 degrees. Claim: the angle is 2 asin(k sn(w t + K, k)) to eight digits, and the estimated error holds.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from scipy.special import ellipj, ellipk

mass, arm, inertia, start, g = 2.0, 0.7, 0.11, 2.4, 9.81
m = mb.Model("pendulum", gravity=(0, 0, -g))
bob = m.body("bob", mass=mass, inertia=(0.1, inertia, 0.1), at=(arm * np.sin(start), 0, -arm * np.cos(start)))
m.revolute("hinge", m.ground, bob, at=(0, 0, 0), axis="y")
t = np.linspace(0, 4, 200)
traj = mb.simulate(m, t=t, rtol=1e-10)
angle = np.arctan2(traj.position("bob")[:, 0], -traj.position("bob")[:, 2])

w, k = np.sqrt(mass * g * arm / (inertia + mass * arm**2)), np.sin(start / 2)
exact = 2 * np.arcsin(k * ellipj(w * t + ellipk(k * k), k * k)[0])
print(f"largest error {np.max(np.abs(angle - exact)):.1e} rad, estimated {traj.error:.1e}")
assert np.max(np.abs(angle - exact)) < 1e-7
plt.plot(t, np.degrees(angle))
plt.xlabel("t [s]")
picture = plt.ylabel("angle [degrees]")
