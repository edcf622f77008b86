"""Shares of kinetic and strain energy of modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ._modal_table import table


@dataclass(frozen=True, eq=False)
class EnergyShares:
    """Shares of the cycle mean of kinetic energy, Re(phi^* (M phi))/phi^H M phi, and likewise of strain energy with K.

    Every column sums to 1; single coordinates may have negative shares where M or K couple them. Strain shares of
    rigid modes are nan. ``kinetic_body`` (n_bodies, n) and ``strain_element`` (n_elements, n) exist for modes of a
    model.
    """

    coordinates: tuple[str, ...]
    kinetic: np.ndarray
    strain: np.ndarray
    bodies: tuple[str, ...] = ()
    kinetic_body: np.ndarray | None = None
    elements: tuple[str, ...] = ()
    strain_element: np.ndarray | None = None

    def __str__(self) -> str:
        kinetic = self.kinetic if self.kinetic_body is None else self.kinetic_body
        names = self.coordinates if self.kinetic_body is None else self.bodies
        blocks = [("kinetic energy [%]", names, kinetic)]
        if self.strain_element is None:
            blocks.append(("strain energy [%]", self.coordinates, self.strain))
        else:
            blocks.append(("strain energy [%]", self.elements, self.strain_element))
        columns = ["", *(str(i + 1) for i in range(kinetic.shape[1]))]
        parts = []
        for title, rows, values in blocks:
            text = [[name, *(f"{100.0 * v:.1f}" for v in row)] for name, row in zip(rows, values, strict=True)]
            parts.append(title + "\n" + table(columns, text))
        return "\n".join(parts)


def energy_shares(r: Any) -> EnergyShares:
    x = r.shape

    if hasattr(r.system, "body_motion"):
        return _absolute_shares(r)

    def shares(a: Any) -> np.ndarray:
        parts = (x.conj() * (a @ x)).real
        total = parts.sum(axis=0)
        scale = np.abs(parts).sum(axis=0)
        return np.divide(parts, total, out=np.full_like(parts, np.nan), where=np.abs(total) > 1e-12 * scale)

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
