"""Gradients of a motion on one page: the five-bar; then a matrix V of parameters."""

import mbrs as mb
import numpy as np

m = mb.examples.five_bar()
r0 = np.array([0.5, -2.0, 0.0])

traj = mb.simulate(m, t=5.0, method="ali3p", step=1e-2, parameters=["spring1.length", "spring2.length"])
traj.sensitivity("crank.position")                             # (n_t, 3, n_p)
psi = mb.Integral(lambda s: np.sum((s.point("P2") - r0) ** 2)) # s: positions, velocities, accelerations, reactions; only what is read is differentiated
value, grad = mb.gradient(m, psi, ["spring1.length", "spring2.length"], t=5.0, step=1e-2, scheme="ali3p", method="direct")  # or "adjoint", "auto"
V = m.parameter("V", np.ones((2, 3)))                          # a design variable matrix: derivatives end in (2, 3); `.vetter()` gives the block layout

print(traj)
print(f"psi = {value:.6f}, gradient {grad}")                   # docs/theory.md (23.12): -4.2288, 3.2116 for small steps

# A row of two carriages driven by V: masses, springs and forces.
m = mb.Model("carriages")
V = m.parameter("V", np.array([[1.0, 20.0, 3.0], [2.0, 30.0, 1.0]]))
for i in range(2):
    b = m.body(f"b{i}", mass=V[i, 0], inertia=(1, 1, 1), at=(i, 0, 0))
    m.prismatic(f"rail{i}", m.ground, b, at=(i, 0, 0), axis="x", k=V[i, 1], preload=V[i, 2])
found = mb.gradient(m, mb.Final(lambda s: s.position("b0")[0] * s.position("b1")[0]), "V", t=1.0, step=1e-2)
print(found)
print("shape of the gradient:", found.gradient.shape)
d = mb.simulate(m, t=1.0, step=0.1, parameters="V").sensitivity("b1.position")
print("derivative of a position:", d.shape, "in Vetter's layout:", d.vetter().shape)
