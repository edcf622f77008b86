"""Shares of kinetic and strain energy of modes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.text import Block
from ..results import Result, quantity, result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Sum of energies over the sum of their sizes below which shares are of rounding, and not given. Larger: modes lose their shares. Smaller:
# shares of thousands of percent.
_CANCELLED = 1e-12


@result
class EnergyShares(Result):
    """Shares of the cycle mean of kinetic energy, Re(phi^* (M phi))/phi^H M phi, and likewise of strain energy with K.

    Every column sums to 1; single coordinates may have negative shares where M or K couple them. Strain shares of
    rigid modes are nan. ``kinetic_body`` (n_bodies, n) and ``strain_element`` (n_elements, n) exist for modes of a
    model.
    """

    coordinates: tuple[str, ...]
    kinetic: np.ndarray = quantity(dims=("coordinate", "mode"), unit="1", name="kinetic_coordinate")
    strain: np.ndarray = quantity(dims=("coordinate", "mode"), unit="1", name="strain_coordinate")
    bodies: tuple[str, ...] = ()
    kinetic_body: np.ndarray | None = quantity(dims=("body", "mode"), unit="1", default=None)
    elements: tuple[str, ...] = ()
    strain_element: np.ndarray | None = quantity(dims=("element", "mode"), unit="1", default=None)

    row: ClassVar[str] = "mode"
    axes: ClassVar[Mapping[str, str]] = {
        "mode": "numbers",
        "coordinate": "coordinates",
        "body": "bodies",
        "element": "elements",
    }

    @property
    def numbers(self) -> np.ndarray:
        """(n,) modes counted from 1."""
        return np.arange(1, self.kinetic.shape[1] + 1)

    def parts(self) -> list[tuple[str, tuple[str, ...], np.ndarray]]:
        """Kinetic and strain energy: title, names, shares (n_names, n), of bodies and elements where the model has them."""
        of_bodies = self.kinetic_body is not None
        kinetic = (self.bodies, self.kinetic_body) if of_bodies else (self.coordinates, self.kinetic)
        of_elements = self.strain_element is not None
        strain = (self.elements, self.strain_element) if of_elements else (self.coordinates, self.strain)
        return [("kinetic energy", *kinetic), ("strain energy", *strain)]  # type: ignore[list-item]

    def heading(self) -> str:
        return f"energy shares of {self.kinetic.shape[1]} modes"

    def blocks(self) -> list[Block]:
        columns = ["", *(str(i) for i in self.numbers)]
        return [
            Block(
                columns,
                [[name, *(_percent(v) for v in row)] for name, row in zip(names, values, strict=True)],
                f"{title} [%]",
            )
            for title, names, values in self.parts()
        ]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Shares as coloured cells over the modes; with ``ax`` those of the kinetic energy. Returns the figure."""
        from ..plot.matrices import energy_shares

        return energy_shares(self, ax=ax)


def energy_shares(r: Any) -> EnergyShares:
    x = r.shape

    if hasattr(r.system, "body_motion"):
        return _absolute_shares(r)

    def shares(a: Any) -> np.ndarray:
        parts = (x.conj() * (a @ x)).real
        total = parts.sum(axis=0)
        scale = np.abs(parts).sum(axis=0)
        return np.asarray(
            np.divide(parts, total, out=np.full_like(parts, np.nan), where=np.abs(total) > _CANCELLED * scale)
        )

    kinetic = shares(r.system.M)
    strain = shares(r.system.K)
    strain[:, r.kind == "rigid"] = np.nan
    names, maps = r._bodies()
    energy_of, masses = getattr(r.system, "body_kinetic_energy", None), getattr(r.system, "body_mass_matrices", None)
    per_body = None
    if maps is not None and masses is not None and len(names):
        if energy_of is None:
            v = (maps @ x).reshape(len(names), 6, -1)
            energy = np.einsum("bin,bij,bjn->bn", v.conj(), np.asarray(masses), v).real
        else:
            energy = energy_of(x)
        per_body = energy / energy.sum(axis=0)
    elements, per_element = (), None
    strain_of = getattr(r.system, "element_strain_energy", None)
    if strain_of is not None:
        elements, energy = strain_of(x)
        total = energy.sum(axis=0)
        per_element = np.divide(
            energy, total, out=np.full(energy.shape, np.nan), where=(total > 0.0) & (r.kind != "rigid")
        )
    return EnergyShares(
        r.coordinates, kinetic, strain, names if per_body is not None else (), per_body, elements, per_element
    )


def _absolute_shares(r: Any) -> EnergyShares:
    """Shares of a large model: of bodies and elements, not of coordinates, which have no sparse matrices."""
    kinetic, elements, strain = r.system.energy()
    total = strain.sum(axis=0)
    strain = np.divide(strain, total, out=np.full(strain.shape, np.nan), where=(total > 0.0) & (r.kind != "rigid"))
    none = np.full(r.shape.shape, np.nan)
    return EnergyShares(r.coordinates, none, none, r.system.bodies, kinetic / kinetic.sum(axis=0), elements, strain)


def _percent(share: float) -> str:
    return "-" if math.isnan(share) else f"{100.0 * share:.1f}"
