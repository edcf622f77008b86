"""
Duffing's oscillator through both folds
=======================================

A hardening spring bends the resonance: between two folds there are three motions, one of them unstable. Claim: the
folds are at the frequencies of docs/theory.md (23.5), found there by shooting.
"""

import mbrs as mb
import numpy as np

duffing = mb.MechanicalSystem(M=[[1.0]], C=[[0.05]], K=[[1.0]], elements=[mb.Cubic(0.1, w=[1.0])])
curve = mb.frequency_response(duffing, force=[0.18], omega=(0.5, 1.6), harmonics=7)
print(curve)
assert np.allclose([e.omega for e in curve.events], [1.26960, 1.11570], atol=1e-5)
picture = curve.plot()

# %%
# At the peak the balanced motion is compared with one integrated in time, step by step.

peak = curve.peak()
print("distance from the motion integrated in time:", peak.verify())
assert peak.verify() < 1e-4
picture = peak.plot_orbit()
