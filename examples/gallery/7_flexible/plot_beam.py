"""
A clamped beam
==============

Claim: the frequencies of a beam of twenty elements are those of Euler and Bernoulli, cos x cosh x = -1, to five
digits, and its static deflection is F L^3 / 3 E I.
"""

import mbrs as mb
import numpy as np
from scipy.optimize import brentq

length, EI, mass = 1.5, 600.0, 2.0
body = mb.flexible.beam(length, mass=mass, EI_flap=EI, EI_edge=10 * EI, modes=8, attach=["tip"])
roots = [brentq(lambda x: np.cos(x) + 1 / np.cosh(x), x - 0.3, x + 0.3) for x in (1.875, 4.694)]
exact = (np.array(roots) / length) ** 2 * np.sqrt(EI / mass) / (2 * np.pi)

m = mb.Model("beam")
beam = m.flexible_body("beam", body, at=(0, 0, 0))
m.fixed("wall", m.ground, beam.node("root"))
modes = mb.modes(m)
print(modes)
for f in exact:
    assert np.min(np.abs(modes.frequency / f - 1)) < 1e-4
force, motion = beam.node("tip").force("z"), beam.node("tip").motion("z")
static = mb.frf(m, force, motion, frequency=[0.0]).value[0, 0, 0]
assert abs(static * 3 * EI / length**3 - 1) < 1e-9
picture = mb.frf(m, force, motion, frequency=(1, 60)).plot()
