"""Who may import whom (docs/architecture.md): the layers of the Python package and of the Rust core, and what stays optional."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import mbrs
import pytest
from mbrs._lib.names import PUBLIC
from mbrs._lib.records import FUNCTIONS, HOMES

PACKAGE = Path(mbrs.__file__).parent
RUST = Path(__file__).parents[1] / "rust" / "src"

# From the bottom. A module may import what is in its own folder and in those before it, wherever the import stands: at the top, in a
# function, for types only, by importlib. There is no exception.
ORDER = (
    "errors", "_core", "_lib", "results", "solvers", "view", "plot", "flexible", "model", "system", "linear", "aero", "motion",
    "nonlinear", "gradients", "design", "reference", "studies", "examples", "io", "__init__", "cli",
)  # fmt: skip
# Folders whose names are public, such as `mb.plot.frf`. All others export nothing, so that `import mbrs.linear.frf` means one thing.
NAMESPACES = {"aero", "design", "examples", "flexible", "plot", "reference"}
# What `import mbrs` must not pay for.
OPTIONAL = {
    "scipy",
    "matplotlib",
    "xarray",
    "h5netcdf",
    "control",
    "mpmath",
    "click",
    "rich",
    "lxml",
    "pyuff",
    "pyyeti",
    "pandas",
    "trimesh",
    "meshio",
    "pint",
}
# Imports by a name in a variable: which module makes them, and the names. Names of users' functions are of users' modules.
BY_NAME = {
    ("__init__",): lambda: [
        *PUBLIC.values(),
        *mbrs._MODULES.values(),
        *(".".join(parts) for parts in FILES if parts[0] == "io"),  # by their place in the folder
    ],
    ("io", "results"): lambda: [*HOMES.values(), *FUNCTIONS.values()],
    ("model", "motions"): lambda: [],
    ("design", "study"): lambda: [],
}


def modules():
    for path in sorted(PACKAGE.rglob("*.py")):
        relative = path.relative_to(PACKAGE).with_suffix("")
        parts = relative.parts[:-1] if relative.name == "__init__" and len(relative.parts) > 1 else relative.parts
        yield path, parts, relative.name == "__init__"


FILES = {parts: (path, is_package) for path, parts, is_package in modules()}


def module_of(parts):
    """The module that a dotted name of the package lies in; the package itself for names that it offers."""
    for n in range(len(parts), 0, -1):
        if parts[:n] in FILES or parts[:n] == ("_core",):
            return parts[:n]
    return ("__init__",)


def called(call):
    """The last name of what a call calls."""
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def imports(parts):
    """(target in the package or None, name outside it, whether at the top of the module) of every import of a module."""
    path, is_package = FILES[parts]
    home = () if parts == ("__init__",) else parts if is_package else parts[:-1]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = []

    def visit(node, top):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Import):
                for name in (tuple(alias.name.split(".")) for alias in child.names):
                    found.append((module_of(name[1:]) if name[0] == "mbrs" else None, name[0], top))
            elif isinstance(child, ast.ImportFrom):
                base = tuple(child.module.split(".")) if child.module else ()
                if child.level:
                    base = home[: len(home) - child.level + 1] + base
                elif base[0] != "mbrs":
                    found.append((None, base[0], top))
                    continue
                else:
                    base = base[1:]
                found.extend((module_of((*base, alias.name)), "mbrs", top) for alias in child.names)
            elif isinstance(child, ast.Call) and called(child) in ("import_module", "__import__"):
                named = BY_NAME.get(parts, lambda: ["cli"])()  # what is not listed counts as an import of everything
                found.extend((module_of(tuple(name.split("."))), "mbrs", False) for name in named)
            types = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)
            visit(child, top and not types and not isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)))

    visit(tree, True)
    return found


@cache
def graph():
    """Every file's imports; read when a test asks, in one of the processes that run tests."""
    return {parts: imports(parts) for parts in FILES}


@cache
def inside():
    """The files of the package that each imports."""
    return {parts: {target for target, _, _ in found if target and target != parts} for parts, found in graph().items()}


def test_every_folder_has_its_place_in_the_order():
    assert {parts[0] for parts in FILES} <= set(ORDER), "name the new folder in ORDER, and in docs/architecture.md"
    assert len(FILES) > 150 and sum(map(len, inside().values())) > 800


def test_folders_import_those_before_them():
    wrong = [
        f"{'.'.join(parts)} imports {'.'.join(target)}"
        for parts, targets in inside().items()
        for target in targets
        if ORDER.index(target[0]) > ORDER.index(parts[0])
    ]
    assert not wrong, "\n".join(wrong)


