"""
The tennis racket
=================

A body that spins about its middle axis of inertia turns over, again and again. Claim: energy and angular momentum,
which nobody imposes, are kept to ten digits.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

inertia = np.array([0.2, 0.3, 0.45])
m = mb.Model("racket")
m.body("racket", mass=1.0, inertia=inertia, angular_velocity=(0.01, 5.0, 0.01))
traj = mb.simulate(m, t=np.linspace(0, 12, 600), rtol=1e-11)

w = np.einsum("tji,tj->ti", traj.rotation("racket"), traj.angular_velocity("racket"))
momentum = np.einsum("tij,tj->ti", traj.rotation("racket"), inertia * w)
energy = 0.5 * w**2 @ inertia
assert np.ptp(energy) < 1e-9 * energy[0] and np.max(np.abs(momentum - momentum[0])) < 1e-8
plt.plot(traj.t, w, label=["x, least inertia", "y", "z"])
plt.legend()
plt.xlabel("t [s]")
picture = plt.ylabel("angular velocity in body axes [rad/s]")
