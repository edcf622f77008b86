"""A pendulum on a universal joint whose two angles a law couples: its swing goes over from one plane to the other.

python examples/nonlinear/coupled_pendulum.py [folder for the picture]

Check: Lagrange's equations by SciPy. All data are invented.
"""

import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
from mbrs.examples import error_table
from scipy.integrate import solve_ivp

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
mass, length, inertia, g, kappa = 1.2, 0.6, 0.02, 9.81, -6.0
start = (2.0, 0.2)  # rates of the angles a about z and b about x, rad/s


def coupling(t, u, v):
    """The gradient of kappa (a b)^2/2."""
    return np.array([kappa * u[0] * u[1] ** 2, kappa * u[0] ** 2 * u[1]])


m = mb.Model("coupled pendulum", gravity=(0, -g, 0))
at, spin = np.array([0.0, -length, 0.0]), np.array([start[1], 0.0, start[0]])
bob = m.body(
    "bob", mass=mass, inertia=(inertia, inertia, inertia), at=at, velocity=np.cross(spin, at), angular_velocity=spin
)
m.universal("pivot", m.ground, bob, at=(0, 0, 0), axis="z", axis2="x", law={("rz", "rx"): mb.FunctionLaw(coupling)})
t = np.linspace(0.0, 20.0, 1001)
traj = mb.simulate(m, t=t, rtol=1e-10)
a, b = traj.joint("pivot").T


def slope(t, y):
    """T = (J + m l^2) b'^2/2 + (J + m l^2 cos^2 b) a'^2/2, V = -m g l cos a cos b + kappa (a b)^2/2."""
    a, b, da, db = y
    swing, weight = mass * length**2, mass * g * length
    c, s = np.cos(b), np.sin(b)
    return [
        da,
        db,
        (2 * swing * c * s * da * db - weight * c * np.sin(a) - kappa * a * b * b) / (inertia + swing * c * c),
        (-swing * c * s * da * da - weight * s * np.cos(a) - kappa * a * a * b) / (inertia + swing),
    ]


known = solve_ivp(slope, (0, t[-1]), [0, 0, *start], "DOP853", t, rtol=1e-11, atol=1e-13).y
print(
    error_table(
        [
            ("angle a at the end [rad]", a[-1], known[0, -1], "SciPy", np.abs(known[0]).max()),
            ("angle b at the end [rad]", b[-1], known[1, -1], "SciPy", np.abs(known[1]).max()),
        ]
    )
)
early, late = (np.abs(b[(t > low) & (t < low + 2)]).max() for low in (0.0, t[np.argmax(np.abs(b))] - 1.0))
print(f"swing in the other plane: {early:.3f} rad in the first two seconds, {late:.3f} rad at its largest")
figure, ax = plt.subplots(figsize=(8.5, 3.5), layout="constrained")
ax.plot(t, a, label="about z")
ax.plot(t, b, label="about x")
ax.set(xlabel="t [s]", ylabel="angle [rad]")
ax.legend()
figure.savefig(folder / "coupled-pendulum.png", dpi=110)
print(f"picture in {folder}")
