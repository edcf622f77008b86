"""Stiffness and damping of a four-bar's mount found in a noisy record of one of its points: least squares, exact Jacobian.

The record is simulated with known numbers plus normal noise of 5 mm (seed 1), so that the answer can be judged. Invented data.

python examples/gradients/four_bar_identification.py [folder for the pictures]
"""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.plot.figure import figure, style
from scipy.optimize import least_squares

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp(prefix="mbrs-"))
NAMES = ["mount.k[0]", "mount.k[1]", "mount.c[0]", "mount.c[1]"]
TRUTH, GUESS = np.array([60.0, 40.0, 1.5, 1.0]), np.array([30.0, 80.0, 3.0, 0.5])
NOISE, END, STEP = 5e-3, 4.0, 2e-2

m = mb.examples.four_bar()  # spatial hinges, three redundant constraints: they cost nothing here
m.set({"mount.k": [*TRUTH[:2], 0, 0, 0, 0], "mount.c": [*TRUTH[2:], 0, 0, 0, 0], "motor.value[2]": 20.0})


def run(p):
    """Steps, the path of the point P2 there (n_t, 2), and its exact derivatives by the numbers p (n_t, 2, 4)."""
    m.set(dict(zip(NAMES, p.tolist(), strict=True)))
    traj = mb.simulate(m, t=END, step=STEP, method="ali3p", parameters=NAMES)
    return traj.t, traj.point("P2")[:, :2], np.asarray(traj.sensitivity("P2"))[:, :2]


t, path, _ = run(TRUTH)
record = path + NOISE * np.random.default_rng(1).normal(size=path.shape)
history = []


def misfit(z):
    """Distances from the record over the noise; z are the numbers over their guesses, which makes them of one size."""
    r = ((run(z * GUESS)[1] - record) / NOISE).ravel()
    history.append((z * GUESS, float(r @ r)))
    return r


def slope(z):
    return (run(z * GUESS)[2] * GUESS / NOISE).reshape(-1, len(GUESS))


found = least_squares(misfit, np.ones(4), jac=slope, xtol=1e-12, bounds=(0.01, 100.0))
best = found.x * GUESS
error = GUESS * np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))  # standard errors at the solution
print(
    f"four numbers from {len(t)} points after {found.nfev} runs; sum of squares {2 * found.cost:.0f}, "
    f"expected {found.fun.size - 4} +- {np.sqrt(2 * found.fun.size):.0f}"
)
print("number        guess   truth     found  standard error  off by")
for row in zip(NAMES, GUESS, TRUTH, best, error, (best - TRUTH) / error, strict=True):
    print("{:11s} {:7g} {:7g} {:9.4f} {:15.4f} {:5.1f} standard errors".format(*row))

# The same as an optimisation: a sum over given times and its gradient, for any optimiser; one run back gives all derivatives.
sum_of_squares = mb.AtTimes(t, lambda s: np.sum((s.point("P2")[:2] - record[s.index]) ** 2) / NOISE**2 / len(t))
m.set(dict(zip(NAMES, GUESS.tolist(), strict=True)))
problem = mb.problem(
    m, sum_of_squares, NAMES, t=END, step=STEP, method="adjoint", bounds={n: (0.1, 500.0) for n in NAMES}
)
again = problem.solve("SLSQP", options={"ftol": 1e-10})
print(
    f"mb.problem: {again.status} after {len(again.history)} runs, {np.abs((again.x - best) / error).max():.1e} standard errors away"
)

with style():
    picture, (left, right) = figure(1, 2, size=(10.0, 4.2))
    left.plot(t, 1e3 * record[:, 0], ".", ms=4, color="#6b7280", label="record")
    for label, p in (("guess", GUESS), ("found", best)):
        left.plot(t, 1e3 * run(p)[1][:, 0], label=label)
    left.set(xlabel="t [s]", ylabel="x of P2 [mm]", title="record and model")
    left.legend()
    for k, name in enumerate(NAMES):
        off = [abs(p[k] / TRUTH[k] - 1) for p, _ in history]
        right.semilogy(range(1, len(off) + 1), off, "o-", ms=4, label=name)
    right.set(xlabel="run", ylabel="relative distance from the truth", title="convergence")
    right.legend()
picture.savefig(folder / "four-bar-identification.png")
print(f"pictures in {folder}")
