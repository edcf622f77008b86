"""An oscillator with a spring and slider: stuck under a small force, damped by slipping, almost free under a large one.

All data are invented. python examples/nonlinear/jenkins.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.examples import error_table
from mbrs.plot.figure import figure, style

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
folder.mkdir(parents=True, exist_ok=True)
k, f_slip, c = 0.5, 0.2, 0.02
system = mb.examples.jenkins_oscillator(k, f_slip, c)
odd = range(1, 32, 2)
with style():
    picture, axes = figure()
    for level in (0.005, 0.05, 0.1, 0.2, 0.4):
        curve = mb.frequency_response(system, force=[level], omega=(0.6, 1.6), harmonics=list(odd))
        axes.plot(curve.frequency, curve.amplitude() / level, label=f"{level:g}")
        print(f"force {level:5g}: largest amplitude / force {np.max(curve.amplitude() / level):7.3f}, {curve.status}")
    axes.set(xlabel="f [Hz]", ylabel="harmonic 1 / force")
    axes.legend(title="force")
picture.savefig(folder / "jenkins-curves.png")

# Stuck the element is the spring k; in the limit of large amplitudes its harmonic 1 of the force is 4 f_slip / pi.
rows = []
stuck = mb.harmonic_balance(system, force=[0.005], omega=1.1, harmonics=list(odd))
rows.append(("stuck, |a1|", stuck.amplitude(), abs(0.005 / (1 + k - 1.1**2 + 1.1j * c)), "linear"))


def describing(a: float) -> complex:
    """Harmonic 1 of the Jenkins force over the amplitude a of u = a cos(tau), for a > f_slip / k: closed form of the
    hysteresis loop (e.g. Menq, Bielak and Griffin, J. Sound Vib. 107 (1986))."""
    theta = np.arccos(1 - 2 * f_slip / (k * a))
    return k / np.pi * (theta - 0.5 * np.sin(2 * theta)) + 4j * f_slip / (np.pi * a) * (1 - f_slip / (k * a))


for level in (0.2, 0.4):
    one = mb.harmonic_balance(system, force=[level], omega=1.1, harmonics=1, n_samples=2**13)
    a = one.amplitude()
    residual = abs((1 - 1.1**2 + 1.1j * c + describing(a)) * a)
    rows.append((f"force {level}, one harmonic: |Z a1|", residual, level, "closed form of the loop"))

# Integration in time from the solution's own state; the slider's place comes from two periods of its motion.
for level in (0.1, 0.2, 0.4):
    one = mb.harmonic_balance(system, force=[level], omega=1.1, harmonics=list(odd), n_samples=4096)
    source = f"integration in time; estimate {one.error:.0e}"
    rows.append((f"force {level}, 16 harmonics: distance in a period", one.verify(), 0.0, source))
print(error_table(rows))
print(f"pictures in {folder}")
