"""The orbit of an unbalanced shaft that rubs in a hole with play: a law of two coordinates and of time.

python examples/rotors/shaft_in_hole.py

Check: the same equations by SciPy.
"""

import mbrs as mb
import numpy as np
from mbrs.examples import error_table
from scipy.integrate import solve_ivp

mass, k, c, gap, stop, friction = 2.0, 8e4, 40.0, 2e-4, 3e6, 0.1
spin, unbalance = 260.0, 1.1e-4  # rad/s; N = unbalance mass spin^2


def hole(t, u, v):
    """Spring and damper of the shaft, the wall beyond the gap with friction against the spin, minus the unbalance."""
    r = np.hypot(u[0], u[1])
    push = stop * np.maximum(r - gap, 0.0) / np.maximum(r, gap)
    wall = push * np.array([u[0] - friction * u[1], u[1] + friction * u[0]])
    turning = np.array([np.cos(spin * t), np.sin(spin * t)])
    return k * u + c * v + wall - mass * unbalance * spin**2 * turning


m = mb.Model("shaft in a hole")
shaft = m.body("shaft", mass=mass, inertia=(1, 1, 1))
m.planar("hole", m.ground, shaft, at=(0, 0, 0), axis="z", k=(0, 0, 1.0), law={("x", "y"): mb.FunctionLaw(hole)})
t = np.linspace(0, 0.2, 401)
traj = mb.simulate(m, t=t, rtol=1e-10)


def slope(t, y):
    return [*y[2:], *(-hole(t, y[:2], y[2:]) / mass)]


known = solve_ivp(slope, (0, t[-1]), np.zeros(4), t_eval=t, rtol=1e-10, atol=1e-13).y[:2]
ours = np.linalg.norm(traj.position("shaft")[:, :2], axis=1)
rows = [
    ("radius at the end [m]", ours[-1], np.linalg.norm(known[:, -1]), "SciPy"),
    ("largest radius [m]", ours.max(), np.linalg.norm(known, axis=0).max(), "SciPy"),
]
print(error_table(rows))
print(
    f"largest difference of the radius: {np.max(np.abs(ours - np.linalg.norm(known, axis=0))):.1e} m; the play is {gap:.1e} m"
)
