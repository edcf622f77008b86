"""A functional mock-up unit of a pendulum on a cart, run by fmpy beside the motion that mbrs computes itself."""

import sys
import tempfile
from pathlib import Path

import fmpy
import mbrs as mb
import numpy as np
from fmpy.validation import validate_fmu

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
m = mb.Model("cart", gravity=(0, 0, -9.81))
cart = m.body("cart", mass=2.3, inertia=(0.1, 0.1, 0.1), at=(0, 0, 0))
rod = m.body("rod", mass=0.7, inertia=(0.02, 0.021, 0.003), at=(0.05, 0, -0.4))
m.parameter("c_rail", 1.5, unit="N s/m")
m.prismatic("rail", m.ground, cart, at=(0, 0, 0), axis="x", c=m["c_rail"])
m.revolute("pin", cart, rod, at=(0, 0, 0), axis="y", c=0.02)

unit = mb.fmu(m, folder / "cart.fmu", "cart.force.x", ["cart.motion.x", "rod.motion.x"], rtol=1e-9)
print("problems that fmpy finds:", len(validate_fmu(str(unit))))
found = fmpy.simulate_fmu(
    str(unit), stop_time=2.0, output_interval=0.05, start_values={"cart.force.x": 3.0, "c_rail": 0.9},
    output=["cart.motion.x", "rod.motion.x"],
)  # fmt: skip

m.set({"c_rail": 0.9})
m.force("push", cart, at=(0, 0, 0), value=(3.0, 0, 0))
traj = mb.simulate(m, found["time"], rtol=1e-10)
off = np.abs(found["rod.motion.x"] - (traj.position("rod")[:, 0] - 0.05)).max()
print(f"the rod moves {np.abs(found['rod.motion.x']).max():.4f} m, the unit is off by {off:.1e} m")
print("the unit moves as the model does:", bool(off < 1e-6))
