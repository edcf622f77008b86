"""A car of fourteen degrees of freedom on double wishbones over a bump: what its ride depends on, and better springs and dampers.

All data are invented (python/mbrs/examples/_car.py). The car drives 1.5 s before the bump; the ride is judged from then on.

python examples/gradients/car.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.plot.figure import figure, style

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
m = mb.examples.car()
print(f"{mb.System(m).dof} degrees of freedom, {len(m.bodies)} bodies, {len(m.joints)} joints")
BUMP, END, STEP = 1.5, 2.5, 1e-2
CORNERS = [f"{axle} {side}" for axle in ("front", "rear") for side in ("left", "right")]


def ride(s):
    """Squared vertical acceleration at the driver's seat, m2/s4, and turning of the lower arms: 1 degree counts as 0.25 m/s2."""
    travel = sum(s.joint(f"{corner} lower hinge") ** 2 for corner in CORNERS)
    return (s.t >= BUMP) * (s.point_acceleration("driver")[2] ** 2 + (0.25 * 180 / np.pi) ** 2 * travel)


# --- every spring, damper, tyre number and hard point at once: one motion back, whatever their number
psi = mb.Integral(ride)
every = mb.gradient(m, psi, list(m.parameters), t=END, step=STEP)
print(every)
points = {name: 0.01 for name in m.parameters if not name.endswith(("_k", "_c"))}
every.plot(change=points, n=25).savefig(folder / "car-tornado.png")
every.save(folder / "car-gradient.json")

some = ["rear_spring_c", "front_lower_ball[2]"]
direct = mb.gradient(m, psi, some, t=END, step=STEP, method="direct")
back = every.sensitivity(some).value
print(f"\nadjoint against direct: {np.abs(back / direct.gradient - 1).max():.1e}")
print(mb.check_gradients(lambda m: mb.gradient(m, psi, some, t=END, step=STEP, method="direct"), m, some))

# --- over time
traj = mb.simulate(
    m, t=END, step=STEP, method="ali3p", parameters=["front_spring_k", "front_spring_c", "front_spring_low[1]"]
)
traj.plot("sensitivity", of="driver").savefig(folder / "car-sensitivity.png")
print(traj.sensitivity_table("driver"))

# --- springs and dampers of both axles
names = [f"{axle}_spring_{what}" for axle in ("front", "rear") for what in "kc"]
least = {"k": 0.8, "c": 0.3}  # softer springs would let the body sway
bounds = {name: (least[name[-1]] * m.value(name), 3.0 * m.value(name)) for name in names}
before = mb.simulate(m, t=np.linspace(0.0, END, 501), rtol=1e-6)
best = mb.problem(m, psi, names, t=END, step=STEP, bounds=bounds).solve(options={"maxiter": 8})
print(best)
best.plot().savefig(folder / "car-convergence.png")
after = mb.simulate(m, t=np.linspace(0.0, END, 501), rtol=1e-6)

# --- what the driver feels
with style():
    picture, (upper, lower) = figure(2, 1, size=(8.0, 5.0), sharex=True)
    for label, run in (("as drawn", before), ("optimised", after)):
        height = run.point("driver")[:, 2]
        upper.plot(run.t, 1e3 * (height - height[run.t < BUMP][-1]), label=label)
        lower.plot(run.t, np.gradient(np.gradient(height, run.t), run.t), label=label)
    upper.set(ylabel="rise of the seat [mm]", xlim=(BUMP - 0.1, END))
    lower.set(ylabel="acceleration [m/s2]", xlabel="t [s]")
    upper.legend()
picture.savefig(folder / "car-ride.png")
after.animate(folder / "car.html", follow="chassis", paths=["driver"])
print(f"pictures in {folder}")
