"""
A row of masses, short and long
===============================

Frequencies of n equal masses in a row are 2 sqrt(k/m) sin((2 j - 1) pi / (4 n + 2)). Claim: the lowest ten are right
to ten digits for 10 masses and for 3000; the second case runs in the sparse solver.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np


def row(n, k=2e4, mass=0.3):
    m = mb.Model("row")
    last = m.ground
    for i in range(n):
        b = m.body(f"b{i}", mass=mass, inertia=(1e-4, 1e-4, 1e-4), at=(0.1 * i, 0, 0))
        m.prismatic(f"s{i}", last, b, at=(0.1 * i, 0, 0), axis="x", k=k)
        last = b
    return m


for n in (10, 3000):
    modes = mb.modes(row(n), n=10)
    j = np.arange(1, 11)
    exact = 2 * np.sqrt(2e4 / 0.3) * np.sin((2 * j - 1) * np.pi / (4 * n + 2)) / (2 * np.pi)
    worst = np.max(np.abs(modes.frequency / exact - 1))
    print(f"{n} masses: route {modes.stats.route!r}, largest error {worst:.0e}, estimated {np.max(modes.error):.0e}")
    assert worst < 1e-10
    plt.semilogy(j, modes.frequency, "o-", label=f"{n} masses")
plt.xlabel("mode")
plt.ylabel("frequency [Hz]")
picture = plt.legend()
