"""Algorithms of the literature and a rotor in the wind on one page. Writes rotor.html."""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
fun, x0 = lambda x: x**2 - np.array([2.0, 3.0]), [1.0, 1.0]
m = mb.Model("bob, skate and shaft", gravity=(0, 0, -9.81))
m.body("bob", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0), pose=((1, 0, 0), (1, 0, 0, 0)))   # drawn at the pivot, begins beside it
m.body("skate", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, 2, 0), velocity=(1, 0, 0), angular_velocity=(0, 0, 0.4))
m.planar("ice", m.ground, "skate", at=(0, 2, 0), axis="z")
m.body("shaft", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, 3))
m.bushing("bearing", m.ground, "shaft", at=(0, 0, 3), k=(1e3, 1e3, 1e3, 10, 10, 10))

sol = mb.root(fun, x0, method="inverse-bfgs", plain=True)      # the algorithm of the text and nothing else
m.constraint("rod", lambda t, x: x @ x - 1.0, ["bob.motion.x", "bob.motion.z"])      # Phi(t, motions) = 0, derivatives by complex step
m.velocity_constraint("edge", lambda t, x: np.array([np.sin(x[2]), -np.cos(x[2]), 0.0]), d=None, motions=["skate.motion.x", "skate.motion.y", "skate.motion.rz"])   # D(t, motions) v + d = 0
m.force_law("film", mb.FunctionLaw(lambda t, u, v: -(u @ u) * u), ["shaft.motion.y", "shaft.motion.z"])   # several coordinates, and time
traj = mb.simulate(m, t=1.0, method="bdf-bfgs", step=1e-3, coordinates="absolute")   # all joint equations as rows
print(sol, traj, sep="\n\n")
m = mb.examples.four_bar()
print(mb.compare(mb.modes(m, at=mb.equilibrium(m))))           # the NumPy reference beside the core, as a table of differences

m = mb.examples.wind_rotor()
m.aerodynamics("air", blades=mb.examples.wind_rotor_blades(), wind=mb.aero.wind(speed=8.0, shear=0.2, reference_height=84.0), inflow="free-wake", options={"steps": 36})
traj = mb.simulate(m, t=float(sys.argv[2]) if len(sys.argv) > 2 else 30.0, rtol=1e-5); traj.aero("blade1").circulation; traj.power; traj.animate(folder / "rotor.html")
print(f"power at the end {traj.power[-1] / 1e3:.0f} kW")
