"""Sweeps of named outputs: CPU time of a design on one thread, and wall time of many on two.

    python benches/designs.py [number of designs]

The model is the cubic hexapod with modes and six sensitivities; beside it the same outputs by a Python function, which every design
passes through Python for. Ratios are of one run.
"""

from __future__ import annotations

import sys
import time
import warnings

import mbrs as mb

BY = ["k_leg", "c_leg", "payload.mass", "payload.com[2]", "leg0.at_b[2]", "leg3.k"]
SET = {"k_leg": (0.8e5, 1.2e5), "payload.mass": (15.0, 25.0), "payload.com[2]": (-0.02, 0.02)}


def addresses(m: mb.Model, wanted: list[str]) -> list[str]:
    """Those of the wanted addresses that the model has, and numbers of its legs to make six."""
    found = []
    for name in [*wanted, *(f"leg{i}.at_b[{k}]" for i in range(6) for k in range(3))]:
        try:
            m.value(name)
        except mb.MbrsError:
            continue
        found.append(name)
    return found[:6]


def main() -> None:
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    warnings.simplefilter("ignore")
    m = mb.examples.cubic_hexapod()
    outputs = mb.outputs.modes(n=6, sensitivities=addresses(m, BY))
    known = {name: span for name, span in SET.items() if name in addresses(m, list(SET))}
    designs = mb.design.latin_hypercube(known, n, seed=1)

    def cpu(function: object, rows: int, **options: object) -> tuple[float, float]:
        begin, wall = time.process_time(), time.perf_counter()
        runs = mb.sweep(m, designs.part(range(rows)), function, **options)
        assert runs.done.all()
        return (time.process_time() - begin) / rows, (time.perf_counter() - wall) / rows

    slow = min(cpu(lambda model: outputs(model), min(n, 200))[0] for _ in range(3))
    fast = min(cpu(outputs, n)[0] for _ in range(3))
    two = min(cpu(outputs, n, executor=2)[1] for _ in range(3))
    what = f"6 modes and {len(outputs.parameters)} sensitivities of a design, one thread"
    print(f"{what}: {1e3 * fast:.4f} ms, by Python {1e3 * slow:.4f} ms, ratio {slow / fast:.2f}")
    print(f"two threads: {1e3 * two:.4f} ms of wall time a design, 1e6 designs in {1e6 * two:.0f} s")


if __name__ == "__main__":
    main()
