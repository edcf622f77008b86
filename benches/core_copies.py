"""Copies of the sources in which the core is changed and built, beside the one that is installed."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("rust", "python", "tests", "benches", "Cargo.toml", "Cargo.lock", "README.md", "pyproject.toml")


def copy_sources(copy: Path) -> None:
    """What a build and the tests need."""
    for name in COPIED:
        source = ROOT / name
        shutil.copytree(source, copy / name) if source.is_dir() else shutil.copy(source, copy / name)


@contextlib.contextmanager
def copied() -> Iterator[Path]:
    """A folder with what a build and the tests need, thrown away at the end."""
    with tempfile.TemporaryDirectory() as folder:
        copy_sources(Path(folder))
        yield Path(folder)


def built(copy: Path) -> dict[str, str]:
    """Builds the core of a copy with little optimisation and puts it beside its package; the environment that finds it."""
    build = ["cargo", "build", "--lib", "--features", "python"]
    environment = {**os.environ, "PYO3_BUILD_EXTENSION_MODULE": "1"}
    subprocess.run(build, cwd=copy, env=environment, capture_output=True, check=True)
    target = Path(os.environ.get("CARGO_TARGET_DIR", copy / "target"))
    shutil.copy(target / "debug" / "libmbrs.so", copy / "python" / "mbrs" / "_core.abi3.so")
    return {**os.environ, "PYTHONPATH": str(copy / "python")}


def build_rust_tests(copy: Path) -> Path:
    """The program of the core's own tests, in the copy."""
    build = ["cargo", "test", "--lib", "--no-run", "--message-format", "json-render-diagnostics"]
    done = subprocess.run(build, cwd=copy, stdout=subprocess.PIPE, text=True, check=True)
    made = (json.loads(line) for line in done.stdout.splitlines() if line.startswith("{"))
    program = next(Path(m["executable"]) for m in made if m.get("executable"))
    return Path(shutil.copy(program, copy / "rust-tests"))
