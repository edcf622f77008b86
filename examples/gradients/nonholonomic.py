"""Gradients of a nonholonomic motion: a skate on ice, whose blade may not slip sideways, on a spring. Data invented."""

import mbrs as mb
import numpy as np

m = mb.examples.ice_skate()
psi = mb.Integral(lambda s: np.sum(s.position("skate") ** 2))
names = ["spring.k", "skate.mass", "edge.at[0]", "skate.velocity[0]"]
direct = mb.gradient(m, psi, names, t=5.0, step=1e-2, method="direct")
adjoint = mb.gradient(m, psi, names, t=5.0, step=1e-2, method="adjoint")
print(direct)
print(f"adjoint - direct: {np.abs(adjoint.gradient - direct.gradient).max():.1e}")
traj = mb.simulate(m, t=5.0, step=1e-2, parameters=names)
print("the force across the blade changes its sign:", traj.multipliers.min() < 0 < traj.multipliers.max())
print("d position / d k at the end:", traj.sensitivity("skate.position")[-1, :, 0])
