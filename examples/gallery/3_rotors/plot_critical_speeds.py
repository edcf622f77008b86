"""
The critical speed of a Jeffcott rotor
======================================

A disc between two springs of stiffness k/2, without gyroscopic effect in translation: the critical speed is sqrt(k/m)
exactly. Claim: it is solved for, not read from a grid.
"""

import mbrs as mb
import numpy as np

mass, k = 7.0, 3.1e5
m = mb.Model("Jeffcott")
hub = m.body("hub", mass=1.0, inertia=(0.01, 0.01, 0.01))
disc = m.body("disc", mass=mass - 1.0, inertia=(0.03, 0.03, 0.05))
m.bushing("shaft", m.ground, hub, at=(0, 0, 0), k=(k, k, 5e6, 9e4, 9e4, 1e5))
m.revolute("spin", hub, disc, at=(0, 0, 0), axis="z")
diagram = mb.campbell(m, "spin", speed=np.linspace(0, 400, 9))
excited = [c.speed for c in diagram.critical if c.excited]
print("critical speeds that unbalance excites:", excited, "closed form", np.sqrt(k / mass))
assert min(abs(s / np.sqrt(k / mass) - 1) for s in excited) < 1e-9
picture = diagram.plot()
