"""
A mass with play
================

Play in a joint: free in the middle, stopped at both sides. Claim: the balanced motion at the peak satisfies the full
equations of motion, integrated in time, to a per mille.
"""

import mbrs as mb

m = mb.examples.clearance_oscillator()
curve = mb.frequency_response(m, inputs="mass.force.x", amplitude=3.0, frequency=(5, 25), harmonics=21)
print(curve)
assert curve.peak("rail").verify() < 1e-3
picture = curve.plot("mass.motion.x", harmonic=None)
