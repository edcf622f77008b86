"""A bead on a tilted, bent wire: a constraint given as a function, against the equation of the bead's own way (docs/theory.md (3.11)).

python examples/motion/bead_on_a_wire.py [folder for the pictures]

With the wire y = f(x) in a plane and gravity (g_x, g_y) in its axes, (1 + f'^2) x" + f' f" x'^2 = g_x + f' g_y. Data invented.
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.examples import error_table
from scipy.integrate import solve_ivp

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
lean = 0.4  # rad, of the plane about the horizontal x axis
across, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, np.sin(lean), np.cos(lean)])
start, g = 0.6, 9.81

m = mb.Model("bead on a wire", gravity=(0, 0, -g))
bend = m.parameter("bend", 0.8)
drawn = start * across + 0.8 * start**2 * up
bead = m.body("bead", mass=0.1, inertia=(1e-5, 2e-5, 1.5e-5), at=drawn)


def wire(t, u):
    place = u + drawn
    return [place @ up - bend * (place @ across) ** 2, place @ np.cross(across, up)]


m.constraint("wire", wire, [bead.motion("x"), bead.motion("y"), bead.motion("z")])
print(mb.System(m))

t = np.linspace(0.0, 3.0, 301)
traj = mb.simulate(m, t=t, rtol=1e-10)
print(traj)


def rate(_, s):
    x, v = s
    slope, curve = 1.6 * x, 1.6
    return [v, (-slope * g * np.cos(lean) - slope * curve * v * v) / (1 + slope**2)]


x = solve_ivp(rate, (0, t[-1]), [start, 0.0], t_eval=t, rtol=1e-12, atol=1e-13).y[0]
rest = m.copy()
rest.bushing("upright", rest.ground, "bead", at=drawn, k=(0, 0, 0, 1, 1, 1))
f = mb.modes(rest, at=mb.equilibrium(rest)).frequency[0]
print(
    error_table(
        [
            ("x after 3 s", traj.position("bead")[-1, 0], x[-1], "the equation of x, DOP853", start),
            ("frequency at the bottom", f, np.sqrt(1.6 * g * np.cos(lean)) / (2 * np.pi), "closed form"),
        ]
    )
)
traj.plot().savefig(folder / "bead.png")
print(f"picture in {folder}")
