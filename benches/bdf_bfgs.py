"""`bdf-bfgs` beside Newton's method: error and counts at equal steps; ``--write`` puts it into docs/root.md.

python benches/bdf_bfgs.py [--write]
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

import mbrs as mb

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "models"))
import motion_problems as zoo  # noqa: E402

PROBLEMS = ("double_pendulum", "four_bars", "slider_crank", "five_bar", "chain", "heavy_top", "bushings")
WAYS: dict[str, dict[str, Any]] = {
    "bdf-bfgs, ggl, auto": {"method": "bdf-bfgs"},
    "bdf-bfgs, ggl, bfgs": {"method": "bdf-bfgs", "update": "bfgs"},
    "bdf-bfgs, symmetric, bfgs": {"method": "bdf-bfgs", "form": "symmetric", "update": "bfgs"},
    "bdf-bfgs, symmetric, broyden": {"method": "bdf-bfgs", "form": "symmetric", "update": "broyden"},
    "bdf (Newton)": {"method": "bdf"},
    "generalized-alpha (Newton)": {"method": "generalized-alpha"},
}
STEPS = 400


def row(problem: zoo.MotionProblem, name: str, options: dict[str, Any]) -> str:
    if options["method"] not in mb.simulate.__globals__["METHODS"]:
        return f"| {problem.name} | {name} | not run | | | |"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            traj = mb.simulate(problem.model, t=problem.t, step=problem.t / STEPS, **options)
    except mb.MbrsError as trouble:
        return f"| {problem.name} | {name} | **fails**: {str(trouble)[:80]} | | | |"
    error = problem.error(traj.t, problem.places(traj))
    counts = traj.stats.counts
    evaluations = counts.get("residual evaluations", counts.get("force evaluations", 0))
    formed = counts.get("inverse formations", counts.get("tangents", 0))
    return (
        f"| {problem.name} | {name} | {error:.1e} | {evaluations / STEPS:.1f} | {formed} | "
        f"{counts.get('fallback steps', 0)} |"
    )


def main(write: bool) -> None:
    lines = [
        "| problem | method | error, m | evaluations per step | formations or tangents | fallback steps |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name in PROBLEMS:
        problem = zoo.SMOOTH[name]()
        for way, options in WAYS.items():
            lines.append(row(problem, way, options))
            print(lines[-1], flush=True)
    if write:
        path = ROOT / "docs" / "root.md"
        text = path.read_text(encoding="utf-8")
        begin, end = "<!-- motion begins -->", "<!-- motion ends -->"
        head, tail = text.split(begin)[0], text.split(end)[1]
        path.write_text(f"{head}{begin}\n" + "\n".join(lines) + f"\n{end}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main("--write" in sys.argv)
