"""Strains of elastic elements by the coordinates of a linearisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

import numpy as np

from .._lib.border import core_errors
from ..system.snapshot import Snapshot


@dataclass(frozen=True)
class Strains:
    """Strains e = w y of elastic elements side by side: rows w (strains, dof), ``sizes`` of the terms that were added up in their
    entries, gradients (strains, 6) by the relative twist at the element's point (world axes); of each element its name, its bodies
    (2; -1 ground) and its stiffness (k, k).
    """

    names: list[str]
    bodies: np.ndarray
    stiffness: list[np.ndarray]
    gradients: np.ndarray
    rows: np.ndarray
    sizes: np.ndarray

    @cached_property
    def own(self) -> list[slice]:
        """The strains of each element."""
        return own_rows(self.stiffness)


def own_rows(stiffness: Sequence[np.ndarray]) -> list[slice]:
    """The places of each element among the strains of all, by the sizes of the stiffnesses."""
    ends = accumulate(len(k) for k in stiffness)
    return [slice(end - len(k), end) for end, k in zip(ends, stiffness, strict=True)]


def strains_at(
    snapshot: Snapshot, q: np.ndarray, without: Sequence[str], twists: np.ndarray, position: np.ndarray
) -> Strains:
    """Strains at a state by coordinates that give the origins of the bodies these twists (6 n_bodies, dof) and positions (n_bodies, 3),
    world axes.
    """
    with core_errors():
        return Strains(**snapshot.system.strains(q, list(without), twists, position))
