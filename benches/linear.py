"""Every speed and size target of the linear analyses, measured, beside other programs where they are installed.

    python benches/linear.py [--write] [name ...]

CPU seconds of this process (one BLAS thread), the best of several repeats; ratios are of runs in this one process. A
row whose rival is not installed says "not run". ``--write`` puts the table into benches/README.md.
"""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mbrs as mb
import numpy as np
import rivals
from tables import Row, cpu, ms, one_thread, run, selected

BEGIN, END = "<!-- table begins -->", "<!-- table ends -->"
PROGRAMS = ("numpy", "scipy", "control", "exudyn", "pin")
# N m s/rad, in the middle of the random dampers that make the damping of a chain general.
DAMPER = 0.2


def _rival(work: Callable[[], Any]) -> Any:
    """None where the rival is not installed."""
    try:
        return work()
    except ImportError:
        return None


def _state_matrix(lin: Any) -> np.ndarray:
    n = lin.M.shape[0]
    c = np.zeros((n, n)) if lin.C is None else lin.C
    return np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(lin.M, lin.K), -np.linalg.solve(lin.M, c)]])


def import_time() -> list[Row]:
    """Wall time of `import mbrs` after `import numpy`, in fresh processes."""
    script = "import time, numpy; t = time.perf_counter(); import mbrs; print(time.perf_counter() - t)"
    times = [
        float(subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout)
        for _ in range(7)
    ]
    return [Row("`import mbrs` after `import numpy`", "at most 100 ms", ms(min(times)), min(times) <= 0.1)]


def hexapod() -> list[Row]:
    build = mb.examples.cubic_hexapod
    whole = cpu(lambda: mb.modes(build()))
    m = build()
    mb.modes(m)
    values = iter(np.linspace(0.9e5, 1.1e5, 1_000_000))

    def again() -> None:
        m.set({"k_leg": float(next(values))})
        mb.modes(m)

    changed = cpu(again)
    return [
        Row("hexapod: model built to modes", "at most 2 ms", ms(whole), whole <= 2e-3),
        Row("hexapod: modes after `m.set`", "at most 0.3 ms", ms(changed), changed <= 3e-4),
    ]


def chain_linearisation() -> list[Row]:
    rows = []
    for n in (10, 50, 200):
        m = rivals.mbrs_chain(n)
        ours = cpu(lambda m=m: mb.linearize(m))
        texts = []
        lin = mb.linearize(m)
        for name, make in (("Pinocchio", rivals.pinocchio_chain), ("Exudyn", rivals.exudyn_chain)):
            linearise = _rival(lambda make=make, n=n: make(n))
            if linearise is None:
                texts.append(f"{name} not run")
                continue
            theirs = cpu(linearise, repeats=3)
            gap = _difference(lin, linearise())
            texts.append(f"{name} {ms(theirs)} ({theirs / ours:.2g} x, frequencies differ by {gap:.0e})")
        target, reached = ("at most .9 ms", ours <= 0.9e-3) if n == 200 else ("", None)
        rows.append(Row(f"chain of {n} with bushings: linearise", target, ms(ours), reached, "; ".join(texts)))
    return rows


