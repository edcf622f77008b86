"""
A stage on air mounts
=====================

How much of the floor's motion reaches a wafer stage, in all six directions at once. Claim: below all modes the stage
follows the floor (transmissibility one), above them it does not (less than a hundredth at 200 Hz).
"""

import mbrs as mb

m = mb.examples.wafer_stage()
modes = mb.modes(m)
print(modes)

h = mb.frf(m, mb.base_motion("z"), "chuck.motion.z", frequency=(0.1, 200), kind="transmissibility")
assert abs(h.value[0, 0, 0] - 1) < 0.05 and abs(h.value[0, 0, -1]) < 0.01
picture = h.plot()
