"""Whether the tests that numbers of `tolerances` name see them: every number times 100 and over 100, in a copy of the sources.

python benches/tolerances.py                 numbers that name Rust tests: all at once, two builds of the library's tests
python benches/tolerances.py modes::SHARP    these, each with the tests in Python that it names: two builds of the core each

A number is seen in a direction if one of its tests fails there. At once, a test may fail by another number; one at a time says more.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from core_copies import ROOT, built, copied

sys.path.insert(0, str(ROOT / "tests"))

from test_tolerances import ALL, RUST, Constant

FACTORS = {"larger": 100.0, "smaller": 0.01}


def scaled(source: str, constant: Constant, factor: float) -> str:
    """The source with one number changed; counts and numbers made of others stay."""
    inside = re.search(rf"pub mod {constant.group} \{{", source)
    start = inside.end() if inside else 0
    changed, n = re.subn(
        rf"(pub const {constant.name}: f64 = )([^;]+);", rf"\g<1>{factor!r} * (\g<2>);", source[start:], count=1
    )
    return source[:start] + changed if n else source


def change(copy: Path, constants: list[Constant], factor: float) -> None:
    for home in (RUST / "tolerances.rs", *(RUST / "tolerances").glob("*.rs")):
        text = home.read_text(encoding="utf-8")
        for c in constants:
            if c.group == home.stem or f"pub mod {c.group} {{" in text:
                text = scaled(text, c, factor)
        (copy / home.relative_to(ROOT)).write_text(text, encoding="utf-8")


def failed_rust_tests(copy: Path) -> set[str]:
    command = ["cargo", "test", "--lib", "--no-fail-fast"]
    done = subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False)
    if "test result" not in done.stdout:
        raise SystemExit(done.stderr[-3000:])
    return {name.rsplit("::", 1)[-1] for name in re.findall(r"^test (\S+) \.\.\. FAILED", done.stdout, re.M)}


def python_fails(copy: Path, paths: list[str]) -> bool:
    environment = built(copy)
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-n", "0", *paths]
    return subprocess.run(command, cwd=copy, env=environment, capture_output=True, check=False).returncode == 1


def report(seen: dict[str, list[str]]) -> None:
    for name, directions in sorted(seen.items()):
        print(f"{name:40} {' and '.join(directions) or 'not seen'}")
    both = sum(len(d) == len(FACTORS) for d in seen.values())
    print(f"{both} of {len(seen)} are seen in both directions")


def main(names: list[str]) -> None:
    with copied() as copy:
        seen: dict[str, list[str]] = {}
        if names:
            for c in (c for c in ALL if f"{c.group}::{c.name}" in names):
                seen[f"{c.group}::{c.name}"] = found = []
                for direction, factor in FACTORS.items():
                    change(copy, [c], factor)
                    if c.tests[0] and python_fails(copy, c.tests[0]):
                        found.append(direction)
        else:
            pinned = [c for c in ALL if any("_" in f for f in c.tests[1])]
            seen = {f"{c.group}::{c.name}": [] for c in pinned}
            for direction, factor in FACTORS.items():
                change(copy, pinned, factor)
                failed = failed_rust_tests(copy)
                for c in pinned:
                    if failed & set(c.tests[1]):
                        seen[f"{c.group}::{c.name}"].append(direction)
        report(seen)
        free = [c for c in ALL if "Pinned by" not in c.text]
        print(f"{len(free)} of {len(ALL)} numbers name no test that pins them")


if __name__ == "__main__":
    main(sys.argv[1:])
