"""
From vibration to creeping
==========================

The two roots of a damped oscillator move on a circle until they meet, and part on the real axis. Claim: every pair of
roots solves s^2 + 2 zeta w s + w^2 = 0, at the critical damping too, where they are hardest to compute.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

w = 10.0
for zeta in np.linspace(0.05, 1.6, 32):
    system = mb.MechanicalSystem([[1.0]], [[2 * zeta * w]], [[w * w]])
    roots = mb.modes(system).roots
    residual = np.abs(roots**2 + 2 * zeta * w * roots + w * w)
    assert np.all(residual < 1e-12 * w * w)
    plt.plot(roots.real, roots.imag, "C0." if zeta < 1 else "C1.")
plt.plot([], [], "C0.", label="zeta < 1")
plt.plot([], [], "C1.", label="zeta > 1")
plt.legend()
plt.axis("equal")
plt.xlabel("Re s [1/s]")
picture = plt.ylabel("Im s [rad/s]")
