"""Sweeps of named outputs: CPU time of a design on one thread, wall time and memory of many on two, overhead, resume.

    python benches/designs.py [number of designs] [--write]

The model is the cubic hexapod with modes and six sensitivities; beside it the same outputs by a Python function, which every design
passes through Python for. Ratios are of one run. With 1000000 designs this is the whole of it, a minute; ``--write`` puts
the table into benches/README.md.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import mbrs as mb
from tables import Row, circumstances, ms, table, write

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


def memory() -> float:
    """The largest resident memory so far, GB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def one_design(m: Any, kinds: dict[str, Any], designs: Any) -> Iterator[Row]:
    """CPU time of a design on one thread beside the same outputs by a Python function."""
    few, python = designs.part(range(min(len(designs), 2000))), designs.part(range(min(len(designs), 100)))
    for what, outputs in kinds.items():
        fast = min(cost(lambda: mb.sweep(m, few, outputs), len(few))[0] for _ in range(3))  # noqa: B023
        slow = min(cost(lambda: mb.sweep(m, python, lambda model: outputs(model)), len(python))[0] for _ in range(2))  # noqa: B023
        goal = 0.14e-3 if what.startswith("6 modes") else None
        yield Row(
            f"a hexapod design: {what}, one thread",
            "at most 0.14 ms" if goal else "",
            ms(fast),
            None if goal is None else fast <= goal,
            f"by a Python function {ms(slow)}, {slow / fast:.1f} times",
        )


def overhead(m: Any, designs: Any) -> Row:
    some = designs.part(range(min(len(designs), 200)))
    took = min(cost(lambda: mb.sweep(m, some, ten_milliseconds), len(some))[0] for _ in range(3))
    share = 100 * (took / SPIN - 1)
    return Row(f"overhead of a design of {1e3 * SPIN:g} ms", "at most 3 %", f"{share:.2f} %", share <= 3)


def many(m: Any, outputs: Any, designs: Any) -> Iterator[Row]:
    """All of them on two threads with a store, and again from the store."""
    n = len(designs)
    whole = n == 1_000_000
    with tempfile.TemporaryDirectory() as folder:
        sweep = partial(mb.sweep, m, designs, outputs, executor=2, store=Path(folder) / "runs")
        each, wall = cost(sweep, n)
        seconds, largest = n * wall, memory()
        again = cost(sweep, 1)[1]
    what = f"{n} designs, modes and sensitivities, two threads with a store"
    yield Row(
        what,
        "at most 150 s" if whole else "",
        f"{seconds:.1f} s, {ms(each)} of CPU each",
        seconds <= 150 if whole else None,
    )
    yield Row(
        f"{n} designs: largest resident memory",
        "below 1 GB" if whole else "",
        f"{largest:.2f} GB",
        largest < 1 if whole else None,
    )
    yield Row(
        f"{n} designs: resume of a store that is complete",
        "at most 5 s" if whole else "",
        f"{again:.2f} s",
        again <= 5 if whole else None,
    )


def main(arguments: list[str]) -> None:
    n = next((int(a) for a in arguments if a.isdigit()), 2000)
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
    # the many first: their memory is their own
    rows = [
        *many(m, kinds["6 modes and 6 sensitivities"], designs),
        *one_design(m, kinds, designs),
        overhead(m, designs),
    ]
    text = f"{table(rows)}\n\n{circumstances(('numpy', 'scipy'))}"
    print(text)
    if "--write" in arguments:
        write(text, "<!-- designs table begins -->", "<!-- designs table ends -->")


if __name__ == "__main__":
    main(sys.argv[1:])
