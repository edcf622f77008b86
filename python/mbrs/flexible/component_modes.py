"""A user's own finite element matrices as a modal body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import count, shown, sized_array
from ..errors import InertiaError, ModelError
from ._reduction import reduced_shapes
from .beams import modal_damping
from .modal_body import ModalBody

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .aliases import Matrix

__all__ = ["craig_bampton"]

Array = np.ndarray
_ME = "craig_bampton"
# Difference of a matrix from its transpose, over its largest entry, and of the three masses of translation, that files of other
# programs leave. Larger: matrices of something else pass; smaller: those written with eight digits are refused.
_SYMMETRIC, _ONE_MASS = 1e-8, 1e-6
# How far K may resist a rigid motion, against its own size; meshes from other programs carry few digits.
_RIGID = 1e-5


def craig_bampton(
    M: Matrix,
    K: Matrix,
    nodes: Mapping[str, int],
    *,
    positions: ArrayLike,
    modes: int = 6,
    fixed: str | None = None,
    damping: ArrayLike | None = None,
    KG: Mapping[int, Matrix] | None = None,
) -> ModalBody:
    """Finite element matrices of a free body, reduced to constraint and fixed-interface modes, as a `ModalBody`.

        x_b: coordinates of the attachment nodes,   x_i = -K_ii^-1 K_ib x_b + Phi_i z,   K_ii Phi_i = M_ii Phi_i diag(w^2)

    Parameters
    ----------
    M, K
        (6 n, 6 n) dense or `scipy.sparse`, symmetric, of the unsupported body, in body axes: degrees of freedom x y z rx ry
        rz of node 0, then of node 1, ... One with neither stiffness nor mass coupling in K is left out (zero row of K).
    nodes
        Name to index of the nodes that joints, springs and loads attach to; each brings six constraint modes.
    positions
        (n, 3) m, undeformed, from the body's origin, body axes.
    modes
        Fixed-interface modes, the lowest.
    fixed
        Name of the node that the body's frame is clamped to, or None: mean axes (shapes orthogonal to rigid motions).
    damping
        Ratio of critical damping of all shapes, or one for each.
    KG
        {i: (6 n, 6 n)} geometric stiffness for unit inertial fields, i in the order of `ModalBody.KG` (0 to 2: a0, 3 to
        11: W row by row). Left out: none.

    Returns
    -------
    ModalBody
        Shapes orthonormal over M (modal mass 1, K diagonal), ascending in frequency; rigid motions removed.

    Raises
    ------
    ModelError
        Wrong shapes, matrices that are not symmetric, a K that resists rigid motions, nodes that do not exist.
    SingularError
        K is singular with the nodes held, or M is not positive definite.

    Notes
    -----
    Exact over the given M: modal mass and stiffness, S, and int rho r x phi, which rigid motions give. M alone does not
    tell how its mass is spread over components: P1's symmetric part and P2 take the mean of the three translational
    blocks as scalar mass between nodes (exact for solid elements; for beams and shells an error O(h^2) and of the
    size of the sections' own rotary inertia), P2 with its trace corrected to the modal mass.
    R. R. Craig, M. C. C. Bampton, AIAA Journal 6(7) (1968) 1313-1319. Cost: one sparse factorisation and ``modes``
    eigenpairs (dense, O(n^3), below 1500 degrees of freedom), O(m^2 n).

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> k = 1e4 * np.eye(6); m = np.diag([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
    >>> K = np.block([[k, -k], [-k, k]])                   # two lumps at one place, a spring of six directions between
    >>> body = mb.flexible.craig_bampton(np.kron(np.eye(2), m), K, {"a": 0, "b": 1}, positions=np.zeros((2, 3)), modes=0)
    >>> np.round(body.frequencies()[:3] * 2 * np.pi, 6)    # sqrt(2 k / m)
    array([141.421356, 141.421356, 141.421356])
    """
    at = sized_array(f"{_ME}: positions", positions)
    if at.ndim != 2 or at.shape[1] != 3 or len(at) == 0:
        raise ModelError(f"{_ME}: positions must be (n, 3), got shape {at.shape}")
    M_all, K_all = _matrix("M", M, len(at)), _matrix("K", K, len(at))
    chosen = _nodes(nodes, len(at))
    if fixed is not None and not (isinstance(fixed, str) and fixed in chosen):
        raise ModelError(
            f"{_ME}: fixed must name one of the nodes ({', '.join(chosen)}) or be None, got {shown(fixed)}"
        )
    R = _rigid_motions(at)
    absent = np.flatnonzero(np.asarray(abs(K_all).max(axis=1).todense()).ravel() == 0)
    _check_free(K_all, R, absent)
    held = absent
    if fixed is not None:
        held = np.union1d(absent, 6 * chosen[fixed] + np.arange(6))
    others = [i for name, i in chosen.items() if name != fixed]
    interface = np.setdiff1d([6 * i + j for i in others for j in range(6)], held).astype(int)
    rigid = 0 if fixed is not None else 6 - (int(np.linalg.matrix_rank(R[absent])) if len(absent) else 0)
    T, square = reduced_shapes(M_all, K_all, interface, held, count(f"{_ME}: modes", modes, 10000, least=0), rigid, _ME)
    shape = T.reshape(len(at), 6, -1)
    picked = list(chosen.values())
    note = f"Craig-Bampton of {len(at)} nodes, "
    note += f"clamped at {fixed}" if fixed is not None else "mean axes"
    mass, com, inertia = _rigid_body(M_all, R)
    integrals: dict[str, Any] = _shape_integrals(M_all, R, T, at)
    return ModalBody(
        mass,
        com,
        inertia,
        **integrals,
        K=np.diag(square),
        C=modal_damping(damping, np.sqrt(square), _ME),
        KG=_geometric(KG, T, len(at)),
        nodes=tuple(chosen),
        node_position=at[picked],
        node_shape=shape[picked],
        note=note,
    )


def _matrix(name: str, value: Any, n: int) -> Any:
    import scipy.sparse as sp

    if sp.issparse(value):
        made = sp.csr_matrix(value, dtype=float)
        sized_array(f"{_ME}: {name}", made.data)
    else:
        dense = sized_array(f"{_ME}: {name}", value)
        made = sp.csr_matrix(dense if dense.ndim == 2 else np.zeros((0, 0)))
    if made.shape != (6 * n, 6 * n):
        raise ModelError(
            f"{_ME}: {name} must be ({6 * n}, {6 * n}), six degrees of freedom of {n} nodes; it is {made.shape}"
        )
    skew = abs(made - made.T)
    if skew.nnz and skew.max() > _SYMMETRIC * abs(made).max():
        raise ModelError(f"{_ME}: {name} must be symmetric; it differs from its transpose by {skew.max():.3g}")
    return 0.5 * (made + made.T)


def _nodes(nodes: Any, n: int) -> dict[str, int]:
    if not isinstance(nodes, Mapping) or not nodes:
        raise ModelError(f'{_ME}: nodes must map names to node indices, {{"left": 0}}, got {shown(nodes)}')
    out = {}
    for name, i in nodes.items():
        if not isinstance(name, str) or not name:
            raise ModelError(f"{_ME}: nodes have names, got {shown(name)}")
        out[name] = count(f"{_ME}: the index of node {name!r}", i, n - 1, least=0)
    if len(set(out.values())) != len(out):
        raise ModelError(f"{_ME}: two names for one node; every attachment node must be given once")
    return out


def _rigid_motions(at: Array) -> Array:
    """(6 n, 6): translations, then rotations about the origin."""
    R = np.zeros((len(at), 6, 6))
    R[:, :3, :3], R[:, 3:, 3:] = np.eye(3), np.eye(3)
    x, y, z = at.T
    R[:, 0, 4], R[:, 0, 5], R[:, 1, 3] = z, -y, -z
    R[:, 1, 5], R[:, 2, 3], R[:, 2, 4] = x, y, -x
    return R.reshape(-1, 6)


def _check_free(K: Any, R: Array, absent: Array) -> None:
    resisted = np.max(np.abs(K @ R), axis=0)
    size = np.max(abs(K) @ np.abs(R), axis=0)
    stiff = np.flatnonzero(resisted > _RIGID * np.maximum(size, 1e-300))
    if len(stiff):
        words = ["translation along x", "along y", "along z", "rotation about x", "about y", "about z"]
        raise ModelError(
            f"{_ME}: K resists the rigid {', '.join(words[i] for i in stiff)}: give the matrix of the unsupported body, "
            "its nodes at their positions, degrees of freedom in the order x y z rx ry rz"
        )


def _rigid_body(M: Any, R: Array) -> tuple[float, Array, Array]:
    whole = R.T @ (M @ R)
    mass = np.trace(whole[:3, :3]) / 3
    if not mass > 0 or np.max(np.abs(whole[:3, :3] - mass * np.eye(3))) > _ONE_MASS * mass:
        raise InertiaError(
            f"{_ME}: M must give the same positive mass for translation along x, y and z; it gives "
            f"{', '.join(f'{v:g}' for v in np.diag(whole)[:3])} kg"
        )
    moment = whole[3:, :3] / mass  # [c]x
    com = 0.5 * np.array([moment[2, 1] - moment[1, 2], moment[0, 2] - moment[2, 0], moment[1, 0] - moment[0, 1]])
    return float(mass), com, whole[3:, 3:] - mass * ((com @ com) * np.eye(3) - np.outer(com, com))


def _shape_integrals(M: Any, R: Array, T: Array, at: Array) -> dict[str, Array]:
    n, m = len(at), T.shape[1]
    scalar = sum(M[i::6][:, i::6] for i in range(3)) / 3
    t = T.reshape(n, 6, m)[:, :3]
    first = np.einsum("ia,ibk->kab", at, (scalar @ t.reshape(n, -1)).reshape(n, 3, m))
    exact = R.T @ (M @ T)
    for i in range(3):  # the moment int rho r x phi
        a, b = (i + 1) % 3, (i + 2) % 3
        gap = 0.5 * (exact[3 + i] - (first[:, a, b] - first[:, b, a]))
        first[:, a, b] += gap
        first[:, b, a] -= gap
    second = np.einsum("iak,ibl->klab", t, (scalar @ t.reshape(n, -1)).reshape(n, 3, m))
    modal = T.T @ (M @ T)
    second += (modal - np.trace(second, axis1=2, axis2=3))[..., None, None] / 3 * np.eye(3)
    return dict(S=exact[:3], P1=first, P2=0.5 * (second + second.transpose(1, 0, 3, 2)))


def _geometric(KG: Any, T: Array, n: int) -> Array:
    out = np.zeros((12, T.shape[1], T.shape[1]))
    if KG is not None and not isinstance(KG, Mapping):
        raise ModelError(f"{_ME}: KG must map indices 0 to 11 to matrices, got {shown(KG)}")
    for i, given in (KG or {}).items():
        made = T.T @ (_matrix(f"KG[{i}]", given, n) @ T)
        out[count(f"{_ME}: an index of KG", i, 11, least=0)] = 0.5 * (made + made.T)
    return out
