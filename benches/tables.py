"""Tables of measurements: a row, its goal, ours, what stands beside it; how CPU time is taken, and what the machine was."""

from __future__ import annotations

import importlib
import os
import platform
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

README = Path(__file__).resolve().parent / "README.md"
ONE_THREAD = {name: "1" for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")}


@dataclass(frozen=True)
class Row:
    """One line of the table; ``reached`` None where there is no goal or nothing was run.

    ``beside``: what other programs, or other ways, take for the same in the same run.
    """

    what: str
    goal: str
    measured: str
    reached: bool | None = None
    beside: str = ""

    def cells(self) -> list[str]:
        verdict = {True: "yes", False: "**no**", None: ""}[self.reached]
        return [self.what, self.goal, self.measured, self.beside, verdict]


def cpu(work: Callable[[], Any], repeats: int = 7, least: float = 0.02) -> float:
    """CPU seconds of one call: the best of ``repeats`` means over at least ``least`` seconds."""
    begin = time.process_time()
    work()
    once = time.process_time() - begin
    loops = max(1, int(least / max(once, 1e-9)))
    best = np.inf
    for _ in range(repeats):
        begin = time.process_time()
        for _ in range(loops):
            work()
        best = min(best, (time.process_time() - begin) / loops)
    return best


def ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms"


def folded(rows: str, title: str = "numbers") -> str:
    """A long table of a page, closed until it is asked for."""
    return f"<details><summary>{title}</summary>\n\n{rows}\n\n</details>"


def table(rows: list[Row]) -> str:
    lines = [["what", "goal", "mbrs", "beside it", "reached"], ["---"] * 5, *(row.cells() for row in rows)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def circumstances(programs_used: tuple[str, ...]) -> str:
    """Machine, versions and how busy it was: without them a time means nothing."""
    from importlib.metadata import PackageNotFoundError, version

    def of(name: str) -> str:
        try:
            return f"{name} {version(name)}"
        except PackageNotFoundError:
            return f"{name} absent"

    load = ", ".join(f"{x:.1f}" for x in os.getloadavg())
    programs = ", ".join(of(name) for name in programs_used)
    machine = f"{os.cpu_count()} cores ({platform.machine()}), load {load} when measured"
    return f"{machine}; Python {platform.python_version()}, {programs}."


def run(
    chosen: Mapping[str, Callable[[], list[Row]]], arguments: Iterable[str], begin: str, end: str,
    used: tuple[str, ...], remark: str = "",
) -> None:  # fmt: skip
    """Measure, print as rows come and the table at the end, with ``--write`` into benches/README.md too."""
    rows: list[Row] = []
    for name, measure in chosen.items():
        made = measure()
        rows += made
        # as they come: the whole takes minutes, and a busy machine longer
        print(f"{name}: done\n{table(made)}", file=sys.stderr, flush=True)
    text = f"{table(rows)}\n\n{circumstances(used)}{remark}"
    print(text)
    if "--write" in arguments:
        write(text, begin, end)


def selected(
    measurements: dict[str, Callable[[], list[Row]]], arguments: Iterable[str]
) -> dict[str, Callable[[], list[Row]]]:
    """Those named among the arguments, or all."""
    names = [a for a in arguments if not a.startswith("-")]
    return {name: measurements[name] for name in names or measurements}


def of_tests(name: str) -> Any:
    """A module of the tests: benches measure what they prove."""
    folder = str(Path(__file__).resolve().parent.parent / "tests" / "models")
    if folder not in sys.path:
        sys.path.insert(0, folder)
    return importlib.import_module(name)


def write(text: str, begin: str, end: str) -> None:
    """Put a table into benches/README.md, between its two marks."""
    before, _, rest = README.read_text().partition(begin)
    README.write_text(f"{before}{begin}\n{text}\n{end}{rest.partition(end)[2]}")


def one_thread() -> None:
    """Begin anew with one BLAS thread: BLAS reads the variables when numpy is imported, which has happened."""
    if ONE_THREAD.items() - os.environ.items():
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **ONE_THREAD})
