"""A measured universal file beside a model, and the model updated: legs of a hexapod from noisy transfer functions."""

import sys
import tempfile
import warnings
from pathlib import Path

import mbrs as mb
import numpy as np

warnings.simplefilter("ignore", mb.MbrsWarning)  # resonances between measured frequencies
folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())


def hexapod():
    m = mb.Model("hexapod")
    p = m.body("payload", mass=18.7, inertia=(0.16, 0.19, 0.13), at=(0.013, -0.007, 0.108))
    for i, (a, b) in enumerate(mb.examples.cubic_hexapod_points(edge=0.21, centre=(0.01, 0.0, 0.1))):
        k, c = m.parameter(f"k{i}", 1e5, unit="N/m"), m.parameter(f"c{i}", 60.0, unit="N s/m")
        m.spring_damper(f"leg{i}", m.ground, p, at=(a, b), k=k, c=c)
    for i, at in enumerate(((0.1, 0.02, 0.15), (-0.06, 0.08, 0.13))):
        m.marker(f"s{i}", p, at=at)
    return m


names = [f"{letter}{i}" for i in range(6) for letter in "kc"]
rng = np.random.default_rng(8)

# in place of the test: legs that differ by a tenth, and 2 % of noise
real = hexapod()
truth = np.array([real.value(n) for n in names]) * (1.0 + 0.1 * rng.standard_normal(12))
real.set(dict(zip(names, truth.tolist(), strict=True)))
outputs = [f"s{i}.motion.{axis}" for i in range(2) for axis in "xyz"]
h = mb.frf(real, ["s0.force.z", "s1.force.y"], outputs, frequency=np.linspace(5.0, 60.0, 111), kind="accelerance")
noise = rng.standard_normal(h.value.shape) + 1j * rng.standard_normal(h.value.shape)
h.replaced(value=h.value + 0.02 * np.abs(h.value).mean(axis=2, keepdims=True) * noise).save(folder / "measured.uff")

m = hexapod()
test = mb.load(folder / "measured.uff")
before = mb.correlate(m, test)
fit = mb.update(m, test, names)
after = mb.correlate(m, test)
print(fit)
print(f"FRAC from {before.frac.min():.3f} to {after.frac.min():.3f}")
low, high = fit.interval(0.9999).T
print("all twelve within their intervals:", bool(np.all((low < truth) & (truth < high))))
fit.report(folder / "update.html", "Legs of the hexapod")
test.plot(against=after.computed).savefig(folder / "update.png")
