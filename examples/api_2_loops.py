"""A closed loop: the model of a four-bar, its equilibrium, linearisation and modes."""

import numpy as np
import mbrs as mb

m = mb.Model("four-bar", gravity=(0, -9.81, 0))
a = m.body("crank", mass=1.0, inertia=(1e-3, 1/12, 1/12), at=(0, 0.5, 0), orientation=mb.rotation("z", np.pi/2))
b = m.body("coupler", mass=1.0, inertia=(1e-3, 1/12, 1/12), at=(0.5, 1, 0))
c = m.body("rocker", mass=1.0, inertia=(1e-3, 1/12, 1/12), at=(1, 0.5, 0), orientation=mb.rotation("z", np.pi/2))
m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z")
m.revolute("B", a, b, at=(0, 1, 0), axis="z")
m.revolute("C", b, c, at=(1, 1, 0), axis="z")
m.revolute("D", c, m.ground, at=(1, 0, 0), axis="z")
m.bushing("mount", m.ground, b, at=(0.5, 1, 0), k=(1e4, 1e4, 1e4, 10, 10, 10), c=(10, 10, 10, 0, 0, 0))
m.torque("motor", a, value=(0, 0, 0.5)); m.force("pull", b, at=(0.5, 1, 0), value=(1.0, 0, 0))   # world axes; frame="body" follows
m.marker("P2", b, at=(1, 1, 0))                  # a named point: traj.point("P2"), s.point("P2"), inputs and outputs
print(mb.System(m))             # bodies, joints, loops, degrees of freedom, redundant constraints by name
eq = mb.equilibrium(m)
modes = mb.modes(m, at=eq)      # exact tangent: springs, preload, constraint forces, gyroscopic terms
lin = mb.linearize(m, at=eq)    # lin.M, .C, .G, .K, .N, .coordinates (names), .T (6 n_bodies, dof)
A, B, C, D = lin.state_space(inputs=b.force("x"), outputs=b.motion("x"))

# Other models:
for model in (mb.examples.chain(4, joint="revolute", springs=1), mb.examples.tree(3), mb.examples.ladder(2),
              mb.examples.quadruped(), mb.examples.stewart_platform()):
    print(mb.modes(model, n=3))
print(mb.campbell(mb.examples.rotor(), "shaft", speed=np.linspace(0, 300, 60)))
