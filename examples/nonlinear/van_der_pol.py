"""Limit cycles of van der Pol's oscillator, from almost a sine to a relaxation oscillation.

python examples/nonlinear/van_der_pol.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
from mbrs.examples import error_table

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
folder.mkdir(parents=True, exist_ok=True)
rows = []
for mu, known, given in (
    (1.0, 6.66328686, dict(harmonics=31)),
    (5.0, 11.61223067, dict(harmonics=127)),
    (20.0, 34.68232331, dict(method="collocation", harmonics=63)),
):
    cycle = mb.limit_cycle(mb.examples.van_der_pol(mu), **given)
    print(f"{cycle}\n")
    cycle.plot_orbit().savefig(folder / f"van-der-pol-{mu:g}.png")
    rows.append((f"period, mu = {mu:g}, {cycle.stats.route}", cycle.period, known, "docs/theory.md (23.10)"))
    if mu == 1.0:
        cycle.plot().savefig(folder / "van-der-pol-harmonics.png")
        cycle.plot_multipliers().savefig(folder / "van-der-pol-multipliers.png")

# Fifteen harmonics do not hold a relaxation oscillation, and the result's error estimate shows it.
poor = mb.limit_cycle(mb.examples.van_der_pol(20.0), harmonics=15)
print(f"{poor}\nits period is wrong by {abs(poor.period / 34.68232331 - 1):.0%}")
print(error_table(rows))
print(f"pictures in {folder}")
