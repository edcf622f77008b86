"""Gradients over the step against known ones: the five-bar (docs/theory.md (23.12)) and the nonholonomic particle (23.13).

Known values: converged by Runge-Kutta and DOP853; the five-bar was found by a search, the particle is an own example. The error of
a discrete gradient falls with the square of the step, so two steps give an extrapolated value of fourth order.

python examples/gradients/known_values.py
"""

import mbrs as mb
import numpy as np
from mbrs.examples import error_table

BAR = {"psi": 0.7268774613, "d L01": -4.22881085, "d L02": 3.21160410}
PARTICLE = {"psi": 3.89396846, "d k": 0.02152155, "d m": -0.21521547, "d b": 0.29491657}


def gradients(m, psi, names, steps):
    """Objective and gradient over 5 s, for each step."""
    found = [mb.gradient(m, psi, names, t=5.0, step=h) for h in steps]
    return [np.array([f.value, *f.gradient]) for f in found]


def show(title, known, steps, rows):
    """A line for every step, and the extrapolation of the two finest: the rest is of order h^4."""
    print(f"\n{title}\n{'':20s}" + "".join(f"{name:>16s}" for name in known))
    best = (4 * rows[-1] - rows[-2]) / 3
    ratio = (rows[-2] - list(known.values())) / (rows[-1] - list(known.values()))
    lines = {f"h = {h:g}": row for h, row in zip(steps, rows, strict=True)}
    for name, row in ({"known": known.values()} | lines | {"extrapolated": best}).items():
        print(f"{name:20s}" + "".join(f"{v:16.8f}" for v in row))
    print(f"{'errors fell by':20s}" + "".join(f"{r:16.3f}" for r in ratio))
    return [
        (f"{title}, {name}", value, exact, "docs/theory.md (23.12), (23.13)")
        for value, (name, exact) in zip(best, known.items(), strict=True)
    ]


m = mb.examples.five_bar()
drawn = np.array([0.5, -2.0, 0.0])
psi = mb.Integral(lambda s: np.sum((s.point("P2") - drawn) ** 2))
steps = (1e-2, 5e-3, 2.5e-3)
table = show("five-bar, 5 s", BAR, steps, gradients(m, psi, ["spring1.length", "spring2.length"], steps))

m = mb.examples.nonholonomic_particle()
psi = mb.Integral(lambda s: np.sum(s.position("point") ** 2))
steps = (1e-2, 5e-3, 2.5e-3, 1.25e-3)
table += show("nonholonomic particle, 5 s", PARTICLE, steps, gradients(m, psi, ["k", "m", "b"], steps))

print(error_table(table))
