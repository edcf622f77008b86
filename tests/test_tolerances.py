"""Numbers that decide: they are in `tolerances` of the core, each with its meaning, and the tests that they name exist."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import pytest
from folders import ROOT

RUST = ROOT / "rust" / "src"
HOMES = sorted((RUST / "tolerances").glob("*.rs"))

pytestmark = pytest.mark.skipif(not RUST.is_dir(), reason="an installed package has no Rust sources beside it")

# Files with small numbers that decide nothing, and why.
COEFFICIENTS = {
    "integrate/dop853_numbers.rs": "the tableau of a Runge-Kutta method",
    "spatial.rs": "the series of a rotation",
    "model/layout.rs": "written from the schema of Python, which says what they mean",
}
NUMBER = re.compile(r"(?<![\w.])(\d[\d_]*(?:\.[\d_]*)?(?:[eE]-?\d+)?)(?:_?f64)?(?![\w.])")
SMALL = 1e-3


def code(path):
    """(line, text) without comments, texts and tests at the end of the file."""
    for n, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if line.startswith("#[cfg(test)]"):
            return
        yield n, re.sub(r'"(?:[^"\\]|\\.)*"|//.*', "", line)


def small_numbers(text):
    return [m[1] for m in NUMBER.finditer(text) if 0.0 < float(m[1].replace("_", "")) <= SMALL]


def test_small_numbers_are_found():
    assert small_numbers("x > 1e-9 * y && z < 0.000_5 || 1e-3_f64 > w") == ["1e-9", "0.000_5", "1e-3"]
    assert small_numbers("(0.85, 2e-3, 1e12, 3, a.0, f64::EPSILON, 0.0, v1e-5)") == []


def test_small_numbers_are_in_tolerances():
    found = [
        f"{path.relative_to(RUST)}:{n}: {number}"
        for path in sorted(RUST.rglob("*.rs"))
        if path not in HOMES and path.name != "tests.rs" and str(path.relative_to(RUST)) not in COEFFICIENTS
        for n, text in code(path)
        for number in small_numbers(text)
    ]
    assert not found, "name them in rust/src/tolerances, or use f64::EPSILON or f64::MIN_POSITIVE:\n" + "\n".join(found)


def test_files_without_decisions_have_such_numbers():
    idle = [name for name in COEFFICIENTS if not any(small_numbers(text) for _, text in code(RUST / name))]
    assert not idle, f"need no exception: {idle}"


@dataclass(frozen=True)
class Constant:
    group: str
    name: str
    text: str  # what is written above it

    @property
    def tests(self):
        """Places of tests in the text: paths, and names of functions in quotation marks."""
        paths = re.findall(r"tests/[\w/]+\.py", self.text)
        functions = re.findall(r"`([a-z]\w+)`", self.text) if "Pinned by" in self.text else []
        return paths, functions

    @property
    def unseen(self):
        """Why no test sees the number from above or from below, where its text says that none can."""
        said = re.findall(r"Not seen(?: from (above|below))?: ([^.]+)\.", self.text)
        return {side: reason for place, reason in said for side in ([place] if place else ["above", "below"])}


def constants():
    for path in HOMES:
        group, text = path.stem, []
        for line in path.read_text(encoding="utf-8").splitlines():
            if opened := re.match(r"pub mod (\w+) \{", line):
                group = opened[1]
            elif (doc := re.match(r"\s*///\s?(.*)", line)) is not None:
                text.append(doc[1])
            elif found := re.match(r"\s*pub const (\w+):", line):
                yield Constant(group, found[1], " ".join(text))
                text = []
            elif line.strip():
                text = []


ALL = list(constants())


def test_each_number_tells_what_it_decides():
    assert len(ALL) > 150
    short = [f"{c.group}::{c.name}" for c in ALL if len(c.text) < 12 or not c.text.endswith((".", ")"))]
    assert not short, f"without meaning: {short}"


def test_tests_that_numbers_name_exist():
    rust = "\n".join(path.read_text(encoding="utf-8") for path in RUST.rglob("*.rs"))
    python = "\n".join(path.read_text(encoding="utf-8") for path in Path(__file__).parent.rglob("test_*.py"))
    absent = []
    for c in ALL:
        paths, functions = c.tests
        wrong = [p for p in paths if not (ROOT / p).is_file()]
        wrong += [f for f in functions if "_" in f and f"fn {f}(" not in rust and f"def {f}(" not in python]
        absent += [f"{c.group}::{c.name} names {what}" for what in wrong]
    assert not absent, "\n".join(absent)


def test_what_is_not_seen_has_a_reason():
    careless = [f"{c.group}::{c.name}" for c in ALL if c.text.count("Not seen") and not c.unseen]
    assert not careless, f"say why, 'Not seen: ...' or 'Not seen from above: ...': {careless}"
    no_side = [f"{c.group}::{c.name}" for c in ALL if len(c.unseen) == 2 and "Pinned by" in c.text]
    assert not no_side, f"pinned by tests, and say that none can see them: {no_side}"


def test_each_number_is_used():
    readers = [p for p in [*RUST.rglob("*.rs"), *Path(__file__).parent.glob("*.rs")] if p not in HOMES]
    used = {word for path in readers for word in re.findall(r"\w+", path.read_text(encoding="utf-8"))}
    idle = [f"{c.group}::{c.name}" for c in ALL if c.name not in used]
    assert not idle, f"decide nothing: {idle}"
