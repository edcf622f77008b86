"""A Stewart platform whose struts stick and slip: friction in six joints damps it where they slip. Invented data.

python examples/nonlinear/stewart_friction.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.examples import error_table
from mbrs.plot.figure import figure, style
from mbrs.reference import hbm_balance

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
folder.mkdir(parents=True, exist_ok=True)
m = mb.examples.stewart_platform(friction=2.0)
platform = m["platform"]
curves = {}
with style():
    picture, axes = figure()
    for force in (2.0, 10.0, 20.0, 100.0):
        curve = curves[force] = mb.frequency_response(
            m, inputs=platform.force("z"), amplitude=force, frequency=(15, 45), harmonics=[1, 3, 5, 7, 9]
        )
        gain = curve.amplitude("platform.motion.z") / force
        print(
            f"{force:5g} N: largest gain {1e6 * gain.max():7.3f} um/N at {curve.frequency[np.argmax(gain)]:.2f} Hz, {curve.status}"
        )
        axes.semilogy(curve.frequency, gain, label=f"{force:g} N")
    axes.set(xlabel="f [Hz]", ylabel="motion z / force [m/N]")
    axes.legend()
picture.savefig(folder / "stewart-friction.png")
print(f"\n{curves[20.0].table('platform.motion.z', 'platform.motion.ry')}")

# Stuck sliders are springs: the linear platform with 1.5e5 N/m more in each strut.
rows = []
stuck = mb.examples.stewart_platform()
stuck.set({"k_strut": 6e4 + 1.5e5})
for i in (0, 20):
    one = curves[2.0].point(i)
    linear = 2.0 * abs(mb.frf(stuck, "platform.force.z", "platform.motion.z", frequency=[one.frequency]).value[0, 0, 0])
    rows.append(
        (f"2 N, stuck, at {one.frequency:.4f} Hz", one.amplitude("platform.motion.z"), linear, "linear, k + k_t")
    )
system = mb.nonlinear_system(m)
kept = [0, *(c for h in (1, 3, 5, 7, 9) for c in (2 * h - 1, 2 * h))]
for force in (20.0, 100.0):
    one = curves[force].point(int(np.argmax(curves[force].amplitude("platform.motion.z"))))
    X = hbm_balance.harmonic_balance(system, one.force, one.omega, [1, 3, 5, 7, 9], one.n_samples, one.X[:, kept])
    size = float(np.max(np.hypot(X[:, 1], X[:, 2])))
    ours = float(np.max(np.hypot(one.X[:, 1], one.X[:, 2])))
    rows.append((f"{force:g} N: largest |harmonic 1| at {one.frequency:.4f} Hz", ours, size, "plain harmonic balance"))
    found = one.verify(rtol=1e-7)
    source = f"equations that were balanced, in time; estimate {one.error:.0e}"
    rows.append((f"{force:g} N: distance in a period", found.balanced, 0.0, source))
    rows.append((f"{force:g} N: geometry", found.full, 0.0, "full equations of the model, mb.simulate"))
print(error_table(rows))
print(f"pictures in {folder}")