def without_ends(graph):
    """A graph without the files that import nothing in it, and their importers in turn: circles, and what hangs on them."""
    waiting = dict(graph)
    while free := {parts for parts, targets in waiting.items() if not targets & waiting.keys()}:
        waiting = {parts: targets for parts, targets in waiting.items() if parts not in free}
    return waiting


def test_no_file_imports_itself_through_others():
    left = without_ends(inside())
    back = {parts: {one for one, targets in left.items() if parts in targets} for parts in left}
    circles = sorted(".".join(parts) for parts in without_ends(back))
    assert not circles, "a circle among " + ", ".join(circles)


def test_folders_export_nothing_but_public_namespaces():
    for parts, (path, is_package) in FILES.items():
        if is_package and parts != ("__init__",) and parts[0] not in NAMESPACES:
            body = ast.parse(path.read_text(encoding="utf-8")).body
            assert len(body) == 1 and isinstance(body[0], ast.Expr), f"{path} holds more than its docstring"


def test_names_of_modules_mean_modules():
    """`import mbrs.a.b as b` gives the module, whatever was imported before: no folder gives that name to anything else."""
    for name in dir(mbrs):
        getattr(mbrs, name)
    for parts in FILES:
        if parts != ("__init__",) and parts[0] != "reference":
            module = importlib.import_module("mbrs." + ".".join(parts))
            found = mbrs
            for part in parts:
                found = getattr(found, part)
            assert found is module, f"mbrs.{'.'.join(parts)} is {found!r}"


def test_the_model_knows_little_else():
    outside = {t[0] for parts, targets in inside().items() if parts[0] == "model" for t in targets} - {"model"}
    assert outside <= {"errors", "_lib", "flexible", "view", "plot", "_core"}, outside


def test_pictures_see_results_only():
    outside = {t[0] for parts, targets in inside().items() if parts[0] in ("plot", "view") for t in targets}
    assert outside <= {"errors", "_lib", "results", "plot", "view"}, outside


def test_the_comparison_alone_imports_the_reference_and_that_knows_nothing_else():
    for parts, found in graph().items():
        if parts == ("studies", "compare"):
            continue
        for target, _, _ in found:
            if target and parts[0] == "reference":
                assert target[0] in ("reference", "errors", "_lib"), f"{'.'.join(parts)} imports {'.'.join(target)}"
            elif target and parts != ("__init__",):
                assert target[0] != "reference", f"{'.'.join(parts)} imports the reference"


def test_extras_are_imported_when_used():
    # the command line and the reference load by themselves, never with the package
    apart = ("cli", "reference")
    found = [(parts, name, top) for parts, all_ in graph().items() if parts[0] not in apart for _, name, top in all_]
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
    "ad": {"spatial"},
    "linalg": {"error", "tolerances", "run"},
    "solve": {"error", "tolerances", "run", "linalg"},
    "expressions": {"error", "spatial"},
    "aero": {"error", "tolerances", "run", "spatial", "solve"},
    "force": {"error", "tolerances", "spatial", "expressions"},
    "joint": {"error", "spatial"},
    "model": {"error", "tolerances", "spatial", "expressions", "aero", "force", "joint"},
    "kinematics": {"spatial", "joint"},
    "multibody": {"error", "tolerances", "run", "spatial", "linalg", "aero", "force", "joint", "model", "kinematics"},
    "constraint": {"error", "tolerances", "run", "spatial", "linalg", "joint", "model", "kinematics", "multibody"},
    "second_order": {"error", "tolerances", "run", "linalg"},
    "linearize": {
        "error", "tolerances", "run", "spatial", "linalg", "joint", "model", "multibody", "constraint",
        "second_order",
    },
    "integrate": {
        "error", "tolerances", "run", "spatial", "linalg", "solve", "aero", "force", "joint", "model", "kinematics",
        "multibody", "constraint",
    },
    "equilibrium": {"error", "tolerances", "run", "spatial", "multibody", "constraint", "linearize", "integrate"},
    "periodic": {"error", "tolerances", "run", "linalg", "solve", "force", "second_order"},
    "sensitivity": {
        "error", "tolerances", "run", "spatial", "ad", "linalg", "aero", "force", "joint", "model", "kinematics",
        "multibody", "constraint", "linearize", "integrate", "equilibrium",
    },
    "designs": {
        "error", "tolerances", "run", "spatial", "linalg", "expressions", "model", "multibody", "constraint",
        "second_order", "linearize", "equilibrium", "sensitivity",
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
