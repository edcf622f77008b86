"""
A published blade
=================

The blade of the WindPACT 1.5 MW turbine from its published distributions. Claim: two flapwise and two edgewise
frequencies agree with an independent integral equation (docs/theory.md (23.14)) to five digits.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

data = mb.examples.windpact_blade()
blade = mb.flexible.beam(data.station, mass=data.mass, EI_flap=data.EI_flap, EI_edge=data.EI_edge, modes=6)
print(blade.frequencies()[:4])
assert np.allclose(blade.frequencies()[:4], [1.230858, 1.877751, 3.674065, 6.374249], rtol=1e-5)
plt.semilogy(data.station, data.EI_flap, label="flapwise")
plt.semilogy(data.station, data.EI_edge, label="edgewise")
plt.xlabel("place along the blade [m]")
plt.ylabel("bending stiffness [N m2]")
picture = plt.legend()
