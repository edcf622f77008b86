"""``mbrs doctor``: what is installed, what it is used for, and whether the core computes what it should."""

from __future__ import annotations

import os
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from .. import _core
from .._lib.text import table
from ..linear.matrices import MechanicalSystem
from ..linear.modes import modes
from ..model.model import Model
from ..motion.simulate import simulate
from ..nonlinear.periodic import harmonic_balance

__all__ = ["Check", "Report", "examine"]

# Rounding of the three self-checks, relative: each is a few thousand operations on well-conditioned numbers. Smaller, another
# BLAS may miss it; larger, a core that lost half its digits would pass (tests/studies/test_doctor.py).
ALLOWED = 1e-9
# Tolerance of the motion of a self-check. Larger: its steps show in what is allowed. Smaller: time.
_FINE = 1e-11

_NEEDED = ("numpy", "scipy", "click", "rich", "matplotlib")
_THREADS = ("RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")
_PACKAGE = "mbrs-dynamics"


@dataclass(frozen=True)
class Check:
    """One small problem with a known answer: relative ``error``, ``seconds`` and, where it failed, ``failure``."""

    name: str
    error: float
    seconds: float
    failure: str = ""

    @property
    def passed(self) -> bool:
        return not self.failure and self.error <= ALLOWED

    @property
    def verdict(self) -> str:
        return self.failure or ("passed" if self.passed else "WRONG")


@dataclass(frozen=True)
class Report:
    """Versions, threads, optional packages and self-checks of one installation; ``print`` gives four tables."""

    machine: dict[str, str]
    versions: dict[str, str]
    extras: dict[str, dict[str, str]]
    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Every package that is needed is there and every self-check gave its answer."""
        return all(self.versions[name] for name in _NEEDED) and all(check.passed for check in self.checks)

    def data(self) -> dict[str, Any]:
        """The same as plain dictionaries, for JSON."""
        checks = [{"name": c.name, "error": c.error, "seconds": c.seconds, "passed": c.passed} for c in self.checks]
        parts = {"machine": self.machine, "versions": self.versions, "extras": self.extras}
        return {**parts, "checks": checks, "passed": self.passed}

    def __str__(self) -> str:
        extras = [
            [extra, name, version or "not installed", "" if version else f"pip install '{_PACKAGE}[{extra}]'"]
            for extra, packages in self.extras.items()
            for name, version in packages.items()
        ]
        checks = [[c.name, f"{c.error:.1e}", f"{c.seconds:.2f}", c.verdict] for c in self.checks]
        parts = [
            table(["machine", ""], [[k, v] for k, v in self.machine.items()]),
            table(["package", "version"], [[k, v or _absent(k)] for k, v in self.versions.items()]),
            table(["extra", "package", "version", "to install"], extras),
            table(["self-check", "relative error", "s", "result"], checks),
            "everything that mbrs needs is here and computes" if self.passed else _REMEDY,
        ]
        return "\n\n".join(parts)


_REMEDY = f"this installation is not sound: reinstall it by pip install --force-reinstall {_PACKAGE}"


def examine() -> Report:
    """Look at the installation; nothing here raises, what fails is in the report."""
    versions = {name: _version(name) for name in (_PACKAGE, *_NEEDED)}
    checks = tuple(_checked(name, problem) for name, problem in _PROBLEMS.items())
    return Report(_machine(), versions, _extras(), checks)


def _absent(name: str) -> str:
    return "not installed: runs from its sources" if name == _PACKAGE else "MISSING"


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


def _machine() -> dict[str, str]:
    threads = ", ".join(f"{name}={os.environ[name]}" for name in _THREADS if name in os.environ)
    memory = _core.available_memory()
    return {
        "system": platform.platform(),
        "processor": platform.machine(),
        "python": f"{platform.python_version()} at {sys.executable}",
        "mbrs": str(Path(__file__).parents[1]),
        "core": _core.__version__,
        "cores": str(os.cpu_count()),
        "threads set": threads or "by nothing: rayon and BLAS take all cores",
        "memory": f"{memory / 2**30:.1f} GiB free" if np.isfinite(memory) else "unknown",
        "BLAS of numpy": _blas(),
    }


def _blas() -> str:
    try:
        found = np.show_config(mode="dicts")["Build Dependencies"]["blas"]  # type: ignore[call-overload, index]
        return f"{found.get('name', '?')} {found.get('version', '')}".strip()
    except (TypeError, KeyError):
        return "unknown"


def _extras() -> dict[str, dict[str, str]]:
    """Packages of each extra with their versions, as the metadata of this installation names them."""
    out: dict[str, dict[str, str]] = {}
    try:
        requirements = metadata.requires(_PACKAGE) or []
    except metadata.PackageNotFoundError:
        return out
    for requirement in requirements:
        name, _, condition = requirement.partition(";")
        _, found, extra = condition.partition("extra ==")
        package = name.split("[")[0].split(">")[0].split("<")[0].split("=")[0].strip()
        if found and package != _PACKAGE:
            out.setdefault(extra.strip(" \"'"), {})[package] = _version(package)
    return out


def _checked(name: str, problem: Callable[[], float]) -> Check:
    start = time.perf_counter()
    try:
        error, failure = problem(), ""
    except Exception as cause:  # a broken installation may fail in any way, and the report is what tells it
        error, failure = float("nan"), f"{type(cause).__name__}: {cause}"
    return Check(name, error, time.perf_counter() - start, failure)


def _modes() -> float:
    """Two masses between three springs: w^2 = k/m and 3 k/m."""
    k, m = 731.0, 2.3
    found = modes(MechanicalSystem(m * np.eye(2), K=k * np.array([[2.0, -1.0], [-1.0, 2.0]]))).frequency
    exact = np.sqrt(np.array([1.0, 3.0]) * k / m) / (2.0 * np.pi)
    return float(np.max(np.abs(np.asarray(found) / exact - 1.0)))


def _motion() -> float:
    """A wheel on a sprung hinge that starts at rest beside its balance: angle = Q/k (1 - cos sqrt(k/I) t)."""
    k, inertia, load, end = 5.3, 0.7, 0.4, 1.9
    m = Model("doctor", gravity=(0.0, 0.0, 0.0))
    wheel = m.body("wheel", mass=1.7, inertia=(inertia, inertia, inertia))
    m.revolute("hinge", m.ground, wheel, at=(0.0, 0.0, 0.0), axis=(0.6, 0.0, 0.8), k=k, preload=load)
    found = simulate(m, t=end, rtol=_FINE).joint("hinge").ravel()[-1]
    exact = load / k * (1.0 - np.cos(np.sqrt(k / inertia) * end))
    return float(abs(abs(found) / exact - 1.0))


def _harmonic_balance() -> float:
    """A linear oscillator by harmonic balance: |X| = F / |k - m w^2 + i c w|."""
    m, c, k, force, omega = 1.3, 0.21, 4.7, 0.37, 1.6
    found = harmonic_balance(MechanicalSystem([[m]], [[c]], [[k]]), force=[force], omega=omega, harmonics=3).amplitude(
        dof=0, harmonic=1
    )
    exact = force / abs(k - m * omega**2 + 1j * c * omega)
    return float(abs(np.ravel(found)[0] / exact - 1.0))


_PROBLEMS: dict[str, Callable[[], float]] = {
    "modes of two masses": _modes,
    "motion of a hinge": _motion,
    "harmonic balance of an oscillator": _harmonic_balance,
}
