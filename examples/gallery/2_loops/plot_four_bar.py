"""
A four-bar of spatial hinges
============================

Four parallel hinges close a loop with five rows, of which three say nothing new. Claim: mbrs finds one degree of
freedom and three redundant rows, and all forces balance at the equilibrium.
"""

import mbrs as mb

m = mb.examples.four_bar()
system = mb.System(m)
print(system)
assert system.dof == 1

eq = mb.equilibrium(m)
print(eq)
assert eq.status == "converged" and eq.residual < 1e-10

# %%
# A force on the coupler in the direction of its bushing, at this equilibrium:

h = mb.frf(m, "coupler.force.x", "coupler.motion.x", frequency=(1, 60), at=eq)
picture = h.plot()
