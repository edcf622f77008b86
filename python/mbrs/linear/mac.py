"""Modal assurance criterion: how alike two sets of shapes are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import complex_array, real_array
from ..errors import ModelError

if TYPE_CHECKING:
    from .aliases import Matrix, Shapes


def mac(a: Shapes, b: Shapes, *, weight: Matrix | None = None) -> np.ndarray:
    """MAC_ij = |a_i^H W b_j|^2 / ((a_i^H W a_i) (b_j^H W b_j)): 1 for the same shape, 0 for orthogonal ones.

    Parameters
    ----------
    a, b
        `ModalResult`, or shapes as columns, (dof, n_a) and (dof, n_b), over the same coordinates.
    weight
        Symmetric weight W, (dof, dof), often the mass matrix. None takes the unit matrix; coordinates of different
        units (m and rad) then enter as their plain numbers.

    Returns
    -------
    numpy.ndarray
        (n_a, n_b), entries in [0, 1]; 0 where a shape is zero.

    Raises
    ------
    ModelError
        Shapes over different coordinates, or a weight of another size.

    Notes
    -----
    Equations: docs/theory.md (6.10).
    R. J. Allemang and D. L. Brown, "A correlation coefficient for modal vector analysis",
    Proc. 1st Int. Modal Analysis Conf., 1982, 110-116.
    Cost O(dof n_a n_b).

    Examples
    --------
    >>> import numpy as np
    >>> mac(np.eye(2), np.array([[1.0, 1.0], [0.0, 1.0]]))
    array([[1. , 0.5],
           [0. , 0.5]])
    """
    x, y = _shapes(a), _shapes(b)
    if x.shape[0] != y.shape[0]:
        raise ModelError(
            f"mac: the shapes have {x.shape[0]} and {y.shape[0]} coordinates; compare results of one model"
        )
    names = [getattr(r, "coordinates", None) for r in (a, b)]
    if names[0] and names[1] and tuple(names[0]) != tuple(names[1]):
        raise ModelError("mac: the two results name their coordinates differently; compare results of one model")
    wy = y if weight is None else _weight(weight, len(x)) @ y
    wx = x if weight is None else _weight(weight, len(x)) @ x
    product = np.abs(x.conj().T @ wy) ** 2
    size = np.outer(np.einsum("ij,ij->j", x.conj(), wx).real, np.einsum("ij,ij->j", y.conj(), wy).real)
    return np.asarray(np.divide(product, size, out=np.zeros_like(product), where=size > 0.0))


def _shapes(a: Any) -> np.ndarray:
    give = "give modal results, or shapes as columns (dof, n)"
    x = complex_array("mac: shapes", getattr(a, "shape") if hasattr(a, "eigenvalue") else a, None, give)  # noqa: B009 - an array has a shape as well
    return complex_array("mac: shapes", x[:, None] if x.ndim == 1 else x, ("dof", "n"), give)


def _weight(weight: Any, n: int) -> np.ndarray:
    return real_array("mac: weight", weight, (n, n), "give a matrix such as M, or leave it out")
