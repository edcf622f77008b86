"""
A second opinion
================

``mb.compare`` computes a result once more with plain NumPy that shares no code with the core. Claim: frequency,
damping and shape agree to ten digits, for a loop at its equilibrium.
"""

import mbrs as mb

m = mb.examples.four_bar()
found = mb.modes(m, at=mb.equilibrium(m))
comparison = mb.compare(found)
print(comparison)
assert all(comparison.agree) and max(comparison.difference) < 1e-10

# %%
# The same for a transfer function:

h = mb.frf(m, "coupler.force.x", "coupler.motion.x", frequency=[5.0, 12.0, 30.0], at=mb.equilibrium(m))
print(mb.compare(h))
picture = mb.frf(m, "coupler.force.x", "coupler.motion.x", frequency=(2, 60), at=mb.equilibrium(m)).plot()
