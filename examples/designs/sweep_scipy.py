"""A search of SciPy over an isolator that goes on where it was: legs for a first mode at 12 Hz with 5 % of damping.

Run it twice with the same folder: the second time every design is looked up.
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from scipy.optimize import differential_evolution

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
bounds = {"k_leg": (2e4, 2e5), "c_leg": (10.0, 200.0)}

m = mb.examples.cubic_hexapod()


def known():
    """All designs so far; there are none in the table, the search proposes them."""
    return mb.sweep(
        m, mb.design.from_table({name: [] for name in bounds}), mb.outputs.modes(n=1), store=folder / "search"
    )


runs = known()


def miss(x):
    """Distance of the first mode from 12 Hz and 5 % of damping, both relative."""
    found = runs.evaluate(x)
    return float((found["frequency[0]"][0] / 12.0 - 1.0) ** 2 + (found["damping[0]"][0] / 0.05 - 1.0) ** 2)


best = differential_evolution(
    miss, list(bounds.values()), popsize=6, maxiter=12, rng=np.random.default_rng(1), polish=False
)
print(f"k_leg {best.x[0]:.0f} N/m, c_leg {best.x[1]:.1f} N s/m: distance {best.fun:.1e} after {len(known())} designs")
# sqrt(2 k / m) of the cube with a payload of 20 kg
print("first mode within 5 % of 12 Hz:", bool(abs(np.sqrt(2 * best.x[0] / 20.0) / (2 * np.pi) / 12.0 - 1.0) < 0.05))
