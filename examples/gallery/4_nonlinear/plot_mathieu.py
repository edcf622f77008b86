"""
A swing that is pumped
======================

A stiffness that varies with twice the natural frequency makes rest unstable. Claim: for small depth e and damping z
the borders are at W = 2 (1 +- sqrt((e/4)^2 - z^2)) to first order; both are found as period-doubling points.
"""

import mbrs as mb
import numpy as np

depth, zeta = 0.1, 0.01
system = mb.MechanicalSystem([[1.0]], [[2 * zeta]], [[1.0]], elements=[mb.VaryingStiffness(depth, w=[1.0])])
curve = mb.frequency_response(system, force=[0.0], omega=(1.8, 2.2), harmonics=5, max_step=0.05)
borders = sorted(e.omega for e in curve.events)
first_order = 2 * (1 + np.array([-1, 1]) * np.sqrt((depth / 4) ** 2 - zeta**2))
print("borders", borders, "first order", first_order)
assert np.allclose(borders, first_order, atol=depth**2 / 4)
picture = curve.plot_multipliers()
