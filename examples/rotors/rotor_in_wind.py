"""Three flexible blades in the wind at 17.2 r/min beside a free vortex wake, and beside blade elements and momentum.

Blades of the WindPACT 1.5 MW turbine (structure public, chord and sections invented), sheared wind of 8 m/s. The wake makes 36 steps a
turn, 10 degrees each: an eighth of the period of the first flapwise mode is 10.5 degrees.

python examples/rotors/rotor_in_wind.py [folder for the pictures] [seconds of the motion, 30]
"""

import sys
import tempfile
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
end = float(sys.argv[2]) if len(sys.argv) > 2 else 30.0
tilt = np.radians(5.0)


def rotor(inflow, **more):
    """The flexible rotor of the examples in wind."""
    m = mb.examples.wind_rotor()
    m.aerodynamics(
        "air",
        blades=mb.examples.wind_rotor_blades(),
        wind=mb.aero.wind(speed=8.0, direction="x", shear=0.2, reference_height=84.0),
        density=1.225,
        inflow=inflow,
        axis=(np.cos(tilt), 0.0, np.sin(tilt)),
        **more,
    )
    return m


# --- the motion with a free wake, and with momentum theory in its place
m = rotor("free-wake", options={"steps": 36})
print(mb.effects(m)["aerodynamics"].why)
t = np.linspace(0.0, end, max(int(40 * end), 20) + 1)
begin = time.perf_counter()
traj = mb.simulate(m, t=t, rtol=1e-5)
spent = time.perf_counter() - begin
turns = end * 17.2 / 60.0
print(f"{end:g} s, {turns:.3g} turns, in {spent:.3g} s: {spent / turns:.3g} s a turn")
momentum = mb.simulate(rotor("bem"), t=t, rtol=1e-5)
loads = traj.aero("blade1")
print(loads)
late = t >= t[-1] - min(60.0 / 17.2, 0.5 * end)
for name, one in (("free wake", traj), ("momentum", momentum)):
    print(
        f"{name}: {one.power[late].mean() / 1e3:.1f} kW, thrust {one.thrust[late].mean() / 1e3:.1f} kN (the last turn)"
    )

# --- figures
figure, axes = plt.subplots(4, 1, figsize=(8.5, 10.0), sharex=True, layout="constrained")
blade = mb.examples.wind_blade()
shape = blade.node_shape[blade.node("tip"), :3]
for one, style, label in ((traj, "-", "free wake"), (momentum, ":", "momentum")):
    axes[0].plot(t, one.power / 1e3, "C0" + style, label=label)
    axes[1].plot(t, one.thrust / 1e3, "C1" + style, label=label)
    for i in range(3):
        tip = one.modal(f"blade{i + 1}") @ shape.T
        named = f"blade {i + 1}" if one is traj else None
        axes[2].plot(t, tip[:, 2], f"C{i}{style}", label=named)
        axes[3].plot(t, tip[:, 1], f"C{i}{style}", label=named)
for place, label in zip(axes, ("power [kW]", "thrust [kN]", "tip, flapwise [m]", "tip, edgewise [m]"), strict=True):
    place.set_ylabel(label)
    place.legend(fontsize=8, ncols=3)
axes[-1].set_xlabel("t [s]")
figure.savefig(folder / "rotor-in-wind-motion.png")

figure, axes = plt.subplots(1, 2, figsize=(9.5, 4.0), layout="constrained")
for one, style, label in ((loads, "-", "free wake"), (momentum.aero("blade1"), ":", "momentum")):
    axes[0].plot(one.place, np.degrees(one.angle_of_attack[late].mean(axis=0)), style, label=label)
    axes[1].plot(one.place, one.circulation[late].mean(axis=0), style, label=label)
axes[0].set(xlabel="place along the blade [m]", ylabel="angle of attack [deg]")
axes[1].set(xlabel="place along the blade [m]", ylabel="circulation [m2/s]")
axes[0].legend()
figure.savefig(folder / "rotor-in-wind-blade.png")
loads.plot().savefig(folder / "rotor-in-wind-loads.png")
traj.animate(folder / "rotor-in-wind.html")

# --- coefficients of the same blades, rigid
steady = mb.aero.performance(m, tip_speed_ratio=np.linspace(2, 12, 21))
print(steady)
steady.plot().savefig(folder / "rotor-in-wind-performance.png")
print(f"pictures in {folder}")
