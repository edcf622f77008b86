"""Standard systems of equations with `mb.root` and its rivals; ``--write`` puts the tables into docs/root.md.

python benches/root.py [--write]
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mbrs as mb
import numpy as np
from tables import folded

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "models"))
import root_problems  # noqa: E402

TOL = 1e-8
MOST = 2000
BARE: dict[str, Any] = {
    "fallback": False,
    "restarts": 0,
    "patience": 10**6,
    "invariant": False,
    "maxiter": 300,
    "tol": TOL,
}
SIZES = {
    "Rosenbrock": (2, 10, 1000),
    "Powell singular": (4, 100, 1000),
    "Freudenstein-Roth": (2, 10),
    "Powell badly scaled": (2,),
    "helical valley": (3,),
    "trigonometric": (5, 10),
    "Brown almost-linear": (10, 30),
    "boundary value": (10, 100, 1000),
    "integral": (10, 100),
    "Broyden tridiagonal": (10, 100, 1000),
    "Broyden banded": (10, 100, 1000),
    "Chebyquad": (5, 7, 9),
    "trigexp": (100, 1000),
    "exponential": (2,),
    "tridiagonal cubic": (10, 100, 1000),
    "H-equation": (100,),
    "Bratu": (100, 900),
    "strictly convex": (10, 1000),
}


class Counted:
    """A function that counts its calls."""

    def __init__(self, fun: Callable[[np.ndarray], np.ndarray], most: int | None = None) -> None:
        self.fun, self.calls, self.most = fun, 0, most

    def __call__(self, x: np.ndarray) -> np.ndarray:
        self.calls += 1
        if self.most and self.calls > self.most:
            raise RuntimeError("evaluations used up")
        with np.errstate(all="ignore"):
            return self.fun(x)


def ours(p: root_problems.Problem, **options: Any) -> str:
    fun = Counted(p.fun)
    try:
        found = mb.root(fun, p.x0, **options)
    except mb.MbrsError as problem:
        return f"error: {problem}"
    mark = "" if found.success else "**fails** "
    fallback = "" if found.fallback is None else " (fallback)"
    return f"{mark}{found.nit} / {found.n_backtracks} / {fun.calls} / {found.norm:.0e}{fallback}"


def defaults(p: root_problems.Problem) -> str:
    banded = p.band is not None and p.n >= 100
    return ours(p, tol=TOL, **({"sparsity": p.sparsity(), "memory": 40} if banded else {}))


def scipys(p: root_problems.Problem, method: str) -> str:
    from scipy.optimize import root

    options = {
        "hybr": {"xtol": 1e-12},
        "broyden1": {"fatol": TOL, "tol_norm": np.linalg.norm, "maxiter": MOST},
        "krylov": {"fatol": TOL, "tol_norm": np.linalg.norm, "maxiter": MOST},
        "df-sane": {"fatol": TOL, "ftol": 0.0, "maxfev": MOST},
    }[method]
    fun = Counted(p.fun, 20 * MOST)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with np.errstate(all="ignore"):
                norm = float(np.linalg.norm(p.fun(root(fun, p.x0, method=method, options=options).x)))
        except Exception as problem:
            return f"**fails** {fun.calls} / {type(problem).__name__}"
    return f"{'' if norm <= TOL else '**fails** '}{fun.calls} / {norm:.0e}"


METHODS: dict[str, Callable[[root_problems.Problem], str]] = {
    "I identity": lambda p: ours(p, jac0="identity", **BARE),
    "II identity": lambda p: ours(p, method="broyden", jac0="identity", **BARE),
    "I differences": lambda p: ours(p, jac0="fd", memory=None, **BARE),
    "II differences": lambda p: ours(p, method="broyden", jac0="fd", memory=None, **BARE),
    "mb.root": defaults,
    "hybr": lambda p: scipys(p, "hybr"),
    "broyden1": lambda p: scipys(p, "broyden1"),
    "krylov": lambda p: scipys(p, "krylov"),
    "df-sane": lambda p: scipys(p, "df-sane"),
}


def main(write: bool) -> None:
    lines = [
        "| problem | n | source | " + " | ".join(METHODS) + " |",
        "| --- | --- | --- | " + "--- | " * len(METHODS),
    ]
    solved = dict.fromkeys(METHODS, 0)
    total = 0
    for name, sizes in SIZES.items():
        for n in sizes:
            p = root_problems.problem(name, n)
            cells = {method: run(p) for method, run in METHODS.items()}
            total += 1
            for method, cell in cells.items():
                solved[method] += not (cell.startswith("**fails") or cell.startswith("error"))
            lines.append(f"| {name} | {n} | {p.source} | " + " | ".join(cells.values()) + " |")
            print(lines[-1], flush=True)
    heads = f"| solved of {total} by | " + " | ".join(METHODS) + " |\n| --- | " + "--- | " * len(METHODS)
    counts = f"{heads}\n| problems | " + " | ".join(str(v) for v in solved.values()) + " |"
    print(counts)
    if write:
        path = ROOT / "docs" / "root.md"
        text = path.read_text(encoding="utf-8")
        begin, end = "<!-- table begins -->", "<!-- table ends -->"
        each = folded("\n".join(lines), "each problem")
        head, tail = text.split(begin)[0], text.split(end)[1]
        path.write_text(f"{head}{begin}\n{counts}\n\n{each}\n{end}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main("--write" in sys.argv)
