"""Who may import whom (docs/architecture.md): the layers of the Python package and of the Rust core, and what stays optional."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import mbrs
import pytest

PACKAGE = Path(mbrs.__file__).parent
RUST = PACKAGE.parents[1] / "rust" / "src"

# From the bottom: a module may import its own layer and those below. What is not named belongs to "analyses".
LAYERS = {
    "words": {
        "errors", "jsonable", "files", "progress", "results", "mac", "measures", "_timing", "_checks", "flexible",
        "formats", "matrix_files",
    },
    "model": {"model", "examples", "effects", "shifted_laws"},
    "tables": {"tables"},
    "border": {"_border", "_core", "state", "second_order"},
    "analyses": set(),
    "top": {"records", "result_files", "study", "_effect_study", "cli", "demo", "sweep", "design", "check_gradients", "io"},
}  # fmt: skip
ORDER = list(LAYERS)
# They turn results into pictures and text, and see nothing but results.
SHOWS = {"plot", "animate", "page", "report"}
# What `import mbrs` must not pay for.
OPTIONAL = {
    "scipy", "matplotlib", "xarray", "h5netcdf", "control", "mpmath", "click", "rich", "lxml", "pyuff", "pyyeti", "pandas",
}  # fmt: skip
# A model is compiled through these, imported when asked for; results draw themselves through SHOWS.
LAZY = {("results", "result_files"), ("model", "_core"), ("tables", "_core"), ("examples", "second_order")}


def modules():
    for path in sorted(PACKAGE.rglob("*.py")):
        relative = path.relative_to(PACKAGE).with_suffix("")
        parts = relative.parts[:-1] if relative.name == "__init__" else relative.parts
        yield path, parts, relative.name == "__init__"


def is_module(parts):
    base = PACKAGE.joinpath(*parts)
    return base.with_suffix(".py").exists() or (base / "__init__.py").exists() or parts == ("_core",)


def imports(path, parts, is_package):
    """(target inside the package or None, name outside, at the top of the module) of every import but those for types."""
    home = parts if is_package else parts[:-1]
    found = []

    def visit(node, top):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
                continue
            if isinstance(child, ast.Import):
                found.extend((None, alias.name.split(".")[0], top) for alias in child.names)
            elif isinstance(child, ast.ImportFrom) and child.level:
                base = home[: len(home) - child.level + 1] + tuple(
                    (child.module or "").split(".") if child.module else ()
                )
                for alias in child.names:
                    full = (*base, alias.name)
                    found.append((full if is_module(full) else base, "", top))
            elif isinstance(child, ast.ImportFrom):
                found.append((None, (child.module or "").split(".")[0], top))
            visit(child, top and not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)))

    visit(ast.parse(path.read_text(encoding="utf-8")), True)
    return found


GRAPH = {parts: imports(path, parts, is_package) for path, parts, is_package in modules()}


def layer(parts):
    head = parts[0] if parts else "__init__"
    return next((name for name, members in LAYERS.items() if head in members), "analyses")


def test_the_layers_are_of_this_package():
    heads = {parts[0] for parts in GRAPH if parts} | {"_core"}
    named = set().union(*LAYERS.values()) | SHOWS
    assert named - heads <= {"sweep", "design"}, "the table above names modules that do not exist"
    assert len(GRAPH) > 60


def test_nothing_imports_upwards():
    wrong = []
    for parts, found in GRAPH.items():
        if not parts or parts[0] in SHOWS | {"reference"}:
            continue
        for target, _, top in found:
            if not target or target[0] in SHOWS | {"reference"} or target[0] == parts[0]:
                continue
            lazy = not top and (parts[0], target[0]) in LAZY
            if not lazy and ORDER.index(layer(target)) > ORDER.index(layer(parts)):
                wrong.append(f"{'.'.join(parts)} ({layer(parts)}) imports {'.'.join(target)} ({layer(target)})")
    assert not wrong, "\n".join(wrong)


def all_imports(path, parts):
    """Modules of the package that a module imports anywhere: in functions and for types as well."""
    found = set()
    home = parts[:-1]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = (*home[: len(home) - node.level + 1], *(node.module.split(".") if node.module else ()))
            for alias in node.names:
                found.add((*base, alias.name) if is_module((*base, alias.name)) else base)
    return found - {parts}


def test_the_model_has_no_circle_and_knows_little_else():
    """Every import of model/ counts, those inside functions and those for types included."""
    graph = {
        parts: all_imports(path, parts)
        for path, parts, is_package in modules()
        if parts[:1] == ("model",) and not is_package
    }
    outside = {target[0] for found in graph.values() for target in found if target[:1] != ("model",)}
    assert outside <= {"errors", "_checks", "files", "formats", "flexible", "_core"}, outside
    waiting = {parts: {t for t in found if t in graph} for parts, found in graph.items()}
    assert len(waiting) > 20
    while waiting:
        free = {parts for parts, found in waiting.items() if not found & waiting.keys()}
        assert free, "a circle among " + ", ".join(sorted(".".join(parts) for parts in waiting))
        waiting = {parts: found for parts, found in waiting.items() if parts not in free}


def test_pictures_and_reports_see_results_only():
    allowed = SHOWS | {"errors", "results", "progress", "files"}
    wrong = [
        f"{'.'.join(parts)} imports {'.'.join(target)}"
        for parts, found in GRAPH.items()
        if parts and parts[0] in SHOWS
        for target, _, _ in found
        if target and target[0] not in allowed and target != ("model", "schema")
    ]
    assert not wrong, "\n".join(wrong)


def test_nothing_public_imports_the_reference_and_it_knows_nothing_else():
    for parts, found in GRAPH.items():
        for target, _, _ in found:
            if target and parts and parts[0] == "reference":
                assert target[0] in ("reference", "errors", "matrix_calculus"), (
                    f"{'.'.join(parts)} imports {'.'.join(target)}"
                )
            elif target:
                assert target[0] != "reference", f"{'.'.join(parts)} imports the reference"


def test_extras_are_imported_when_used():
    # the command line and the reference load by themselves, never with the package
    apart = ("cli", "reference")
    found = [
        (parts, name, top)
        for parts, all_ in GRAPH.items()
        for _, name, top in all_
        if parts[:1] not in [(a,) for a in apart] and list(parts[:1]) not in [[a] for a in apart]
    ]
    wrong = [f"{'.'.join(parts)}: {name}" for parts, name, top in found if top and name in OPTIONAL]
    assert not wrong, "imported at the top of a module: " + ", ".join(wrong)


def test_import_mbrs_loads_numpy_and_little_else():
    """Also building and solving a small model needs no plotting, no labelled data and no command line."""
    code = (
        "import sys, mbrs as mb\n"
        f"heavy = {sorted(OPTIONAL)!r}\n"
        "assert not any(name in sys.modules for name in heavy), [n for n in heavy if n in sys.modules]\n"
        "assert 'mbrs.reference' not in sys.modules and 'mbrs._core' not in sys.modules\n"
        "mb.modes(mb.examples.cubic_hexapod()); mb.effects(mb.examples.four_bar())\n"
        "left = [n for n in heavy if n in sys.modules and n != 'scipy']\n"
        "assert not left, left\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_files_have_one_idea():
    long = [
        str(p)
        for p in [*PACKAGE.rglob("*.py"), *RUST.rglob("*.rs")]
        if len(p.read_text(encoding="utf-8").splitlines()) > 600
    ]
    assert not long, f"longer than 600 lines: {long}"


# --- Rust -----

CRATE = {
    "error": set(),
    "tolerances": set(),
    "run": {"error"},
    "memory": {"error"},
    "spatial": set(),
    "linalg": {"error", "tolerances", "run"},
    "laws": {"error", "tolerances"},
    "model": {"error", "tolerances", "spatial", "laws"},
    "kinematics": {"error", "tolerances", "spatial", "laws", "model"},
    "system": {"error", "tolerances", "run", "spatial", "linalg", "laws", "model", "kinematics"},
    "second_order": {"error", "tolerances", "run", "linalg", "laws"},
    "solve": {"error", "tolerances", "run", "linalg"},
    "analysis": {
        "error", "tolerances", "run", "spatial", "linalg", "laws", "model", "kinematics", "system", "second_order", "solve",
    },
}  # fmt: skip


@pytest.mark.skipif(not RUST.is_dir(), reason="an installed package has no Rust sources beside it")
@pytest.mark.parametrize("name", list(CRATE))
def test_the_core_imports_downwards(name):
    files = [RUST / f"{name}.rs"] if (RUST / f"{name}.rs").exists() else sorted((RUST / name).rglob("*.rs"))
    assert files
    for path in files:
        text = path.read_text(encoding="utf-8")
        used = set(re.findall(r"\bcrate::([a-z_]+)", text)) - {name}
        assert used <= CRATE[name], f"{path.relative_to(RUST)} uses {', '.join(sorted(used - CRATE[name]))}"


@pytest.mark.skipif(not RUST.is_dir(), reason="an installed package has no Rust sources beside it")
def test_only_the_border_knows_python():
    declared = set(re.findall(r"^(?:pub )?mod ([a-z_]+);", (RUST / "lib.rs").read_text(encoding="utf-8"), re.M))
    assert declared == {*CRATE, "python"}, "a new module of the crate needs a line in the table above"
    for path in RUST.rglob("*.rs"):
        if "python" not in path.relative_to(RUST).parts:
            assert not re.search(r"\b(pyo3|numpy)::", path.read_text(encoding="utf-8")), path


@pytest.mark.skipif(not RUST.is_dir(), reason="an installed package has no Rust sources beside it")
def test_nothing_in_the_core_panics_on_purpose():
    """No unwrap, expect or panic outside of tests."""
    wrong = []
    for path in RUST.rglob("*.rs"):
        if path.name == "tests.rs":
            continue
        text = path.read_text(encoding="utf-8").split("#[cfg(test)]")[0]
        for pattern in (r"\.unwrap\(\)", r"\.expect\(", r"\bpanic!\(", r"\bunreachable!\(", r"\btodo!\("):
            if re.search(pattern, text):
                wrong.append(f"{path.relative_to(RUST)}: {pattern}")
    assert not wrong, "\n".join(wrong)
