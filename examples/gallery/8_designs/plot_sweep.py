"""
Two hundred designs
===================

A table of designs, outputs for each, what spreads them. Claim: for a small spread the exact derivatives of one design
foretell the frequency of all others, to second order in the change.
"""

import mbrs as mb
import numpy as np

m = mb.examples.cubic_hexapod()
designs = mb.design.latin_hypercube({"k_leg": (0.98e5, 1.02e5), "payload.mass": (19.6, 20.4)}, n=200, seed=1)
runs = mb.sweep(m, designs, mb.outputs.modes(n=3))
frequency = np.asarray(runs["frequency"])[:, 0]

nominal = mb.modes(m)
slope = mb.sensitivity(nominal, ["k_leg", "payload.mass"]).frequency[0]
change = np.asarray(designs.values) - [1e5, 20.0]
foretold = nominal.frequency[0] + change @ slope
print(
    f"spread {np.ptp(frequency):.4f} Hz, largest distance from first order {np.max(np.abs(frequency - foretold)):.5f} Hz"
)
assert np.max(np.abs(frequency - foretold)) < 2 * 0.02**2 * nominal.frequency[0]
picture = runs.plot("k_leg", "frequency[0]", colour="payload.mass")
