"""Sweeps of named outputs: CPU time of a design on one thread, wall time and memory of many on two, overhead, resume.

    python benches/designs.py [number of designs]

The model is the cubic hexapod with modes and six sensitivities; beside it the same outputs by a Python function, which every design
passes through Python for. Ratios are of one run. With 1000000 designs this is the whole of it, some minutes.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mbrs as mb

BY = ["k_leg", "c_leg", "payload.mass", "payload.com[2]", "leg0.at_b[2]", "leg3.k"]
SET = {"k_leg": (0.8e5, 1.2e5), "payload.mass": (15.0, 25.0), "payload.com[2]": (-0.02, 0.02)}
# CPU seconds of a design of which the overhead is measured.
SPIN = 0.01


def ten_milliseconds(model: Any) -> dict[str, float]:
    """A design that is known to take its time."""
    end = time.thread_time() + SPIN
    while time.thread_time() < end:
        pass
    return {"mass": 1.0}


def cost(function: Callable[..., Any], rows: int) -> tuple[float, float]:
    """CPU and wall seconds of each of so many designs."""
    begin, wall = time.process_time(), time.perf_counter()
    function()
    return (time.process_time() - begin) / rows, (time.perf_counter() - wall) / rows


def main() -> None:
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    few = min(n, 2000)
    warnings.simplefilter("ignore")
    m = mb.examples.cubic_hexapod()
    payload = m["payload"]
    ports = (payload.force("z"), payload.motion("z"), [float(f) for f in range(5, 55)])
    kinds = {
        "6 modes and 6 sensitivities": mb.outputs.modes(n=6, sensitivities=BY),
        "50 frequencies of a transfer function and 6 sensitivities": mb.outputs.frf(*ports, sensitivities=BY),
        "rest places and 6 sensitivities": mb.outputs.equilibrium(BY),
    }
    designs = mb.design.latin_hypercube(SET, n, seed=1)
    for what, outputs in kinds.items():
        some = designs.part(range(few))
        python = designs.part(range(min(n, 100)))
        fast = min(cost(lambda: mb.sweep(m, some, outputs), few)[0] for _ in range(3))  # noqa: B023
        slow = min(cost(lambda: mb.sweep(m, python, lambda model: outputs(model)), len(python))[0] for _ in range(2))  # noqa: B023
        print(
            f"{what}, one thread: {1e3 * fast:.4f} ms, by Python {1e3 * slow:.4f} ms, ratio {slow / fast:.1f}",
            flush=True,
        )

    some = designs.part(range(min(n, 200)))
    took = min(cost(lambda: mb.sweep(m, some, ten_milliseconds), len(some))[0] for _ in range(3))
    print(f"overhead of a design of {1e3 * SPIN:g} ms: {100 * (took / SPIN - 1):.2f} %")

    outputs = kinds["6 modes and 6 sensitivities"]
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "runs"
        two, wall = cost(lambda: mb.sweep(m, designs, outputs, executor=2, store=store), n)
        print(f"{n} designs on two threads with a store: {n * wall:.1f} s, {1e3 * two:.4f} ms of CPU each", flush=True)
        wall = cost(lambda: mb.sweep(m, designs, outputs, executor=2, store=store), 1)[1]
        print(f"resume of {n}: {wall:.2f} s")
    print(f"largest resident memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB")


if __name__ == "__main__":
    main()
