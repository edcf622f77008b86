"""
Limit cycles of van der Pol
===========================

Self-excited vibration, from almost a sine to a relaxation oscillation. Claim: periods agree with docs/theory.md
(23.10) to eight digits.
"""

import matplotlib.pyplot as plt
import mbrs as mb

for mu, harmonics, period in ((0.2, 15, None), (1.0, 31, 6.66328686), (5.0, 159, 11.61223067)):
    system = mb.MechanicalSystem([[1.0]], [[-mu]], [[1.0]], elements=[mb.VanDerPol(mu, w=[1.0])])
    cycle = mb.limit_cycle(system, harmonics=harmonics)
    assert period is None or abs(cycle.period / period - 1) < 1e-8
    t = [cycle.period * i / 600 for i in range(601)]
    plt.plot(cycle.displacement(t)[0], cycle.velocity(t)[0], label=f"mu = {mu:g}, period {cycle.period:.4f}")
plt.xlabel("x")
plt.ylabel("x'")
picture = plt.legend()
