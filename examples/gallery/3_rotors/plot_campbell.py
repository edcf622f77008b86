"""
A Campbell diagram
==================

Spinning splits the tilting modes of an overhung disc into backward and forward whirl. Claim: at rest both pairs
coincide; at every speed the split of the tilt grows.
"""

import mbrs as mb
import numpy as np

diagram = mb.campbell(mb.examples.rotor(), "shaft", speed=np.linspace(0, 300, 16))
print(diagram)
picture = diagram.plot()

spread = np.nanmax(diagram.frequency, axis=1) - np.nanmin(diagram.frequency, axis=1)
assert np.all(np.diff(spread) > -1e-9)
