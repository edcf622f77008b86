"""Gradients of motions: cost of direct and adjoint over the number of parameters, error against time, memory of checkpoints.

    python benches/gradients.py            # tables; a minute
    python benches/gradients.py --plot docs/img/accuracy-gradients.png

Times are medians of runs in one process; the reference of the errors is the gradient of METHODS.md e.3 (five-bar, T = 2 s).
"""

from __future__ import annotations

import argparse
import statistics
import time
import warnings

import mbrs as mb
import numpy as np

PSI_2, GRADIENT_2 = 0.2384041958, np.array([-1.33084740, 0.99780747])
R0 = np.array([0.5, -2.0, 0.0])


def drift(s):
    return np.sum((s.point("P2") - R0) ** 2)


def timed(f, repeat: int = 5) -> float:
    """Median seconds."""
    f()
    out = []
    for _ in range(repeat):
        start = time.perf_counter()
        f()
        out.append(time.perf_counter() - start)
    return statistics.median(out)


def lengths(n: int):
    """A double pendulum row whose n springs are n parameters. Data invented."""
    m = mb.Model("springs", gravity=(0, -9.81, 0))
    last = m.ground
    for i in range(4):
        b = m.body(f"b{i}", mass=1.0, inertia=(0.02, 0.02, 0.02), at=(i + 0.5, 0, 0))
        m.revolute(f"J{i}", last, b, at=(i, 0, 0), axis="z", c=0.1)
        last = b
    names = []
    for i in range(n):
        m.spring_damper(
            f"s{i}", m.ground, m.bodies[i % 4], at=((i % 7, 2.0, 0), (i % 4 + 0.5, 0, 0)), k=20.0 / n, c=0.0
        )
        names.append(f"s{i}.k")
    return m, names


def cost() -> None:
    """Seconds over those of one primal simulation (the same scheme and steps, no derivatives)."""
    print(
        f"{'n_p':>5} {'primal s':>9} {'direct':>8} {'adjoint':>8}   (over the primal; wanted: direct 1 + .3 n_p, adjoint 4)"
    )
    for n in (1, 2, 4, 8, 16, 64, 256, 1000):
        primal, direct, adjoint = row(n)
        print(f"{n:5d} {primal:9.4f} {direct / primal:8.2f} {adjoint / primal:8.2f}")


def row(n: int) -> tuple[float, float, float]:
    """Seconds of the motion, of the direct and of the adjoint gradient by n parameters."""
    m, names = lengths(n)
    psi = mb.Final(lambda s: s.position("b3")[1])
    options = {"t": 0.5, "step": 5e-3}
    primal = timed(lambda: mb.simulate(m, method="ali3p", **options), 3)
    adjoint = timed(lambda: mb.gradient(m, psi, names, method="adjoint", **options), 3)
    direct = timed(lambda: mb.gradient(m, psi, names, method="direct", **options), 3) if n <= 64 else float("nan")
    return primal, direct, adjoint


def curves() -> dict[str, np.ndarray]:
    """Relative error of the gradient and seconds: direct and adjoint over the step, forward differences over their own step."""
    names, out = ["spring1.length", "spring2.length"], {}
    m = mb.examples.five_bar()
    psi = mb.Integral(drift)

    def error(g) -> float:
        return float(np.abs(np.asarray(g) - GRADIENT_2).max() / np.abs(GRADIENT_2).max())

    for method in ("direct", "adjoint"):
        rows = []
        for h in (2e-2, 1e-2, 5e-3, 2.5e-3, 1.25e-3):
            found = mb.gradient(m, psi, names, t=2.0, step=h, method=method)
            rows.append((h, found.stats.wall_time, error(found.gradient)))
        out[method] = np.array(rows)
    rows = []
    exact = mb.gradient(m, psi, names, t=2.0, step=5e-3, method="direct").gradient
    base = [m.value(p) for p in names]
    for e in 10.0 ** -np.arange(1, 13):
        start = time.perf_counter()
        values = [mb.gradient(m, psi, names, t=2.0, step=5e-3, method="adjoint").value]
        for p, v in zip(names, base, strict=True):
            m.set({p: v + e})
            values.append(mb.gradient(m, psi, names, t=2.0, step=5e-3, method="adjoint").value)
            m.set({p: v})
        g = (np.array(values[1:]) - values[0]) / e
        rows.append((e, time.perf_counter() - start, float(np.abs(g - exact).max() / np.abs(exact).max())))
    out["forward differences (error against the exact gradient of the same steps)"] = np.array(rows)
    for name, table in out.items():
        print(name)
        for h, seconds, e in table:
            print(f"  {h:8.1e} {seconds:8.3f} s   error {e:.1e}")
    return out


def memory() -> None:
    """Numbers kept by the adjoint on 1e5 steps."""
    m, names = lengths(2)
    psi = mb.Final(lambda s: s.position("b3")[1])
    import resource

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    found = mb.gradient(m, psi, names, t=10.0, step=1e-4, method="adjoint", keep=0)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    counts = found.stats.counts
    print(
        f"1e5 steps: {counts['checkpoints']} checkpoints, {counts['steps']} steps forwards, peak memory +{(after - before) / 1024:.0f} MB, "
        f"{time.perf_counter() - start:.1f} s"
    )


def main() -> None:
    """Run everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plot")
    parser.add_argument("--memory", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    if given.memory:
        memory()
        return
    cost()
    found = curves()
    if given.plot:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8, 4.5), layout="constrained")
        ax = figure.add_subplot()
        for name, table in found.items():
            ax.loglog(table[:, 0], table[:, 2], "o-", label=name)
        ax.set(xlabel="step [s], or step of the differences [m]", ylabel="relative error of the gradient")
        ax.legend()
        figure.savefig(given.plot, dpi=120)


if __name__ == "__main__":
    main()
