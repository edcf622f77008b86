"""Derivatives of matrices by matrices in Vetter's block layout, and the rules they obey.

The derivative of A (p, q) by B (s, t) is the block matrix dA/dB = [dA/db_ij] of (p s, q t): the place of a block says
which entry of B, the place within the block which entry of A. `vetter` makes it from an array that ends in the shape
of B, as derivatives come everywhere else in this package; `entries` takes it apart again.

Sources: W. J. Vetter, SIAM Review 15 (1973) 352-369; J. W. Brewer, IEEE Trans. Circuits and Systems 25 (1978)
772-781; equation numbers in brackets are those of Y. Zhang, S. Chen and Q. Liu, Mechanics Research Communications 21 (1994) 223-230;
docs/theory.md (10.1) to (10.6) has them without misprints.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError, NotDifferentiableError
from .checks import shown

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = [
    "COMPLEX_STEP",
    "Derivative",
    "chain_rule",
    "chain_rule_columns",
    "cs",
    "derivative",
    "entries",
    "inverse_rule",
    "kron",
    "kron_rule",
    "permutation",
    "product_rule",
    "rs",
    "unit",
    "vetter",
]

# Small enough that its square vanishes in double precision, large enough never to underflow.
COMPLEX_STEP = 1e-40
# Step of the difference that looks for a function that is not analytic, over the entry, or the largest where it is zero; part of the change
# in proportion that is seen. Larger: extrema are taken for what is not analytic; what changes little is not seen. Smaller: rounding is.
_STEP, _SEEN = 1e-5, 1e-3
# Rounding of a function, over its largest entry. Larger: entries that are small beside others are not looked at. Smaller: rounding is seen.
_ROUNDING = 1e-13


def _matrix(a: Any, name: str) -> np.ndarray:
    try:
        out = np.asarray(a)
    except ValueError:
        raise ModelError(f"{name} must be a matrix, got rows of different lengths") from None
    if out.dtype.kind not in "biufc":
        raise ModelError(f"{name} must be a matrix of numbers, got {type(a).__name__}")
    if out.ndim == 0:
        return out.reshape(1, 1)
    if out.ndim == 1:
        return out[:, None]
    if out.ndim != 2:
        raise ModelError(f"{name} must be a matrix, got an array of shape {out.shape}")
    return out


def _shape(shape: Sequence[int], name: str = "shape") -> tuple[int, int]:
    try:
        s = tuple(operator.index(n) for n in shape)
    except TypeError:
        raise ModelError(f"{name} must be a shape such as (2, 3), got {shown(shape)}") from None
    if len(s) > 2 or any(n < 1 for n in s):
        raise ModelError(f"{name} must be the shape of a number, vector or matrix, got {tuple(shape)}")
    return (1, 1) if not s else (s[0], 1) if len(s) == 1 else (s[0], s[1])


def _blocks(d: Any, s: int, t: int, name: str) -> tuple[np.ndarray, int, int]:
    out = _matrix(d, name)
    if out.shape[0] % s or out.shape[1] % t:
        raise ModelError(f"{name} of shape {out.shape} does not consist of {s} x {t} equal blocks; check of=")
    return out, out.shape[0] // s, out.shape[1] // t


def kron(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """The Kronecker product: block (i, k) is a_ik b. (p, q) and (r, u) give (p r, q u); O(p q r u)."""
    return np.kron(_matrix(a, "a"), _matrix(b, "b"))


def unit(i: int, k: int, p: int, q: int) -> np.ndarray:
    """E_ik = e_i e_k^T of (p, q), eq. 1; i and k count from 0."""
    rows, columns = _shape((p, q), "p, q")
    if not (0 <= i < rows and 0 <= k < columns):
        raise ModelError(f"there is no entry ({i}, {k}) in a matrix of {rows} x {columns}, counted from 0")
    out = np.zeros((rows, columns))
    out[i, k] = 1.0
    return out


def permutation(p: int, q: int) -> np.ndarray:
    """U of (p q, p q) with A kron C = U_pr (C kron A) U_uq for A (p, q), C (r, u); eq. 3.

    U = sum_i sum_k E_ik(p, q) kron E_ki(q, p).

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.matrix_calculus.permutation(1, 3)
    array([[1., 0., 0.],
           [0., 1., 0.],
           [0., 0., 1.]])
    """
    p, q = _shape((p, q), "p, q")
    out = np.zeros((p * q, q * p))
    i, k = np.divmod(np.arange(p * q), q)
    out[i * q + k, k * p + i] = 1.0
    return out


def cs(a: ArrayLike) -> np.ndarray:
    """The column string (p q, 1): the columns one below the other, eq. 4."""
    return _matrix(a, "a").reshape(-1, 1, order="F")


def rs(a: ArrayLike) -> np.ndarray:
    """The row string (1, p q): the rows side by side, eq. 5."""
    return _matrix(a, "a").reshape(1, -1)


def vetter(d: ArrayLike, of: Sequence[int], value_ndim: int | None = None) -> np.ndarray:
    """Block layout of a derivative that ends in the shape of the parameter; eq. 6.

    Parameters
    ----------
    d
        (..., value shape, parameter shape).
    of
        Shape of the parameter: (), (s,) or (s, t).
    value_ndim
        How many axes the value has: 0, 1 (a column) or 2. Leading axes (time) stay in front. By default
        all axes, at most two.

    Returns
    -------
    ndarray
        (..., p s, q t), block (i, j) the derivative by entry (i, j).

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> mb.matrix_calculus.vetter(np.arange(12.0).reshape(2, 2, 3), (2, 3), 1)[:, 0]    # of a vector by a matrix
    array([0., 6., 3., 9.])
    """
    s, t = _shape(of, "of")
    array, n = np.asarray(d), len(tuple(of))
    lead = array.ndim - n
    if lead < 0 or array.shape[lead:] != tuple(of):
        raise ModelError(f"the derivative of shape {array.shape} does not end in the parameter's shape {tuple(of)}")
    k = min(lead, 2) if value_ndim is None else value_ndim
    if not 0 <= k <= min(2, lead):
        raise ModelError(f"a value of {value_ndim} axes does not fit a derivative of shape {array.shape}")
    front = array.shape[: lead - k]
    p, q = _shape(array.shape[lead - k : lead], "the value")
    out = array.reshape(*front, p, q, s, t)
    m = len(front)
    return np.transpose(out, (*range(m), m + 2, m, m + 3, m + 1)).reshape(*front, s * p, t * q)


def entries(d: ArrayLike, of: Sequence[int]) -> np.ndarray:
    """The inverse of `vetter`: from (p s, q t) to (p, q, s, t)."""
    s, t = _shape(of, "of")
    out, p, q = _blocks(d, s, t, "the derivative")
    return out.reshape(s, p, t, q).transpose(1, 3, 0, 2)


class Derivative(np.ndarray):
    """An array that ends in the shape of a parameter and knows it; `vetter` gives the block layout."""

    parameter_shape: tuple[int, ...] = ()
    value_ndim: int = 0

    @classmethod
    def of(cls, array: ArrayLike, parameter_shape: Sequence[int], value_ndim: int) -> Derivative:
        """View an array (..., value, parameter) as a derivative."""
        out = np.asarray(array).view(cls)
        out.parameter_shape, out.value_ndim = tuple(parameter_shape), value_ndim
        return out

    def __array_finalize__(self, source: Any) -> None:
        self.parameter_shape = getattr(source, "parameter_shape", ())
        self.value_ndim = getattr(source, "value_ndim", 0)

    def __reduce__(self) -> Any:
        return _rebuilt, (np.asarray(self), self.parameter_shape, self.value_ndim)

    def vetter(self) -> np.ndarray:
        """Vetter's block layout (..., p s, q t)."""
        return vetter(np.asarray(self), self.parameter_shape, min(self.value_ndim, 2))


