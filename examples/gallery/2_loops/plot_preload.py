"""
A string is tuned by its tension
================================

Nine beads on a wire vibrate only because the wire is loaded. Claim: their frequencies are 2 sqrt(T/(m d)) sin(j
pi/20); tension enters the stiffness without a word from the user.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

n, mass, d = 9, 0.05, 0.1


def beads(tension):
    m = mb.Model("beads")
    last, at = m.ground, (0.0, 0, 0)
    for i in range(1, n + 2):
        here = (i * d, 0, 0)
        b = m.ground
        if i <= n:
            b = m.body(f"b{i}", mass=mass, inertia=(1e-6, 1e-6, 1e-6), at=here)
            m.prismatic(f"p{i}", m.ground, b, at=here, axis="z")
        m.spring_damper(f"s{i}", last, b, at=(at, here), k=1e5, preload=tension)
        last, at = b, here
    return m


j = np.arange(1, n + 1)
for tension in (50.0, 200.0, 800.0):
    found = mb.modes(beads(tension)).frequency
    known = 2 * np.sqrt(tension / (mass * d)) * np.sin(j * np.pi / (2 * n + 2)) / (2 * np.pi)
    assert np.allclose(found, known, rtol=1e-9)
    plt.plot(j, found, "o-", label=f"{tension:.0f} N")
plt.xlabel("mode")
plt.ylabel("frequency [Hz]")
picture = plt.legend()
