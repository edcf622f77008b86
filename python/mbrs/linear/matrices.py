"""Second-order linear systems: what every linear and harmonic-balance analysis sees, whoever made the matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._lib.border import core_errors, require_memory
from .._lib.checks import is_list, names, real_array, shown
from .._lib.formats import Omission, warn_of_omissions
from .._lib.matrix_files import choose, read_matrices, write_matrices
from ..errors import ModelError

if TYPE_CHECKING:
    from pathlib import Path

    from .._lib.aliases import Matrix
    from ..model.law import Law


# Effects of a system that is given by matrices, and the matrices that hold them.
EFFECT_OF = {"C": "damping", "G": "gyroscopic", "N": "circulatory"}
_MATRICES = ("M", "C", "K", "G", "N")
_DENSE_LIMIT = 3000


def check_matrix_effects(without: Sequence[str]) -> None:
    """Raise unless these are effects that matrices alone can be without."""
    for name in without:
        if name not in EFFECT_OF.values():
            raise ModelError(f"without={name!r}: the effects of a MechanicalSystem are {', '.join(EFFECT_OF.values())}")


def dense(a: Any) -> np.ndarray:
    """A matrix as a NumPy array; refuses what would not fit sensibly."""
    if hasattr(a, "toarray"):
        if a.shape[0] > _DENSE_LIMIT:
            raise ModelError(
                f"a sparse system of {a.shape[0]} coordinates is too large for dense work (limit {_DENSE_LIMIT}): "
                "reduce it to its lowest modes first (mb.modes(system, n=...))"
            )
        a = a.toarray()
    return np.asarray(a, dtype=float)


def _is_sparse(a: Any) -> bool:
    return hasattr(a, "tocsc")


class MechanicalSystem:
    """A user's own matrices: M x" + (C + G) x' + (K + N) x + sum_e w_e law_e(w_e . x, w_e . x') = f(t).

    The matrices are copied and stay as they are; what analyses derive from them is computed once. Other numbers make another system.

    Parameters
    ----------
    M, C, K
        Mass, damping and stiffness, (n, n) each, dense or `scipy.sparse`; ``C`` may be None. Any consistent units.
    G, N
        Gyroscopic (skew) and circulatory (skew) matrices, or None.
    elements
        Local nonlinear elements such as ``mb.Cubic(0.1, w=[1.0])``; only the nonlinear analyses use them.
    coordinates
        Names of the n coordinates; ``x0, x1, ...`` by default.

    Raises
    ------
    ModelError
        A matrix that is not square, not finite or not of the size of ``M``.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.MechanicalSystem(M=[[1.0]], C=[[0.05]], K=[[1.0]]).n
    1
    """

    def __init__(
        self,
        M: Matrix,
        C: Matrix | None = None,
        K: Matrix | None = None,
        *,
        G: Matrix | None = None,
        N: Matrix | None = None,
        elements: Sequence[Law] = (),
        coordinates: Sequence[str] | None = None,
    ) -> None:
        if K is None:
            raise ModelError("MechanicalSystem needs a stiffness matrix K; pass zeros if there is none")
        self.M = _checked("M", M, None)
        self.n: int = self.M.shape[0]
        self.K = _checked("K", K, self.n)
        self.C = None if C is None else _checked("C", C, self.n)
        self.G = None if G is None else _checked("G", G, self.n)
        self.N = None if N is None else _checked("N", N, self.n)
        if not is_list(elements):
            raise ModelError(f"elements= takes a list of laws with their w=, got {shown(elements)}")
        self.elements = tuple(elements)
        words = tuple(f"x{i}" for i in range(self.n)) if coordinates is None else names("coordinates", coordinates)
        if len(words) != self.n or len(set(words)) != self.n:
            raise ModelError(f"coordinates must be {self.n} different names, got {len(words)}")
        self.coordinates = words

    # laws of a model have states that relax; those of matrices have none
    states: ClassVar[None] = None

    def __setattr__(self, name: str, value: object) -> None:
        if name in _MATRICES and name in self.__dict__:
            raise AttributeError(f"{name} of a MechanicalSystem stays as it is; make another system of other matrices")
        super().__setattr__(name, value)

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k not in ("core", "_without")}

    @cached_property
    def core(self) -> _core.SecondOrder:
        """The matrices as dense ones of the core, with all that is derived from them."""
        C, G, N = (None if a is None else dense(a) for a in (self.C, self.G, self.N))
        with core_errors():
            return _core.SecondOrder(dense(self.M), C, G, dense(self.K), N)

    def leaving_out(self, names: frozenset[str]) -> MechanicalSystem:
        """The same system without those of C, G and N that are named; made once."""
        names &= {a for a in EFFECT_OF if getattr(self, a) is not None}
        if not names:
            return self
        made: dict[frozenset[str], MechanicalSystem] = self.__dict__.setdefault("_without", {})
        if names not in made:
            parts: dict[str, Any] = {a: None if a in names else getattr(self, a) for a in _MATRICES}
            made[names] = MechanicalSystem(**parts, elements=self.elements, coordinates=self.coordinates)
        return made[names]

    @staticmethod
    def load(path: str | Path, names: Mapping[str, str] | None = None) -> MechanicalSystem:
        """A system from a file of matrices: ``.op4``, ``.pch`` (DMIG), ``.mtx``, ``.mat`` (docs/files.md).

        Parameters
        ----------
        path
            Of a file, or ``{"M": path, "K": path, ...}`` where each has one matrix.
        names
            ``{"M": name in the file, ...}``; by default the usual ones (M, MASS, MAA, K, KAA, BAA, ...).

        Raises
        ------
        ModelError
            No such file, no such matrix (the message lists those in the file), or a file that is damaged.
        """
        found = read_matrices(path)
        labels = None if found.rows is None else [f"{node}:{component}" for node, component in found.rows]
        return MechanicalSystem(**choose(found, "MCKGN", names, path), coordinates=labels)

    def save(self, path: str | Path) -> Path:
        """Write M, K and what else there is (``.op4``, ``.mtx``, ``.mat``); `load` brings the same numbers back. Returns the path.

        Warns
        -----
        OmissionWarning
            Nonlinear elements and names of coordinates, which such files do not hold.
        """
        done = write_matrices({n: a for n in "MCKGN" if (a := getattr(self, n)) is not None}, path)
        lost = [Omission(type(e).__name__, "nonlinear elements") for e in self.elements]
        lost += [Omission(name, "names of coordinates") for i, name in enumerate(self.coordinates) if name != f"x{i}"]
        warn_of_omissions(Path(path).name, lost)
        return done

    @property
    def is_sparse(self) -> bool:
        """True where any matrix came as `scipy.sparse`."""
        return any(_is_sparse(a) for a in (self.M, self.C, self.K, self.G, self.N))

    def __repr__(self) -> str:
        present = ", ".join(name for name in "MCGKN" if getattr(self, name) is not None)
        return f"MechanicalSystem(n={self.n}, {present}, {len(self.elements)} elements)"


def _checked(name: str, a: Any, n: int | None) -> Any:
    if _is_sparse(a):
        a = a.tocsc()
        a.data = real_array(name, a.data)
        a.sum_duplicates()
    else:
        if isinstance(a, np.ndarray):
            # three of its size: the copy, its checks, and what the first analysis makes of it
            what = f"a dense {name} of {a.shape[0] if a.ndim else 1} coordinates"
            require_memory(3.0 * 8.0 * a.size, what, "give it as a scipy.sparse matrix, or reduce the system")
        a = real_array(name, a, None, "give a square matrix")
    if a.ndim != 2 or a.shape[0] != a.shape[1] or a.shape[0] == 0:
        raise ModelError(f"{name} must be a square matrix, its shape is {a.shape}")
    if n is not None and a.shape[0] != n:
        raise ModelError(f"{name} is {a.shape[0]} x {a.shape[1]} but M is {n} x {n}")
    (a.data if _is_sparse(a) else a).flags.writeable = False
    return a
