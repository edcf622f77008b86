"""A bracket of a finite-element program, from OUTPUT4, that meets a stop: its response from below the gap to far above it."""

import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())

# in place of the file of the other program: a bar of 12 elements held at one end, in N, m, kg
n, k, mass = 12, 3.1e6, 0.037
K = k * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
K[-1, -1] = k
mb.MechanicalSystem(M=mass * np.eye(n), K=K).save(folder / "bracket.op4")

read = mb.MechanicalSystem.load(folder / "bracket.op4")
tip = np.eye(n)[-1]
f1 = mb.modes(read).frequency[0]
C = 0.02 / (2.0 * np.pi * f1) * read.K
gap = 2e-5
stop = mb.Gap(k=4e4, gap=gap, smoothing=gap / 20.0, w=tip)
bracket = mb.MechanicalSystem(M=read.M, C=C, K=read.K, elements=[stop])
closed_form = np.sqrt(k / mass) / np.pi * np.sin(np.pi / (2 * (2 * n + 1)))
print(f"first frequency {f1:.4f} Hz, closed form {closed_form:.4f} Hz")

figure, axes = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
for force in (0.02, 2.0):
    curve = mb.frequency_response(bracket, force=force * tip, frequency=(0.9 * f1, 1.15 * f1), harmonics=9)
    size = np.sqrt(np.sum(np.asarray(curve.X)[:, -1, 1:3] ** 2, axis=1))
    top = int(np.argmax(size))
    peak, at = size[top], curve.frequency[top]
    linear = np.abs(np.linalg.solve(read.K - (2 * np.pi * at) ** 2 * read.M + 2j * np.pi * at * C, force * tip))[-1]
    axes.plot(curve.frequency, 1e6 * size / force, label=f"{force:g} N, tip up to {1e6 * peak:.3g} um")
    print(
        f"{force:4.2f} N: peak {1e6 * peak:.2f} um at {at:.2f} Hz, without the stop {1e6 * linear:.2f} um there; {curve.status}"
    )
    if force < 1.0:
        small = abs(peak / linear - 1.0)
    else:
        higher = at / f1
print("below the gap as if there were no stop:", bool(small < 0.02))
print("above it the peak moves up:", bool(higher > 1.005))
axes.set(xlabel="f [Hz]", ylabel="tip over force [um/N]", title=f"Bracket with a stop behind a gap of {1e6 * gap:g} um")
axes.legend()
figure.savefig(folder / "bracket.png")
