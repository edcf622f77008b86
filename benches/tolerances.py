"""Whether tests see the numbers of `tolerances`: every number times 100 and over 100, in a copy of the core built once.

python benches/tolerances.py FOLDER                    every number, with the tests that it names; goes on where it stopped
python benches/tolerances.py FOLDER modes::SHARP ...   these anew
python benches/tolerances.py FOLDER modes::SHARP --with tests/linear/test_modal.py second_order::   with other tests than they name
python benches/tolerances.py FOLDER --write            what was found, into benches/README.md

FOLDER keeps the copy and what was found (found.jsonl); the copy is made anew where there is none. Python tests are read from this
folder, not from the copy: of functions all cases, of whole files those that a plain run of pytest takes. A number is seen in a direction
if a test fails there or does not end in several times its usual time.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from core_copies import ROOT, build_rust_tests, built, copy_sources
from tables import folded, write
from variable_tolerances import VARIABLE, make_variable

sys.path.insert(0, str(ROOT / "tests"))

from test_tolerances import ALL, RUST, Constant

FACTORS = {"larger": "100", "smaller": "0.01"}


@dataclass(frozen=True)
class Tests:
    """Names of Rust tests, or parts of them, and paths of Python tests."""

    rust: tuple[str, ...]
    python: tuple[str, ...]

    def __bool__(self) -> bool:
        return bool(self.rust or self.python)


@dataclass(frozen=True)
class Finding:
    """How tests went with one number changed; ``failed`` names a test, is "hangs", or is empty where all passed."""

    number: str
    direction: str
    failed: str
    seconds: float


def name(constant: Constant) -> str:
    return f"{constant.group}::{constant.name}"


def path_of(function: str) -> str:
    files = (
        path for path in sorted((ROOT / "tests").rglob("test_*.py")) if f"def {function}(" in path.read_text("utf-8")
    )
    return f"{next(files).relative_to(ROOT)}::{function}"


def named(constant: Constant) -> Tests:
    """The tests that the text of a number names."""
    paths, functions = constant.tests
    functions = [f for f in functions if "_" in f]
    python = [f for f in functions if f.startswith("test_")]
    return Tests(tuple(f for f in functions if f not in python), (*map(path_of, python), *paths))


class Copy:
    """A copy of the core whose numbers the environment changes, and the times that tests take in it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.program = folder / "rust-tests"
        self.unchanged: dict[Tests, tuple[str, float]] = {}
        if not self.program.is_file():  # it is built last
            self.make()

    def make(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        copy_sources(self.folder)
        make_variable(self.folder)
        built(self.folder)
        build_rust_tests(self.folder)

    def failed(self, tests: Tests, change: str = "", limit: float | None = None) -> str:
        """The first test that fails with a number changed, "hangs" after ``limit`` seconds, or nothing."""
        rust = [str(self.program), *tests.rust, "--test-threads", "1"]
        pytest = [sys.executable, "-m", "pytest", "-x", "-n", "0", "--no-header"]
        functions = [test for test in tests.python if "::" in test]
        files = [test for test in tests.python if test not in functions]
        commands = [rust] * bool(tests.rust) + [[*pytest, *files]] * bool(files)
        commands += [[*pytest, "-m", "", *functions]] * bool(functions)
        environment = {**os.environ, VARIABLE: change, "PYTHONPATH": str(self.folder / "python")}
        for command in commands:
            try:
                done = subprocess.run(
                    command, cwd=ROOT, env=environment, capture_output=True, text=True, errors="replace", timeout=limit
                )
            except subprocess.TimeoutExpired:
                return "hangs"
            if done.returncode not in (0, 5):  # 5: no test of this name
                return first_failure(done.stdout) or f"ends with {done.returncode}"
        return ""

    def usual(self, tests: Tests) -> tuple[str, float]:
        """The test that fails without a change, which must be none, and the seconds that all take."""
        if tests not in self.unchanged:
            begin = time.monotonic()
            self.unchanged[tests] = self.failed(tests), time.monotonic() - begin
        return self.unchanged[tests]


def first_failure(output: str) -> str:
    found = re.search(r"^(?:FAILED|ERROR) (\S+)|^test (\S+) \.\.\. FAILED", output, re.MULTILINE)
    return (found[1] or found[2]) if found else ""


def find(copy: Copy, constant: Constant, direction: str, tests: Tests) -> Finding:
    wrong, usual = copy.usual(tests)
    if wrong:
        raise SystemExit(f"{name(constant)}: {wrong} fails without any change")
    begin = time.monotonic()
    failed = copy.failed(tests, f"{name(constant)}={FACTORS[direction]}", 30.0 + 5.0 * usual)
    return Finding(name(constant), direction, failed, round(time.monotonic() - begin, 1))


def read(file: Path) -> dict[tuple[str, str], Finding]:
    """What was found, the last where there is more."""
    lines = file.read_text("utf-8").splitlines() if file.is_file() else []
    found = (Finding(**json.loads(line)) for line in lines)
    return {(f.number, f.direction): f for f in found}


def run(folder: Path, names: list[str], others: Tests) -> None:
    """Goes through all numbers that name tests, or through those of these names; results are kept as they come."""
    file, copy = folder / "found.jsonl", Copy(folder)
    done = {} if names else read(file)
    for constant in ALL:
        tests = others or named(constant)
        if is_count(constant) or not tests or (names and name(constant) not in names):
            continue
        for direction in FACTORS:
            if (name(constant), direction) in done:
                continue
            found = find(copy, constant, direction, tests)
            print(f"{found.number:40} {direction:8} {found.seconds:6.1f} s  {found.failed or 'not seen'}", flush=True)
            if not others:
                with file.open("a", encoding="utf-8") as out:
                    out.write(json.dumps(asdict(found)) + "\n")


def is_count(constant: Constant) -> bool:
    home = RUST / "tolerances" / f"{constant.group}.rs"
    text = (home if home.is_file() else RUST / "tolerances" / "mod.rs").read_text("utf-8")
    inside = text[text.find(f"pub mod {constant.group} {{") :] if not home.is_file() else text
    found = re.search(rf"pub const {constant.name}: (\w+)", inside)
    return found is not None and found[1] != "f64"


def summary(folder: Path) -> str:
    """How many numbers are seen, which are not in both directions, and why where their text says it."""
    found = read(folder / "found.jsonl")
    numbers = [c for c in ALL if not is_count(c)]
    cells = {name(c): [found.get((name(c), d)) for d in FACTORS] for c in numbers if named(c)}
    open_ends = {name(c): [d for d in FACTORS if not is_seen(found.get((name(c), d)))] for c in numbers}
    explained = {name(c) for c in numbers if open_ends[name(c)] and set(open_ends[name(c)]) <= reasons(c).keys()}
    seen = sum(not ends for ends in open_ends.values())
    rest = sorted((n for n in cells if n not in explained), key=lambda n: len(open_ends[n]))
    heads = ["| number | larger | smaller |", "| --- | --- | --- |"]
    rows = [f"| `{n}` | {' | '.join(map(cell, cells[n]))} |" for n in rest if open_ends[n]]
    whys = [line(c, open_ends[name(c)]) for c in numbers if name(c) in explained]
    unnamed = [f"`{name(c)}`" for c in numbers if not named(c) and name(c) not in explained]
    folds = [
        (rows, folded("\n".join(heads + rows), "not seen in both directions")),
        (whys, folded("\n".join(whys), f"{len(explained)} that no test can see, or from one side only")),
        (unnamed, folded(", ".join(unnamed) + ".", f"{len(unnamed)} name no test")),
    ]
    counted = (
        f"Of {len(numbers)} numbers {seen} are seen in both directions, {len(explained)} as far as a test can see them, "
        f"{len(rows)} name tests that do not see them in both, {len(unnamed)} name none."
    )
    return "\n\n".join([counted, *(fold for members, fold in folds if members)])


def reasons(constant: Constant) -> dict[str, str]:
    """Why a test cannot see a direction, by direction."""
    side = {"above": "larger", "below": "smaller"}
    return {side[place]: why for place, why in constant.unseen.items()}


def line(constant: Constant, ends: list[str]) -> str:
    side = "" if len(ends) == 2 else f" ({ends[0]})"
    return f"- `{name(constant)}`{side}: {reasons(constant)[ends[0]]}"


def is_seen(finding: Finding | None) -> bool:
    return finding is not None and bool(finding.failed)


def cell(finding: Finding | None) -> str:
    if finding is None:
        return "not run"
    if finding.failed == "hangs":
        return "seen (hangs)"
    return "seen" if finding.failed else "not seen"


def main(arguments: list[str]) -> None:
    folder, *rest = arguments
    if rest == ["--write"]:
        write(summary(Path(folder)), "<!-- tolerances table begins -->", "<!-- tolerances table ends -->")
        return
    names = rest[: rest.index("--with")] if "--with" in rest else rest
    others = rest[len(names) + 1 :]
    python = [test for test in others if test.startswith("tests/")]
    tests = Tests(tuple(test for test in others if test not in python), tuple(python))
    run(Path(folder).resolve(), names, tests)


if __name__ == "__main__":
    main(sys.argv[1:])
