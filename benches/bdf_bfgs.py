"""`bdf-bfgs` beside Newton's method: error and counts at equal steps, time and counts at equal error; ``--write`` puts
both into docs/root.md.

python benches/bdf_bfgs.py [--write]
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mbrs as mb
import numpy as np
from tables import folded

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


# Equal error: rad of B's angle in the swing, m of a point of a blade in the rotor.
EQUAL, RUNS = 1e-6, 3
TOLERANCES = (1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8, 3e-9, 1e-9)
CONTROLLED: dict[str, dict[str, Any]] = {
    "bdf (Newton)": {"method": "bdf"},
    "bdf-bfgs, ggl, auto": {"method": "bdf-bfgs"},
    "bdf-bfgs, symmetric, bfgs": {"method": "bdf-bfgs", "form": "symmetric", "update": "bfgs"},
    "bdf-bfgs, symmetric, broyden": {"method": "bdf-bfgs", "form": "symmetric", "update": "broyden"},
}
# the model, its end (s), and what is compared
Read = Callable[[mb.Trajectory], np.ndarray]


def swing() -> tuple[mb.Model, float, Read]:
    return mb.examples.swing(), 5.0, lambda traj: traj.joint("m") + traj.joint("n")


def rotor() -> tuple[mb.Model, float, Read]:
    return mb.examples.wind_rotor(air=12.0), 6.0, lambda traj: traj.point("section1")


def run(model: mb.Model, end: float, read: Read, known: np.ndarray, options: dict[str, Any]) -> dict[str, float]:
    """Error at eleven instants, the least CPU time (ms) of several runs, and counts."""
    t, seconds = np.linspace(0.0, end, 11), np.inf
    for _ in range(RUNS):
        begin = time.process_time()
        traj = mb.simulate(model, t=t, **options)
        seconds = min(seconds, time.process_time() - begin)
    counts = traj.stats.counts
    steps, forces = counts["steps"], counts["force evaluations"]
    # each step that is solved ends with accelerations
    ends = steps + counts.get("rejected steps", 0)
    equations = counts.get("residual evaluations", forces - ends)
    return {
        "error": float(np.abs(read(traj) - known).max()),
        "ms": 1e3 * seconds,
        "steps": steps,
        "tried": ends,
        "forces": forces,
        "equations": equations,
        "start": forces - equations - ends,
        "formations": counts.get("inverse formations", counts.get("tangents", 0)),
    }


def at_equal_error(found: list[dict[str, float]]) -> dict[str, float]:
    """Every number where the error passes EQUAL for the last time, by straight lines over the logarithms; none where it does not."""
    error = np.log([row["error"] for row in found])
    passes = [i for i in range(len(error) - 1) if error[i] >= np.log(EQUAL) >= error[i + 1]]
    if not passes:
        return {}
    k = passes[-1]
    share = (error[k] - np.log(EQUAL)) / (error[k] - error[k + 1])
    return {name: (1 - share) * found[k][name] + share * found[k + 1][name] for name in found[0] if name != "error"}


def equal_error() -> list[str]:
    heads = [
        "scene",
        "method",
        "CPU ms",
        "over Newton's",
        "steps",
        "tried",
        "force evaluations",
        "over Newton's",
        "of the equations, for each step tried",
        "for starts",
        "formations or tangents",
        "us an evaluation",
    ]
    lines = [f"| {' | '.join(heads)} |", f"|{' --- |' * len(heads)}"]
    for scene, make in (("swing, 5 s, 1e-6 rad", swing), ("flexible rotor, 6 s, 1e-6 m", rotor)):
        model, end, read = make()
        known = read(mb.simulate(model, t=np.linspace(0.0, end, 11), method="explicit", rtol=1e-12))
        newton: dict[str, float] = {}
        for way, options in CONTROLLED.items():
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = []
                for rtol in TOLERANCES:
                    found.append(run(model, end, read, known, options | {"rtol": rtol}))
                    if found[-1]["error"] < EQUAL / 3:
                        break
            print(scene, way, [f"{row['error']:.0e}: {row['ms']:.1f} ms" for row in found], flush=True)
            row = at_equal_error(found)
            if not row:
                lines.append(f"| {scene} | {way} | does not pass {EQUAL:g} |{' |' * (len(heads) - 3)}")
                continue
            newton = newton or row
            lines.append(
                f"| {scene} | {way} | {row['ms']:.1f} | {row['ms'] / newton['ms']:.2f} | {row['steps']:.0f} | {row['tried']:.0f} | "
                f"{row['forces']:.0f} | {row['forces'] / newton['forces']:.2f} | {row['equations'] / row['tried']:.1f} | "
                f"{row['start']:.0f} | {row['formations']:.0f} | {1e3 * row['ms'] / row['forces']:.1f} |"
            )
    return lines


def put(path: Path, mark: str, lines: list[str]) -> None:
    """Replace what lies between two comments."""
    text = path.read_text(encoding="utf-8")
    begin, end = f"<!-- {mark} begins -->", f"<!-- {mark} ends -->"
    head, tail = text.split(begin)[0], text.split(end)[1]
    body = "\n".join(lines)
    path.write_text(f"{head}{begin}\n{body}\n{end}{tail}", encoding="utf-8")


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
    equal = equal_error()
    print("\n".join(equal))
    if write:
        put(ROOT / "docs" / "root.md", "motion", [folded("\n".join(lines))])
        put(ROOT / "docs" / "root.md", "equal error", equal)


if __name__ == "__main__":
    main("--write" in sys.argv)
