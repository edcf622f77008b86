"""
A driven slider-crank
=====================

The crank turns evenly, the piston does not. Claim: its place is r cos a + sqrt(l^2 - r^2 sin^2 a) at every output.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

r, rod_length, speed = 0.1, 0.3, 30.0
m = mb.Model("slider-crank")
crank = m.body("crank", mass=1.0, inertia=(0.01, 0.02, 0.02), at=(r / 2, 0, 0))
rod = m.body("rod", mass=0.8, inertia=(0.01, 0.02, 0.02), at=(r + rod_length / 2, 0, 0))
piston = m.body("piston", mass=1.4, inertia=(0.01, 0.01, 0.01), at=(r + rod_length, 0, 0))
m.revolute("main", m.ground, crank, at=(0, 0, 0), axis="y")
m.revolute("pin", crank, rod, at=(r, 0, 0), axis="y")
m.revolute("wrist", rod, piston, at=(r + rod_length, 0, 0), axis="y")
m.prismatic("bore", m.ground, piston, at=(r + rod_length, 0, 0), axis="x")
m.drive("turn", "main", mb.Ramp(speed))
traj = mb.simulate(m, t=np.linspace(0, 0.4, 200), rtol=1e-9)

a = speed * traj.t
assert np.allclose(
    traj.position("piston")[:, 0], r * np.cos(a) + np.sqrt(rod_length**2 - (r * np.sin(a)) ** 2), atol=1e-9
)

# %%
# The force of the drive is what the piston's inertia asks for.

plt.plot(np.degrees(a), traj.drive_force("turn"))
plt.xlabel("crank angle [degrees]")
picture = plt.ylabel("torque of the drive [N m]")
