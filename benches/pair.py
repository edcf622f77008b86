"""CPU time of linear and nonlinear calls of two trees in turn (one, other, one, other, ...), so that both see the same machine.

    python benches/pair.py OLD NEW [name ...]

A tree is a worktree with a release core. Each round is a fresh process of each; a row shows the least of all rounds and both ratios.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

ROUNDS = 5
HERE = Path(__file__).resolve().parent


def cpu(work: Callable[[], Any], least: float = 0.1) -> float:
    """CPU seconds of one call, the best of five means."""
    work()
    begin = time.process_time()
    work()
    loops = max(1, int(least / max(time.process_time() - begin, 1e-9)))
    best = float("inf")
    for _ in range(5):
        begin = time.process_time()
        for _ in range(loops):
            work()
        best = min(best, (time.process_time() - begin) / loops)
    return best


def cases() -> Iterator[tuple[str, Callable[[], Any]]]:
    import mbrs as mb
    import numpy as np
    import rivals

    build = mb.examples.cubic_hexapod
    yield "hexapod built, modes", lambda: mb.modes(build())
    m = build()
    values = iter(np.linspace(0.9e5, 1.1e5, 10_000_000))

    def again() -> None:
        m.set({"k_leg": float(next(values))})
        mb.modes(m)

    yield "hexapod set, modes", again
    for n in (10, 200):
        chain = rivals.mbrs_chain(n)
        yield f"chain {n}, linearise", lambda chain=chain: mb.linearize(chain)
    lin = mb.linearize(rivals.mbrs_chain(200))
    yield "chain 200, modes", lambda: mb.modes(lin)
    import rivals_nonlinear as nonlinear

    duffing = mb.MechanicalSystem([[1.0]], [[nonlinear.C]], [[1.0]], elements=[mb.Cubic(nonlinear.K3, w=[1.0])])
    span = (nonlinear.W0, nonlinear.W1)
    yield "Duffing curve", lambda: mb.frequency_response(duffing, force=[nonlinear.F], omega=span, harmonics=7)


def measure(names: list[str]) -> dict[str, float]:
    warnings.simplefilter("ignore")
    return {name: cpu(work) for name, work in cases() if not names or any(n in name for n in names)}


def main() -> None:
    old, new, *names = sys.argv[1:]
    found: dict[str, dict[str, list[float]]] = {}
    for _ in range(ROUNDS):
        for tree in (old, new):
            environment = {
                **os.environ,
                "PYTHONPATH": f"{Path(tree).resolve() / 'python'}:{HERE}",
                "OPENBLAS_NUM_THREADS": "1",
            }
            script = f"import json, pair; print(json.dumps(pair.measure({names!r})))"
            done = subprocess.run(
                [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
            )
            for name, seconds in json.loads(done.stdout.splitlines()[-1]).items():
                found.setdefault(name, {}).setdefault(tree, []).append(seconds)
    for name, times in found.items():
        (a, b), middle = (times[old], times[new]), len(times[old]) // 2
        ratio, least = sorted(b)[middle] / sorted(a)[middle], min(b) / min(a)
        print(
            f"{name:24} old {1e3 * min(a):9.4f} ms   new {1e3 * min(b):9.4f} ms   ratio {least:.2f} (medians {ratio:.2f})"
        )


if __name__ == "__main__":
    main()
