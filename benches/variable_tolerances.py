"""The sources of the core, changed so that the numbers of `tolerances` are read from the environment: one build serves all changes.

Every ``pub const SHARP: f64 = 1e-12;`` becomes a function that multiplies by what MBRS_TOLERANCE says ("modes::SHARP=100"), and every
use of the name a call of it. Counts stay constants.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

VARIABLE = "MBRS_TOLERANCE"
NUMBER = re.compile(r"pub const (\w+): f64 = ([^;]+);")
TAKEN = re.compile(r"\btolerances::([^;]+);")

READER = """
/// `value`, times the factor that the environment gives it.
pub fn changed(name: &str, value: f64) -> f64 {
    match std::env::var("MBRS_TOLERANCE").ok().as_deref().and_then(|text| text.split_once('=')) {
        Some((changed, factor)) if changed == name => value * factor.parse::<f64>().expect("a factor"),
        _ => value,
    }
}
"""


def function(group: str, name: str, value: str) -> str:
    read = f'*VALUE.get_or_init(|| crate::tolerances::changed("{group}::{name}", {value}))'
    kept = "static VALUE: std::sync::OnceLock<f64> = std::sync::OnceLock::new();"
    return f"#[allow(non_snake_case)] pub fn {name}() -> f64 {{ {kept} {read} }}"


def with_functions(source: str, group: str) -> str:
    """A file of `tolerances` with functions in place of its numbers."""
    lines = []
    for line in source.splitlines():
        if opened := re.match(r"pub mod (\w+) \{", line):
            group = opened[1]
        if found := NUMBER.search(line):
            line = line.replace(found[0], function(group, found[1], found[2]))
        lines.append(line)
    return "\n".join(lines) + "\n"


def imported(source: str, numbers: set[tuple[str, str]]) -> set[str]:
    """Names that a file takes from `tolerances`."""
    groups = [
        (group, set(re.findall(r"\w+", listed)))
        for text in TAKEN.findall(source)
        for group, listed in re.findall(r"(\w+)::(\{[^}]*\}|[A-Z]\w*)", text)
    ]
    return {name for group, name in numbers if any(group == g and name in listed for g, listed in groups)}


def parent(path: Path) -> Path:
    """The file whose private names `super` gives to this one."""
    folder = path.parent.parent if path.name == "mod.rs" else path.parent
    beside = folder.parent / f"{folder.name}.rs"
    return beside if beside.is_file() else folder / "mod.rs"


def visible(path: Path, numbers: set[tuple[str, str]]) -> set[str]:
    source = path.read_text(encoding="utf-8")
    found = imported(source, numbers)
    if re.search(r"\buse super::(\*|\{)", source) and parent(path).is_file() and parent(path) != path:
        found |= imported(parent(path).read_text(encoding="utf-8"), numbers)
    return found - set(re.findall(r"const (\w+):", source))


def with_calls(source: str, names: set[str]) -> str:
    """A file with calls in place of the numbers `names`, outside its imports, comments and texts."""
    if not names:
        return source
    used = rf"(?<![\w:])(?<![^.]\.)(?:crate::tolerances::\w+::)?(?:{'|'.join(sorted(names))})\b(?!\s*[(:])"
    text = r"""'(?:[^'\\]|\\.)'|"(?:[^"\\]|\\.)*\""""
    kept = re.compile(rf"(?:^\s*(?:pub )?use [^;]+;|//[^\n]*|{text}|(?P<used>{used}))", re.MULTILINE | re.DOTALL)
    called = kept.sub(lambda m: f"{m[0]}()" if m["used"] else m[0], source)
    return called.replace("const { assert!", "{ assert!")  # which the compiler would check


def numbers_of(source: str, group: str) -> Iterator[tuple[str, str]]:
    """Group and name of each number of a file of `tolerances`."""
    for line in source.splitlines():
        if opened := re.match(r"pub mod (\w+) \{", line):
            group = opened[1]
        elif found := NUMBER.search(line):
            yield group, found[1]


def make_variable(copy: Path) -> None:
    """Changes the sources of a copy."""
    rust = copy / "rust" / "src"
    homes = {path: path.read_text(encoding="utf-8") for path in (rust / "tolerances").glob("*.rs")}
    numbers = {number for path, text in homes.items() for number in numbers_of(text, path.stem)}
    others = [path for path in rust.rglob("*.rs") if path not in homes]
    calls = {path: with_calls(path.read_text(encoding="utf-8"), visible(path, numbers)) for path in others}
    functions = {path: with_functions(text, path.stem) for path, text in homes.items()}
    functions[rust / "tolerances" / "mod.rs"] += READER
    for path, text in (calls | functions).items():
        path.write_text(text, encoding="utf-8")
