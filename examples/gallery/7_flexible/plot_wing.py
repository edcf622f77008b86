"""
Lift of a finite wing
=====================

Lifting line of a wing with an elliptic plan form. Claim: the lift slope is 2 pi / (1 + 2/A), and the estimated error
covers the distance.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

thin = mb.aero.polar([-1.5, 1.5], [-3 * np.pi, 3 * np.pi], [0.0, 0.0])
aspects, slopes = np.array([4.0, 6.0, 8.0, 12.0, 20.0]), []
for aspect in aspects:
    y = -4 * np.cos(np.linspace(0, np.pi, 2001))
    chord = 32 / (np.pi * aspect) * np.sqrt(np.maximum(1 - (y / 4) ** 2, 0))
    wing = mb.aero.lifting_line(mb.aero.blade(y, chord, 0.0, thin), 1e-4, strips=80)
    slopes.append(wing.lift_coefficient[0] / 1e-4)
    exact = 2 * np.pi / (1 + 2 / aspect)
    assert abs(slopes[-1] / exact - 1) < min(2e-3, wing.error[0])
plt.plot(aspects, slopes, "o")
a = np.linspace(3, 21)
plt.plot(a, 2 * np.pi / (1 + 2 / a), "k:", label="2 pi / (1 + 2/A)")
plt.xlabel("aspect ratio A")
plt.ylabel("lift slope")
picture = plt.legend()