def _difference(lin: Any, theirs: Any) -> float:
    """Largest relative difference of the natural frequencies from M and K.

    The lower half comes from the eigenvalues of K^-1 M: those of M^-1 K lose it to rounding.
    """
    import scipy.linalg

    def frequencies(mass: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
        high = np.sort(np.sqrt(np.abs(scipy.linalg.eigvals(stiffness, mass).real)))
        low = np.sort(1 / np.sqrt(np.abs(scipy.linalg.eigvals(mass, stiffness).real)))
        half = high.size // 2
        return np.r_[low[:half], high[half:]]

    return float(np.max(np.abs(frequencies(*theirs[:2]) / frequencies(lin.M, lin.K) - 1)))


def chain_modes() -> list[Row]:
    """All modes with shapes against `scipy.linalg.eig` with vectors on the same state matrix."""
    import scipy.linalg

    lin = mb.linearize(rivals.mbrs_chain(200))
    rng = np.random.default_rng(1)
    free = rng.uniform(0.5, 2.0, 200) * DAMPER
    cases = (
        ("proportional", "at most 1/3", 1 / 3, (lin.M, lin.C, lin.K)),
        ("general damping", "at most 1", 1.0, (lin.M, np.diag(free), lin.K)),
    )
    rows = []
    for name, target, limit, matrices in cases:
        system = mb.MechanicalSystem(*matrices)
        a = _state_matrix(system)
        theirs = cpu(lambda a=a: scipy.linalg.eig(a), repeats=3)
        ours = cpu(lambda matrices=matrices: mb.modes(mb.MechanicalSystem(*matrices)), repeats=3)
        text = f"{ms(ours)}: ratio {ours / theirs:.2f} (route {mb.modes(system).stats.route})"
        rows.append(
            Row(
                f"chain of 200: all modes, {name}, over `scipy.linalg.eig`",
                target,
                text,
                ours <= limit * theirs,
                f"scipy {ms(theirs)}",
            )
        )
    return rows


def large_chains() -> list[Row]:
    """The 20 lowest modes of compiled chains; each run has a process of its own, so that its peak memory is its own."""
    rows = []
    for what, name in (("hinges", "lateral hinges"), ("row", "sliders"), ("beam", "bushings only")):
        runs = {n: _large(what, n) for n in (10_000, 100_000)}
        small, large = runs.values()
        if small is None:
            rows.append(Row(f"chain of 1e4, {name}: 20 lowest modes", "at most 2 s, right to 1e-8", "failed", False))
            continue
        text = f"{small['modes_s']:.3g} s, error {small['error']:.0e} (route {small['route']})"
        reached = small["modes_s"] <= 2.0 and small["error"] <= 1e-8
        rows.append(Row(f"chain of 1e4, {name}: 20 lowest modes", "at most 2 s, right to 1e-8", text, reached))
        target = "exponent below 1.2, at most 4 GB"
        if large is None:
            rows.append(Row(f"chain of 1e5, {name}", target, "failed", False))
            continue
        exponent = np.log10(large["modes_s"] / small["modes_s"])
        text = f"{exponent:.2f}, {large['peak_GB']:.2f} GB; {large['modes_s']:.3g} s, error {large['error']:.0e}"
        rows.append(Row(f"chain of 1e5, {name}", target, text, exponent < 1.2 and large["peak_GB"] <= 4.0))
    return rows


def _large(what: str, n: int) -> dict[str, Any] | None:
    script = Path(__file__).resolve().parent / "sparse.py"
    done = subprocess.run([sys.executable, script, "--one", what, str(n)], capture_output=True, text=True, check=False)
    return json.loads(done.stdout.splitlines()[-1]) if done.returncode == 0 else None


def transfer_functions() -> list[Row]:
    """150 degrees of freedom, 6 inputs, 6 outputs, 400 frequencies: a chain, and the same in coordinates that mix all of it."""
    n = 150
    rng = np.random.default_rng(2)
    stiffness = 1e4 * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    general = np.diag(rng.uniform(0.5, 2.0, n))
    return [
        _over_control("proportional damping", 1e-4 * stiffness, stiffness),
        _over_control("general damping, banded matrices", general, stiffness),
        _over_eigenvalues(general, stiffness, np.linalg.qr(rng.standard_normal((n, n)))[0]),
    ]


FREQUENCY = np.linspace(0.5, 35.0, 400)
PLACES = [0, 30, 60, 90, 120, 149]


def _transfer_function(damping: np.ndarray, stiffness: np.ndarray) -> Any:
    # a new system each time: one and the same keeps its modes
    system = mb.MechanicalSystem(np.eye(len(stiffness)), damping, stiffness)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        return mb.frf(system, inputs=PLACES, outputs=PLACES, frequency=FREQUENCY)


def _over_control(name: str, damping: np.ndarray, stiffness: np.ndarray) -> Row:
    n = len(stiffness)
    what, target = (
        f"300 states, 6 x 6 x 400 frequencies, {name}, over python-control",
        "50 times faster, equal to 1e-10",
    )
    mine = cpu(lambda: _transfer_function(damping, stiffness), repeats=5)
    control = _rival(lambda: __import__("control"))
    if control is None:
        return Row(what, target, ms(mine), None, "python-control not run")
    b, c = np.zeros((2 * n, 6)), np.zeros((6, 2 * n))
    for j, place in enumerate(PLACES):
        b[n + place, j] = c[j, place] = 1.0
    rival = control.ss(_state_matrix(mb.MechanicalSystem(np.eye(n), damping, stiffness)), b, c, 0)
    value = rival(2j * np.pi * FREQUENCY)
    theirs = cpu(lambda: rival(2j * np.pi * FREQUENCY), repeats=2)
    h = _transfer_function(damping, stiffness)
    gap = float(np.max(np.abs(h.value - value)) / np.max(np.abs(value)))
    text, beside = (
        f"{ms(mine)} (route {h.stats.route})",
        f"python-control {ms(theirs)}: {theirs / mine:.0f} x; differs by {gap:.0e}",
    )
    return Row(what, target, text, theirs >= 50 * mine and gap <= 1e-10, beside)


def _over_eigenvalues(damping: np.ndarray, stiffness: np.ndarray, mixed: np.ndarray) -> Row:
    import scipy.linalg

    C, K = mixed @ damping @ mixed.T, mixed @ stiffness @ mixed.T
    A = _state_matrix(mb.MechanicalSystem(np.eye(len(K)), C, K))
    mine = cpu(lambda: _transfer_function(C, K), repeats=5)
    theirs = cpu(lambda: scipy.linalg.eig(A), repeats=5)
    return Row(
        "300 states, 6 x 6 x 400 frequencies, general damping, dense matrices, over `scipy.linalg.eig` of the states",
        "at most 1.2",
        f"{ms(mine)}: ratio {mine / theirs:.2f} (route {_transfer_function(C, K).stats.route})",
        mine <= 1.2 * theirs,
        f"scipy {ms(theirs)}",
    )


def sensitivities() -> list[Row]:
    rows = []
    for name, share in (("proportional", 0.0), ("general damping", 0.5)):
        m = mb.examples.chain(100, along="x")
        if share:
            for i in range(1, 101, 2):
                m.set({f"F{i}.c[5]": 0.02})
        modes = mb.modes(mb.linearize(m))
        parameters = [f"F{i}.k[5]" for i in range(1, 31)]
        solve = cpu(lambda m=m: mb.modes(m), repeats=3)
        derive = cpu(lambda modes=modes, p=parameters: mb.sensitivity(modes, p).frequency, repeats=3)
        text = f"{ms(derive)}: ratio {derive / solve:.2f}"
        beside = f"eigen-solution {ms(solve)} ({modes.stats.route})"
        what = f"chain of 100, {name}: df/dp of all modes, 30 parameters, over one eigen-solution"
        rows.append(Row(what, "at most 1", text, derive <= solve, beside))
    return rows


def hanging() -> list[Row]:
    """Right or wrong, not fast or slow: the stiffness that constraint forces make."""
    m = mb.Model("rod", gravity=(0, -rivals.GRAVITY, 0))
    rod = m.body("rod", mass=1.0, inertia=(1 / 12, 1e-3, 1 / 12), at=(0, -0.5, 0))
    m.revolute("hinge", m.ground, rod, at=(0, 0, 0), axis="z")
    ours = mb.modes(m, at=mb.equilibrium(m)).frequency[0]
    texts = []
    for name, measured in (("Pinocchio", rivals.pinocchio_pendulum), ("Exudyn", rivals.exudyn_pendulum)):
        value = _rival(measured)
        texts.append(f"{name} not run" if value is None else f"{name} {value:.6f} Hz")
    right = f"{ours:.6f}" == "0.610521"
    return [Row("hanging rod at its equilibrium", "0.610521 Hz", f"{ours:.6f} Hz", right, "; ".join(texts))]


MEASUREMENTS: dict[str, Callable[[], list[Row]]] = {
    "import": import_time,
    "hexapod": hexapod,
    "linearise": chain_linearisation,
    "modes": chain_modes,
    "large": large_chains,
    "frf": transfer_functions,
    "sensitivity": sensitivities,
    "hanging": hanging,
}


def main(arguments: list[str]) -> None:
    run(selected(MEASUREMENTS, arguments), arguments, BEGIN, END, PROGRAMS)


if __name__ == "__main__":
    one_thread()
    main(sys.argv[1:])
