"""
What moves a mode
=================

Derivatives of all frequencies of a robot by any of its numbers. Claim: they agree with central differences to the
accuracy of the differences.
"""

import mbrs as mb

m = mb.examples.quadruped()
names = ["k_foot", "k_leg", "torso.mass"]
s = mb.sensitivity(mb.modes(m), names)
print(s)

design = m.copy()
mass = design.value("torso.mass")
values = []
for factor in (1 + 1e-5, 1 - 1e-5):
    design.set({"torso.mass": mass * factor})
    values.append(mb.modes(design).frequency[:3])
difference = (values[0] - values[1]) / (2e-5 * mass)
assert abs(s.frequency[0, -1] - difference[0]) < 1e-6 * abs(difference[0])
picture = s.plot()
