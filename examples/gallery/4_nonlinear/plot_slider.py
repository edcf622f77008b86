"""
Damping by dry friction
=======================

A spring in series with a slider dissipates 4 f (X - f/k) in a cycle of amplitude X > f/k. Claim: the law does, and
the response is damped most at a middle force: a small force does not slip, a large one does not care.
"""

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

k, f, X = 0.5, 0.2, 0.9
u = X * np.cos(np.linspace(0, 4 * np.pi, 40001))
force = mb.Jenkins(k, f).force(u)
area = np.trapezoid(force[20000:], u[20000:])
assert abs(area / (4 * f * (X - f / k)) - 1) < 1e-6

system = mb.examples.jenkins_oscillator(k=k, f_slip=f)
gains = []
for level in (0.01, 0.1, 0.5):
    curve = mb.frequency_response(system, force=[level], omega=(0.6, 1.6), harmonics=7, events=False)
    gains.append(np.max(curve.amplitude(0)) / level)
    plt.plot(curve.omega, curve.amplitude(0) / level, label=f"force {level:g}")
print("largest amplitude over force:", np.round(gains, 2))
assert gains[1] < min(gains[0], gains[2])
plt.xlabel("omega [rad/s]")
plt.ylabel("amplitude / force")
picture = plt.legend()
