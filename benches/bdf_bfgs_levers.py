"""What each lever brings `bdf-bfgs` at equal error: force evaluations with one idea of the core changed at a time, in a copy of the source.

python benches/bdf_bfgs_levers.py [--write]

Each lever is a change of text in rust/src; one that no longer fits is an error. A build of the copy for each, with little
optimisation, since evaluations are counted and not timed: half an hour. ``--write`` puts the table into docs/root.md.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bdf_bfgs import CONTROLLED, ROOT, SCENES, evaluations, put
from core_copies import built, copied

STEPS, SOLVER = "rust/src/tolerances/steps.rs", "rust/src/integrate/bdf/inverse_updates.rs"


@dataclass(frozen=True)
class Change:
    """One place of the sources, which must be there once."""

    path: str
    old: str
    new: str

    def make(self, copy: Path) -> None:
        home = copy / self.path
        text = home.read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise SystemExit(
                f"{self.path} holds {text.count(self.old)} times {self.old!r}: bring this script up to date"
            )
        home.write_text(text.replace(self.old, self.new), encoding="utf-8")


def number(name: str, old: str, new: str) -> Change:
    return Change(STEPS, f"pub const {name}: f64 = {old};", f"pub const {name}: f64 = {new};")


EVALUATED = Change(SOLVER, "left: self.left,", "left: None,")
LOOSEST = Change(SOLVER, "(SHARE_OF_TOLERANCE * r).min(FIXED_SOLVED)", "(SHARE_OF_TOLERANCE * r).min(1e-14)")
LEVERS: dict[str, tuple[Change, ...]] = {
    "each step of the iteration evaluated, norm at most 1e-14": (EVALUATED, LOOSEST),
    "norm at most 1e-12 in place of 1e-14": (EVALUATED,),
    "last step not evaluated where the slowest of the late iterations allows it, at 1e-14": (LOOSEST,),
    "**the two together (as it is)**": (),
    "1e-11 of the motion within a step in place of 1e-12": (number("FIXED_SOLVED", "1e-12", "1e-11"),),
    "1e-10, with an inverse that is kept over changes of the step up to ten": (
        number("FIXED_SOLVED", "1e-12", "1e-10"),
        Change(SOLVER, "!(0.5..=2.0).contains", "!(0.1..=10.0).contains"),
    ),
    "start steps that hold a tenth of the tolerance in place of a thousandth": (number("NOISE_SHARE", "1e-3", "1e-1"),),
    "points left behind at steps shorter by 2 in place of 1.6": (
        Change("rust/src/integrate/bdf/mod.rs", "const WIDEST: f64 = 1.6;", "const WIDEST: f64 = 2.0;"),
    ),
    "last step not evaluated where the last two norms alone allow it, as Newton's method does": (
        Change(SOLVER, ".skip(1).map(|n| n[1] / n[0]).reduce(f64::max);", ".skip(1).map(|n| n[1] / n[0]).last();"),
        Change(
            SOLVER, "left.map(|now| now.max(FADING * self.left.unwrap_or(0.0))).or(self.left)", "left.or(self.left)"
        ),
    ),
}


def counted(copy: Path) -> dict[str, list[float | None]]:
    """Evaluations by scene and method of a core built from ``copy``."""
    command = [sys.executable, "benches/bdf_bfgs_levers.py", "--count"]
    done = subprocess.run(command, cwd=copy, env=built(copy), check=True, capture_output=True, text=True)
    found: dict[str, list[float | None]] = json.loads(done.stdout.splitlines()[-1])
    return found


def cell(found: Sequence[float | None]) -> str:
    return ", ".join("not reached" if n is None else f"{n:.0f}" for n in found)


def table(copy: Path) -> list[str]:
    lines: list[str] = []
    for name, changes in LEVERS.items():
        for part in ("rust", "python"):
            shutil.rmtree(copy / part, ignore_errors=True)
            shutil.copytree(ROOT / part, copy / part)
        for change in changes:
            change.make(copy)
        (copy / "rust" / "src" / "lib.rs").touch()  # copies are as old as what they are copied from
        found = counted(copy)
        if not lines:
            newton = [f"{scene} (Newton {counts[0]:.0f})" for scene, counts in found.items()]
            lines = [f"| lever | {' | '.join(newton)} |", f"|{' --- |' * (len(newton) + 1)}"]
        lines.append(f"| {name} | {' | '.join(cell(counts[1:]) for counts in found.values())} |")
        print(lines[-1], flush=True)
    return lines


def main(write: bool) -> None:
    with copied() as copy:
        lines = table(copy)
    if write:
        put(ROOT / "docs" / "root.md", "levers", lines)


if __name__ == "__main__":
    if "--count" in sys.argv:
        print(json.dumps({scene: [evaluations(scene, way) for way in CONTROLLED] for scene in SCENES}))
    else:
        main("--write" in sys.argv)
