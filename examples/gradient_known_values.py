"""Gradients over the step against known ones: the five-bar (docs/theory.md (23.12)) and the nonholonomic particle (23.13).

Known values: converged by Runge-Kutta and DOP853; the five-bar was found by a search, the particle is an own
example. "ALI3-P, natural": docs/theory.md (17.14) to (17.17) in plain NumPy, points as coordinates; "mbrs": joint coordinates, so that the
discrete solutions differ while both tend to the same.

python examples/gradient_known_values.py
"""

import mbrs as mb
import numpy as np
from error_table import error_table
from mbrs.reference.ali3p import Scheme, trapezoid
from mbrs.reference.ali3p_models import POINTS, FiveBar, NonholonomicPoint

BAR = {"psi": 0.7268774613, "d L01": -4.22881085, "d L02": 3.21160410}
PARTICLE = {"psi": 3.89396846, "d k": 0.02152155, "d m": -0.21521547, "d b": 0.29491657}
PUBLISHED = {1e-2: (-4.22937, 3.21102), 5e-3: (-4.22895, 3.21146), 2.5e-3: (-4.22885, 3.21157)}  # ALI3-P over h


def natural(mechanism, h, part, drawn, columns):
    """Objective and gradient of a mechanism of the reference."""
    motion, tangent = Scheme(mechanism, mechanism.p, h).run_tangent(round(5 / h))
    off = np.array([i.q[part] - drawn for i in motion])
    slopes = np.array([2 * o @ d.q[part][:, columns] for o, d in zip(off, tangent, strict=True)])
    return [trapezoid((off**2).sum(axis=1), h), *trapezoid(slopes, h)]


def ours(m, psi, names, h):
    found = mb.gradient(m, psi, names, t=5.0, step=h)
    return [found.value, *found.gradient]


def show(title, known, runs):
    """A line for every run, and the extrapolation of the two finest of each kind: the rest is of order h^4."""
    print(f"\n{title}\n{'':26s}" + "".join(f"{name:>16s}" for name in known))
    print(f"{'known':26s}" + "".join(f"{value:16.8f}" for value in known.values()))
    for kind, rows in runs.items():
        for h, values in rows:
            print(f"{kind + f', h = {h:g}':26s}" + "".join(f"{v:16.8f}" for v in values))
        (_, coarse), (_, fine) = rows[-2:]
        best = (4 * np.array(fine) - coarse) / 3
        print(f"{kind + ', extrapolated':26s}" + "".join(f"{v:16.8f}" for v in best))
        ratio = np.subtract(rows[-2][1], list(known.values())) / np.subtract(rows[-1][1], list(known.values()))
        print(f"{'  errors fell by':26s}" + "".join(f"{r:16.3f}" for r in ratio))
        yield kind, best


m = mb.examples.five_bar()
r0 = np.array([*POINTS[1], 0.0])
psi = mb.Integral(lambda s: np.sum((s.point("P2") - r0) ** 2))
lengths = ["spring1.length", "spring2.length"]
own = [(h, ours(m, psi, lengths, h)) for h in (1e-2, 5e-3, 2.5e-3)]
plain = [(h, natural(FiveBar(), h, slice(2, 4), POINTS[1], slice(0, 2))) for h in (1e-2, 5e-3)]
table = []
for kind, best in show("five-bar, 5 s", BAR, {"mbrs": own, "ALI3-P, natural": plain}):
    table += [
        (f"five-bar, {kind}, {name}", value, known, "docs/theory.md (23.12)")
        for value, (name, known) in zip(best, BAR.items(), strict=True)
    ]
for h, values in plain:
    print(f"natural, h = {h:g}: gradient ({values[1]:.5f}, {values[2]:.5f}), known {PUBLISHED[h]}")

m = mb.examples.nonholonomic_particle()
psi = mb.Integral(lambda s: np.sum(s.position("carriage")[:2] ** 2) + (3.0 - s.position("slider")[0]) ** 2)
own = [(h, ours(m, psi, ["k", "m", "b"], h)) for h in (1e-2, 5e-3, 2.5e-3, 1.25e-3)]
plain = [(h, natural(NonholonomicPoint(), h, slice(0, 3), 0.0, [1, 0, 2])) for h in (2e-2, 1e-2)]
for kind, best in show("nonholonomic particle, 5 s", PARTICLE, {"mbrs": own, "ALI3-P, natural": plain}):
    table += [
        (f"particle, {kind}, {name}", value, known, "docs/theory.md (23.13)")
        for value, (name, known) in zip(best, PARTICLE.items(), strict=True)
    ]

print(error_table(table))
