"""
Den Hartog's absorber
=====================

A small mass on a spring and a damper calms a large one. With the tuning 1/(1 + mu) all curves, whatever the damping,
pass through two points of one height, sqrt(1 + 2/mu). Claim: the curves do. Source: J. P. Den Hartog, Mechanical
Vibrations, section 3.3.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

mu, mass, k = 0.1, 10.0, 4e4
tuned = np.sqrt(k / mass) / (1 + mu)


def model(damping):
    m = mb.Model("absorber")
    main = m.body("main", mass=mass, inertia=(1, 1, 1), at=(0, 0, 0))
    small = m.body("small", mass=mu * mass, inertia=(1, 1, 1), at=(0, 0, 0.3))
    m.prismatic("base", m.ground, main, at=(0, 0, 0), axis="z", k=k)
    m.prismatic(
        "spring", main, small, at=(0, 0, 0.3), axis="z", k=mu * mass * tuned**2, c=2 * damping * mu * mass * tuned
    )
    return m


# %%
# The fixed points, from (2 + mu) r^4 - 2 (1 + f^2 + mu f^2) r^2 + 2 f^2 = 0 with r = w / w0:

f = 1 / (1 + mu)
fixed = np.sqrt(np.roots([2 + mu, -2 * (1 + f**2 + mu * f**2), 2 * f**2])) * np.sqrt(k / mass)
omega = np.sort(np.r_[np.linspace(1, 85, 500), fixed])
for damping in (0.05, np.sqrt(3 * mu / (8 * (1 + mu) ** 3)), 0.5):
    h = mb.frf(model(damping), "main.force.z", "main.motion.z", omega=omega)
    plt.semilogy(omega, k * np.abs(h.value[0, 0]), label=f"zeta = {damping:.2f}")
    height = h.value[0, 0, np.isin(omega, fixed)]
    assert np.allclose(k * np.abs(height), np.sqrt(1 + 2 / mu), rtol=1e-9)
plt.plot(fixed, [np.sqrt(1 + 2 / mu)] * 2, "ko")
plt.xlim(40, 85)
plt.xlabel("omega [rad/s]")
plt.ylabel("k |H|")
picture = plt.legend()