def _rebuilt(array: np.ndarray, shape: tuple[int, ...], value_ndim: int) -> Derivative:
    return Derivative.of(array, shape, value_ndim)


def derivative(f: Callable[[np.ndarray], Any], b: ArrayLike) -> np.ndarray:
    """dA/dB in block layout of a function that accepts complex matrices, by complex steps; s t calls.

    Entries of B without any effect are tried by a difference, too.

    Raises
    ------
    NotDifferentiableError
        A function that is not analytic (abs, np.linalg.norm, conjugates) and so has no slope where it changes.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> mb.matrix_calculus.derivative(lambda b: b @ b, np.array([[3.0]]))
    array([[6.]])
    """
    if not callable(f):
        raise ModelError(f"f must be a function of a matrix, got {shown(f)}")
    start = np.real(_matrix(b, "b")).astype(float).reshape(np.shape(b))
    s, t = _shape(start.shape, "b")
    flat = start.reshape(s, t)
    rows = []
    for i in range(s):
        row = []
        for j in range(t):
            moved = flat.astype(complex)
            moved[i, j] += 1j * COMPLEX_STEP
            slope = _matrix(f(moved.reshape(start.shape)), "the value of f").imag / COMPLEX_STEP
            if not np.any(slope):
                _silent(f, start, i * t + j)
            row.append(slope)
        rows.append(row)
    return np.block(rows)


def _silent(f: Callable[[np.ndarray], Any], b: np.ndarray, k: int) -> None:
    """An entry without slopes must leave the function as it is, to first order."""
    step = _STEP * (abs(float(b.ravel()[k])) or float(np.abs(b).max()) or 1.0)

    def ends(step: float) -> list[np.ndarray]:
        moved = np.array([b, b])
        moved.reshape(2, -1)[:, k] += (step, -step)
        return [_matrix(f(x), "the value of f") for x in moved]

    low, high = ends(step)
    size = np.maximum(np.abs(low), np.abs(high))
    change = np.abs(high - low)
    seen = change > _SEEN * _STEP * size + _ROUNDING * np.max(size)
    if not np.any(seen):
        return
    low, high = ends(0.5 * step)
    part = change / np.maximum(np.abs(high - low), np.finfo(float).tiny)
    if np.any(seen & (part > 1.5) & (part < 3.0)):  # in proportion to the step
        raise NotDifferentiableError(
            "complex steps through f give zero where f changes: it is not analytic. Avoid abs, np.linalg.norm, conjugates and .real; "
            "write np.sqrt(np.sum(x**2))"
        )


