"""A boom that swings and stops: how much it rings afterwards, and what its material, its wall and its length have to do with it.

A tube of aluminium, clamped to a driven hinge, with a camera at its tip, without gravity; E, density, wall and length are
parameters. Invented data.

python examples/gradients/flexible_boom.py [folder for the picture]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.plot.figure import figure, style

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
NAMES = ["E", "rho", "wall", "length"]
RADIUS, SWING, END, STEP = 0.031, 0.9, 2.0, 5e-3
SIDEWAYS = 0

m = mb.Model("boom", gravity=(0, 0, 0))
E = m.parameter("E", 6.9e10, unit="Pa")
rho = m.parameter("rho", 2710.0, unit="kg/m^3")
wall = m.parameter("wall", 1.7e-3, unit="m")
length = m.parameter("length", 3.4, unit="m")
area, I = 2 * np.pi * RADIUS * wall, np.pi * RADIUS**3 * wall  # noqa: E741  a thin tube
tube = mb.flexible.beam(
    length, mass=rho * area, EI_flap=E * I, EI_edge=E * I, modes=4, elements=12, attach=["tip"], damping=0.004
)
boom = m.flexible_body("boom", tube)
hinge = m.revolute("hinge", m.ground, boom.node("root"), axis="z")


def course(t):
    """A quarter of a turn in SWING seconds, with rates and accelerations that are zero at both ends, then rest."""
    share = np.minimum(t / SWING, 1.0)
    return 0.5 * np.pi * share**3 * (10 - 15 * share + 6 * share**2)


m.drive("motor", hinge, course)
tip = boom.node("tip")
camera = m.body("camera", mass=0.8, inertia=(2e-3, 2e-3, 1e-3), at=tip.at)
m.fixed("mount", tip, camera, at=tip.at)

modes = mb.modes(m)
by = mb.sensitivity(modes, NAMES)
values = np.array([m.value(name) for name in NAMES])
relative = by.frequency[:2] * values / modes.frequency[:2, None]
print(f"first frequencies {modes.frequency[0]:.3f} and {modes.frequency[1]:.3f} Hz")
print(
    "change of the first in percent for one percent of  "
    + ", ".join(f"{n} {x:+.3f}" for n, x in zip(NAMES, relative[0], strict=True))
)

# the bending that is left once the hinge rests: mean square of the modal coordinates
ringing = mb.Integral(lambda s: np.sum(s.modal("boom") ** 2) * (s.t > SWING))
options = dict(t=END, step=STEP)
back = mb.gradient(m, ringing, NAMES, method="adjoint", **options)
ahead = mb.gradient(m, ringing, NAMES, method="direct", **options)
off = np.abs(back.gradient - ahead.gradient).max() / np.abs(ahead.gradient).max()
print(f"ringing {back.value:.6e}; adjoint against direct: {off:.0e}")
differences = []
for name, value in zip(NAMES, values, strict=True):
    ends = []
    for factor in (1 + 1e-5, 1 - 1e-5):
        m.set({name: value * factor})
        ends.append(mb.gradient(m, ringing, ["E"], method="adjoint", **options).value)
    m.set({name: value})
    differences.append((ends[0] - ends[1]) / 2e-5)
print("name     change in percent for one percent   by differences")
for name, own, other in zip(
    NAMES, back.gradient * values / back.value, np.array(differences) / back.value, strict=True
):
    print(f"{name:8s} {own:28.4f} {other:18.4f}")
agree = np.allclose(back.gradient * values, differences, rtol=1e-4, atol=1e-6 * back.value)
print(f"gradient and differences agree: {agree}")

with style():
    picture, (left, right) = figure(1, 2, size=(10.0, 4.2))
    for factor, label in ((1.0, "as drawn"), (0.95, "5 % shorter")):
        m.set({"length": factor * values[3]})
        traj = mb.simulate(m, t=END, step=STEP, method="ali3p")
        left.plot(traj.t, 1e3 * traj.modal("boom")[:, SIDEWAYS], label=label)
    m.set({"length": values[3]})
    left.axvline(SWING, color="#6b7280", lw=0.8)
    left.set(
        xlabel="t [s]", ylabel="sideways bending, modal coordinate [10$^{-3}$]", title="it swings, stops and rings"
    )
    left.legend(loc="upper right")
    right.barh(NAMES, back.gradient * values / back.value)
    right.set(xlabel="change of the ringing in % for 1 %", title="what it depends on")
picture.savefig(folder / "flexible-boom.png")
print(f"pictures in {folder}")
