"""Twenty lowest modes of long chains: times, growth, memory, and the error against closed forms. Needs a release core.

Run: python benches/sparse.py [n ...]; each size runs in a process of its own, so that its peak memory is its own.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time

import hinges
import mbrs as mb
import numpy as np
from mbrs.system.compiled import compiled

COUNT = 20


def row(n: int) -> tuple[mb.Model, np.ndarray]:
    """Masses on sliding joints with springs, fixed-free: omega_j = 2 sqrt(k/m) sin((2j - 1) pi/(2 (2n + 1)))."""
    m, k = mb.Model("row"), 1e4
    last = m.ground
    for i in range(n):
        body = m.body(f"b{i}", mass=2.0, inertia=(1, 1, 1), at=(i + 1.0, 0, 0))
        m.prismatic(f"j{i}", last, body, at=(i + 1.0, 0, 0), axis="x", k=k)
        last = body
    return m, 2 * np.sqrt(k / 2.0) * np.sin((2 * np.arange(1, COUNT + 1) - 1) * np.pi / (2 * (2 * n + 1)))


def beam(n: int) -> tuple[mb.Model, np.ndarray]:
    """Bodies on bushings, pinned by half cells: a lattice whose waves are exact, see tests/linear/test_sparse_models.py."""
    ks, kr, h, mass, inertia = 1e6, 1e2, 0.2, 1.0, 1e-2
    m = mb.Model("beam")
    bodies = [m.body(f"b{i}", mass=mass, inertia=(inertia,) * 3, at=(i * h, 0, 0)) for i in range(n)]
    stiff = (ks, ks, ks, kr, kr, kr)
    for i in range(n - 1):
        m.bushing(f"e{i}", bodies[i], bodies[i + 1], at=((i + 0.5) * h, 0, 0), k=stiff)
    pin = (2 * ks, 2 * ks, 2 * ks, 0, 0, 0)
    m.bushing("left", m.ground, bodies[0], at=(-h / 2, 0, 0), k=pin)
    m.bushing("right", bodies[-1], m.ground, at=((n - 0.5) * h, 0, 0), k=pin)
    s, c = (f(np.arange(1, COUNT + 1) * np.pi / n / 2) for f in (np.sin, np.cos))
    a, d = 4 * ks * s**2 / mass, (ks * h**2 * c**2 + 4 * kr * s**2) / inertia
    high = (a + d) / 2 + np.sqrt(((a - d) / 2) ** 2 + (2 * ks * s * h * c) ** 2 / (mass * inertia))
    bending = np.repeat(np.sqrt(16 * ks * kr * s**4 / (mass * inertia) / high), 2)
    along = 2 * np.sqrt(ks / mass) * np.sin(np.arange(1, COUNT + 1) * np.pi / (2 * n))
    twist = 2 * np.sqrt(kr / inertia) * np.sin(np.arange(COUNT) * np.pi / (2 * n))
    return m, np.sort(np.r_[bending, along, twist])[:COUNT]


def hinged(n: int) -> tuple[mb.Model, None]:
    """Rods on lateral hinges with rotational springs; the yardstick is found beside each frequency, see hinges.py."""
    return mb.examples.chain(n, along="x", c=None), None


def error_of(omega: np.ndarray, expected: np.ndarray | None, n: int) -> float:
    """Largest relative error; of hinged chains that of the first, the tenth and the last mode."""
    if expected is None:
        omega = omega[[0, 9, 19]]
        expected = np.array([hinges.refined(n, float(w), 1.0, 5e-3, 0.2, 60.0) for w in omega])
    kept = expected > 0
    return float(np.max(np.abs(omega[kept] / expected[kept] - 1)))


def measure(what: str, n: int) -> dict[str, float | str]:
    start = time.perf_counter()
    m, expected = {"row": row, "beam": beam, "hinges": hinged}[what](n)
    built = time.perf_counter()
    compiled(m)
    compiled_at = time.perf_counter()
    cpu = time.process_time()
    found = mb.modes(m, n=COUNT)
    cpu = time.process_time() - cpu
    done = time.perf_counter()
    return {
        "chain": what,
        "n": n,
        "build_s": built - start,
        "compile_s": compiled_at - built,
        "modes_s": done - compiled_at,
        "modes_cpu_s": cpu,
        "peak_GB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "error": error_of(found.omega, expected, n),
        "estimate": float(found.error.max()),
        "route": found.stats.route,
    }


def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(measure(sys.argv[2], int(sys.argv[3]))))
        return
    sizes = [int(a) for a in sys.argv[1:]] or [1_000, 10_000, 100_000]
    for what in ("hinges", "row", "beam"):
        times = []
        for n in sizes:
            out = subprocess.run(
                [sys.executable, __file__, "--one", what, str(n)], capture_output=True, text=True, check=True
            )
            r = json.loads(out.stdout)
            times.append(r["modes_s"])
            print(r, flush=True)
        if len(sizes) > 1:
            slope = np.polyfit(np.log(sizes[-2:]), np.log(times[-2:]), 1)[0]
            print(f"{what}: growth exponent between the last two sizes {slope:.2f}", flush=True)


if __name__ == "__main__":
    main()