def product_rule(a: ArrayLike, da: ArrayLike, d: ArrayLike, dd: ArrayLike, of: Sequence[int]) -> np.ndarray:
    """d(A D)/dB = dA/dB (I_t kron D) + (I_s kron A) dD/dB, eq. 7.

    Parameters
    ----------
    a, d
        (p, q) and (q, u).
    da, dd
        Their derivatives by B, (p s, q t) and (q s, u t).
    of
        Shape of B.
    """
    s, t = _shape(of, "of")
    left, right = _matrix(a, "a"), _matrix(d, "d")
    _fits(da, left, s, t, "da")
    _fits(dd, right, s, t, "dd")
    if left.shape[1] != right.shape[0]:
        raise ModelError(f"a of {left.shape} and d of {right.shape} have no product")
    return np.asarray(da) @ np.kron(np.eye(t), right) + np.kron(np.eye(s), left) @ np.asarray(dd)


def kron_rule(a: ArrayLike, da: ArrayLike, c: ArrayLike, dc: ArrayLike, of: Sequence[int]) -> np.ndarray:
    """d(A kron C)/dB = dA/dB kron C + (I_s kron U_pr)(dC/dB kron A)(I_t kron U_uq), eq. 8; A (p, q), C (r, u)."""
    s, t = _shape(of, "of")
    left, right = _matrix(a, "a"), _matrix(c, "c")
    _fits(da, left, s, t, "da")
    _fits(dc, right, s, t, "dc")
    (p, q), (r, u) = left.shape, right.shape
    outer = np.kron(np.eye(s), permutation(p, r)), np.kron(np.eye(t), permutation(u, q))
    return np.kron(np.asarray(da), right) + outer[0] @ np.kron(np.asarray(dc), left) @ outer[1]


def chain_rule(da_dc: ArrayLike, dc: ArrayLike, a: Sequence[int], c: Sequence[int], of: Sequence[int]) -> np.ndarray:
    """dA(C(B))/dB = (I_s kron dA/d rs C)(d(rs C)^T/dB kron I_q), eq. 9, first form.

    Parameters
    ----------
    da_dc
        dA/dC in block layout.
    dc
        dC/dB in block layout.
    a, c, of
        Shapes of A, C and B.
    """
    (p, q), (r, u), (s, t) = _shape(a, "a"), _shape(c, "c"), _shape(of, "of")
    _fits(da_dc, np.empty((p, q)), r, u, "da_dc")
    _fits(dc, np.empty((r, u)), s, t, "dc")
    by_row = entries(da_dc, (r, u)).reshape(p, q, r * u)
    along = entries(dc, (s, t)).reshape(r * u, s, t)
    outer = np.kron(np.eye(s), vetter(by_row[:, :, None, :], (1, r * u), 2))
    return outer @ np.kron(vetter(along[:, None], (s, t), 2), np.eye(q))


def chain_rule_columns(
    da_dc: ArrayLike, dc: ArrayLike, a: Sequence[int], c: Sequence[int], of: Sequence[int]
) -> np.ndarray:
    """dA(C(B))/dB = (d(cs C)^T/dB kron I_p)(I_t kron dA/d cs C), eq. 9, second form; arguments as `chain_rule`."""
    (p, q), (r, u), (s, t) = _shape(a, "a"), _shape(c, "c"), _shape(of, "of")
    _fits(da_dc, np.empty((p, q)), r, u, "da_dc")
    _fits(dc, np.empty((r, u)), s, t, "dc")
    by_column = entries(da_dc, (r, u)).transpose(0, 1, 3, 2).reshape(p, q, r * u)
    along = entries(dc, (s, t)).transpose(1, 0, 2, 3).reshape(r * u, s, t)
    inner = np.kron(np.eye(t), vetter(by_column[:, :, :, None], (r * u, 1), 2))
    return np.kron(vetter(along[None], (s, t), 2), np.eye(p)) @ inner


def inverse_rule(a: ArrayLike, da: ArrayLike, of: Sequence[int]) -> np.ndarray:
    """d(A^-1)/dB = -(I_s kron A^-1) dA/dB (I_t kron A^-1)."""
    s, t = _shape(of, "of")
    matrix = _matrix(a, "a")
    if matrix.shape[0] != matrix.shape[1]:
        raise ModelError(f"a must be square to have an inverse, got {matrix.shape}")
    _fits(da, matrix, s, t, "da")
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError as reason:
        raise ModelError("the matrix is singular: its inverse has no derivative") from reason
    return -np.kron(np.eye(s), inverse) @ np.asarray(da) @ np.kron(np.eye(t), inverse)


def _fits(d: Any, a: np.ndarray, s: int, t: int, name: str) -> None:
    want = (a.shape[0] * s, a.shape[1] * t)
    if np.shape(d) != want:
        raise ModelError(f"{name} must have the shape {want} of the block layout, got {np.shape(d)}")
