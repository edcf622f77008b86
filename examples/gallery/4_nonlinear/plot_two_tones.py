"""
Two forces without a common period
==================================

Duffing's oscillator under two frequencies of ratio sqrt(2). Claim: three coefficients agree with docs/theory.md
(23.9) to eight digits.
"""

import mbrs as mb
import numpy as np

system = mb.MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[mb.Cubic(1.5, w=[1.0])])
forces = [dict(force=[-0.25j], omega=2.0), dict(force=[-0.25j], omega=2.0 * np.sqrt(2))]
torus = mb.quasi_periodic(system, forces=forces, harmonics=7)
known = {
    (1, 0): (-0.0055712601, -0.0832608775),
    (0, 1): (-0.0014475824, -0.0357439837),
    (2, -1): (-0.0003014939, -0.0006886006),
}
for index, (cosine, sine) in known.items():
    c = torus.coefficient(0, index)
    print(index, c.real, -c.imag)
    assert abs(c - (cosine - 1j * sine)) < 1e-9
picture = torus.plot()
