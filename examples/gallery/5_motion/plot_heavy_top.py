"""
The fast heavy top
==================

A top at 150 rad/s precesses slowly. Claim: its energy, which no equation imposes, is kept to eight digits.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

m = mb.examples.heavy_top()
traj = mb.simulate(m, t=np.linspace(0, 1, 400), rtol=1e-10)
energy = np.asarray(traj.energy)
assert np.ptp(energy) < 1e-8 * np.abs(energy).max()
at = traj.position("top")
plt.plot(at[:, 0], at[:, 1])
plt.axis("equal")
plt.xlabel("x [m]")
picture = plt.ylabel("y [m]")
