"""
An optimum of a motion
======================

Natural lengths of two springs that hold a point of a five-bar still. Claim: direct and adjoint gradients agree to
rounding, and agree with docs/theory.md (23.12) to the error of the step.
"""

import mbrs as mb
import numpy as np

m = mb.examples.five_bar()
goal = np.array([0.5, -2.0, 0.0])
objective = mb.Integral(lambda s: np.sum((s.point("P2") - goal) ** 2))
names = ["spring1.length", "spring2.length"]
direct = mb.gradient(m, objective, names, t=1.0, step=5e-3, method="direct")
adjoint = mb.gradient(m, objective, names, t=1.0, step=5e-3, method="adjoint")
print(direct)
assert np.allclose(direct.gradient, adjoint.gradient, rtol=1e-9)
assert np.allclose(direct.gradient, [-0.62560973, 0.47715465], rtol=1e-3)

problem = mb.problem(m, objective, names, t=1.0, step=2e-2, bounds={name: (1.0, 3.5) for name in names})
best = problem.solve()
print(best)
assert best.value < 1e-6 * direct.value
picture = best.plot()
