"""Many designs of the isolator: samples, sweeps and their results."""

import sys
import tempfile
from pathlib import Path

import mbrs as mb

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
m = mb.examples.cubic_hexapod()

designs = mb.design.latin_hypercube({"k_leg": (5e4, 2e5), "c_leg": (10, 200)}, n=200, seed=1)   # also sobol, halton, full_factorial, normal, from_table
def outputs(m):                                                # any function of a model: numbers and arrays by name
    modes = mb.modes(m)
    return {"f": modes.frequency, "zeta": modes.damping}
runs = mb.sweep(m, designs, outputs, executor=None, store=folder / "runs", on_error="record")   # store: a folder; the same call again goes on where it was
fast = mb.sweep(m, designs, mb.outputs.modes(n=6, sensitivities=["k_leg"]))            # named analyses; also frf, equilibrium
runs.to_xarray(); runs.to_frame(); runs.failures; runs.plot("k_leg", "f[0]").savefig(folder / "designs-scatter.png")
runs.plot().savefig(folder / "designs-correlation.png")
modes = mb.modes(m)
best = mb.problem(m, mb.Match(modes, frequency=12.0, shape=modes.shape[:, 0]), parameters=["k_leg"], bounds={"k_leg": (1e4, 1e6)}).solve()   # objectives on modes and transfer functions as well

print(runs, best, sep="\n\n")
print("the named outputs agree:", bool(abs(fast["frequency"] - runs["f"]).max() < 1e-9))
