"""A rigid journal in a short bearing (Ocvirk's film, half of it under pressure) as a law of two coordinates.

python examples/rotors/journal_bearing.py

The film's force is written as in the textbook; equilibrium, stiffness and damping follow from the program that it becomes.
Check: the closed forms of M. I. Friswell, J. E. T. Penny, S. D. Garvey, A. W. Lees, Dynamics of Rotating Machines, Cambridge
University Press 2010, section 5.5.1.
"""

import mbrs as mb
import numpy as np
from mbrs.examples import error_table

diameter, length, clearance, viscosity, load = 0.1, 0.03, 1e-4, 0.028, 525.0  # m, m, m, Pa s, N
spin = 2 * np.pi * 25.0  # rad/s
A = viscosity * diameter * length**3 / (2 * clearance**2)


def film(t, u, v):
    """Minus the force of the film on the journal at u, which moves with v; u = 0 is rounded off by a billionth of the clearance."""
    r = np.sqrt(u @ u + (1e-9 * clearance) ** 2)
    n, e = u / r, r / clearance
    tangent = np.array([-n[1], n[0]])
    de, speed, h = v @ n / clearance, spin - 2 * (v @ tangent) / r, 1 - e**2
    radial = -A * (speed * e**2 / h**2 + 0.5 * np.pi * de * (1 + 2 * e**2) / h**2.5)
    tangential = A * (0.25 * np.pi * speed * e / h**1.5 + 2 * e * de / h**2)
    return -(radial * n + tangential * tangent)


def ocvirk():
    """Eccentricity, K and C of the closed forms, the load along -y."""
    s = diameter * spin * viscosity * length**3 / (8 * load * clearance**2)
    p = [1, -4, 6 - s**2 * (16 - np.pi**2), -(4 + np.pi**2 * s**2), 1]
    e2 = min(x.real for x in np.roots(p) if abs(x.imag) < 1e-9 and 0 < x.real < 1)
    e, q, pi2 = np.sqrt(e2), np.sqrt(1 - e2), np.pi**2
    h = (pi2 * (1 - e2) + 16 * e2) ** -1.5
    a = [
        [4 * (pi2 * (2 - e2) + 16 * e2), np.pi * (pi2 * (1 - e2) ** 2 - 16 * e2**2) / (e * q)],
        [
            -np.pi * (pi2 * (1 - e2) * (1 + 2 * e2) + 32 * e2 * (1 + e2)) / (e * q),
            4 * (pi2 * (1 + 2 * e2) + 32 * e2 * (1 + e2) / (1 - e2)),
        ],
    ]
    cross = -8 * (pi2 * (1 + 2 * e2) - 16 * e2)
    b = [
        [2 * np.pi * q * (pi2 * (1 + 2 * e2) - 16 * e2) / e, cross],
        [cross, 2 * np.pi * (pi2 * (1 - e2) ** 2 + 48 * e2) / (e * q)],
    ]
    return e, h * load / clearance * np.array(a), h * load / (clearance * spin) * np.array(b)


m = mb.Model("journal bearing")
journal = m.body("journal", mass=load / 9.81, inertia=(1, 1, 1))
m.planar("bearing", m.ground, journal, at=(0, 0, 0), axis="z", k=(0, 0, 1.0), law={("x", "y"): mb.FunctionLaw(film)})
m.force("load", journal, value=(0, -load, 0))
eq = mb.equilibrium(m)
lin = mb.linearize(m, at=eq)
K = (lin.K + lin.N if lin.N is not None else lin.K)[:2, :2]
C = (lin.C + lin.G if lin.G is not None else lin.C)[:2, :2]
e, K_known, C_known = ocvirk()
source = "Friswell et al. 2010, 5.5.1"
u = eq.position("journal")[:2]
rows = [("eccentricity / clearance", np.hypot(*u) / clearance, e, source)]
for name, ours, known in (("K", K, K_known), ("C", C, C_known)):
    rows += [(f"{name}[{i}, {j}]", ours[i, j], known[i, j], source) for i in range(2) for j in range(2)]
print(error_table(rows))
print(mb.modes(m, at=eq))
