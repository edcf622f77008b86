"""A motion of several incommensurable frequencies: the result of `quasi_periodic`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import shown
from .._lib.text import without_rounding
from ..errors import ModelError
from ..results import Result, derived, quantity, result
from .displacement import displacement_coefficients, label
from .fourier import FourierMotion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .displacement import Displacement
    from .verify_full import Distance


@result
class QuasiPeriodicSolution(FourierMotion, Result):
    """x(t) = a_0 + sum_j a_j cos(phi_j) + b_j sin(phi_j) with phi_j = (k_j . omega) t.

    Attributes
    ----------
    indices
        (n_k, p) index vectors k_j, the first entry that is not zero being positive; the constant term is not among
        them.
    X
        (dof, 2 n_k + 1) coefficients [a_0, a_1, b_1, a_2, b_2, ...].
    omega
        (p,) base frequencies, rad/s.
    error
        Estimate of the truncation error relative to the largest coefficient: one Newton step with more terms and
        samples.
    status
        "converged", or "unresolved" where ``error`` exceeds the tolerance.
    """

    X: np.ndarray
    indices: np.ndarray = quantity(dims=("term", "base"), name="index")
    omega: np.ndarray = quantity(dims=("base",), unit="rad/s")
    n_samples: tuple[int, ...] = ()
    system: Any = field(default=None, repr=False)
    forces: Any = field(default=None, repr=False)
    static: Any = field(default=None, repr=False)

    row: ClassVar[str] = "term"
    axes: ClassVar[Mapping[str, str]] = {"coordinate": "coordinates"}

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(str(c) for c in getattr(self.system, "coordinates", range(len(self.X))))

    @property
    @derived(dims=("coordinate",))
    def mean(self) -> np.ndarray:
        """(dof,) the constant term."""
        return self.X[:, 0]

    @property
    @derived(dims=("coordinate", "term", "part"), name="X")
    def _coefficients(self) -> np.ndarray:
        return np.stack([self.X[:, 1::2], self.X[:, 2::2]], axis=2)

    @property
    @derived(dims=("base",), unit="Hz")
    def frequency(self) -> np.ndarray:
        """Base frequencies, Hz."""
        return self.omega / (2 * np.pi)

    def coefficient(self, dof: Displacement = 0, index: Sequence[int] = (1, 0)) -> complex:
        """a - i b of one term; zero for a term that is not kept. The term -k is the conjugate of k.

        ``dof``: number or name of a coordinate, or, of a model, a motion such as ``body.motion("z")``.
        """
        x = displacement_coefficients(self.X, self.system, dof)
        k = np.asarray(index)
        if k.shape != (len(self.omega),) or not np.issubdtype(k.dtype, np.integer):
            raise ModelError(
                f"index must be {len(self.omega)} integers, one for each base frequency; it is {shown(index)}"
            )
        if not k.any():
            return complex(x[0])
        for sign in (1, -1):
            found = np.flatnonzero(np.all(self.indices == sign * k, axis=1))
            if len(found):
                a, b = x[2 * found[0] + 1 : 2 * found[0] + 3]
                return complex(a, -sign * b)
        return 0j

    def amplitude(self, dof: Displacement = 0, index: Sequence[int] = (1, 0)) -> float:
        """Magnitude of one term of one displacement."""
        return abs(self.coefficient(dof, index))

    def term_frequencies(self) -> np.ndarray:
        """(n_k,) circular frequency of every term, rad/s."""
        return self.indices @ self.omega

    def lines(self, dof: Displacement = 0) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """Frequencies in Hz, amplitudes and index vectors of the terms, by frequency, the mean first."""
        x = displacement_coefficients(self.X, self.system, dof)
        f = np.append(0.0, np.abs(self.indices @ self.frequency))
        size = np.append(abs(x[0]), np.hypot(x[1::2], x[2::2]))
        names = ["", *("(" + ", ".join(str(int(i)) for i in k) + ")" for k in self.indices)]
        order = np.argsort(f, kind="stable")
        return f[order], size[order], [names[i] for i in order]

    def label(self, dof: Displacement = 0) -> str:
        """Name of a displacement."""
        return label(self.system, dof, len(self.X))

    def verify(self, cycles: float = 20.0, rtol: float = 1e-9, *, full: bool | None = None) -> Distance:
        """Integrates from the solution's own state over so many of the longest base periods and returns the largest
        distance relative to the largest displacement; of an unstable motion it tells only that. ``full``, and what the
        number holds: as of `PeriodicSolution.verify`."""
        from .verify import verify_torus

        return verify_torus(self, cycles, rtol, full)

    def plot(self, dof: Displacement = 0, ax: Axes | None = None) -> Figure:
        """Spectrum: amplitude over frequency in Hz, the largest terms named by index; returns the figure."""
        from ..plot.nonlinear import spectrum

        return spectrum(self, dof, ax=ax)

    def plot_orbit(self, dof: Displacement = 0, ax: Axes | None = None) -> Figure:
        """Thirty cycles of the slowest force in time, and velocity over displacement; returns the figure."""
        from ..plot.nonlinear import orbit

        return orbit(self, dof, ax=ax)

    def rows(self, most: int = 12) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the largest terms."""
        size = np.max(np.hypot(self.X[:, 1::2], self.X[:, 2::2]), axis=0)
        moving = np.argsort(-np.linalg.norm(self.X, axis=1), kind="stable")[:3]
        scale = np.abs(self.X[moving]).max(axis=1)
        heads = ["k", "f [Hz]", *(f"|{self.label(int(i))}|" for i in moving)]
        rows: list[list[Any]] = [["0", 0.0, *without_rounding(np.abs(self.X[moving, 0]), scale)]]
        for j in np.argsort(-size, kind="stable")[:most]:
            k = "(" + ", ".join(str(int(i)) for i in self.indices[j]) + ")"
            amplitude = without_rounding([float(np.hypot(*self.X[i, 2 * j + 1 : 2 * j + 3])) for i in moving], scale)
            rows.append([f"k = {k}", float(abs(self.indices[j] @ self.frequency)), *amplitude])
        return heads, rows

    def heading(self) -> str:
        return (
            f"QuasiPeriodicSolution: {self.status}, omega = {', '.join(f'{w:.8g}' for w in self.omega)} rad/s, "
            f"{len(self.indices)} terms, estimated error {self.error:.1e}"
        )

    def notes(self) -> list[str]:
        cut = f"(the largest 12 of {len(self.indices)} terms)" if len(self.indices) > 12 else ""
        poor = "unresolved: the estimated error exceeds the tolerance; take more harmonics"
        return list(filter(None, [cut, poor if self.status == "unresolved" else ""]))
