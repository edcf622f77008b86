"""The system of the linear analyses: matrices of one linear system, and maps from named inputs to named outputs."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from ..errors import ModelError
from ..model.names import index
from .relaxation import States, states_of

EFFECT_OF = {"C": "damping", "G": "gyroscopic", "N": "circulatory"}
_DENSE_LIMIT = 3000
_SPARSE_FROM = 400


def check_matrix_effects(without: Sequence[str]) -> None:
    """Raise unless these are effects that matrices alone can be without."""
    for name in without:
        if name not in EFFECT_OF.values():
            raise ModelError(f"without={name!r}: the effects of a MechanicalSystem are {', '.join(EFFECT_OF.values())}")


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """M y" + D y' + S y = F u, outputs L y + D0 u; an input may enter through its derivative of order ``order_in``.

    Columns of F beyond the inputs belong once more to the inputs that ``shared`` names: ground that turns under gravity
    acts by its angular acceleration and by its angle.
    """

    M: Any
    D: Any
    S: Any
    coordinates: tuple[str, ...]
    F: np.ndarray
    order_in: np.ndarray
    inputs: tuple[str, ...]
    L: np.ndarray
    D0: np.ndarray | None
    outputs: tuple[str, ...]
    effects: tuple[str, ...]
    source: Any = None
    shared: tuple[int, ...] = ()
    # states of laws and of the air, beside M, D and S
    states: States | None = None

    @property
    def n(self) -> int:
        return len(self.coordinates)

    def joined(self, a: np.ndarray, axis: int) -> np.ndarray:
        """Columns of F back to inputs: what belongs to one input is added up."""
        if not self.shared:
            return a
        n_in = len(self.inputs)
        own, more = np.split(np.moveaxis(a, axis, 0), [n_in])
        own = own.copy()
        np.add.at(own, list(self.shared), more)
        return np.moveaxis(own, 0, axis)

    @property
    def is_large(self) -> bool:
        """Sparse and so large that it is left so."""
        sparse = any(hasattr(a, "tocsc") for a in (self.M, self.D, self.S) if a is not None)
        return sparse and self.n > _SPARSE_FROM

    def reduction(self) -> tuple[_core.FrfReduction, bool]:
        """The reduced system, and whether it had to be made: systems with the same numbers share one."""
        return reduction_of(dense(self.M), None if self.D is None else dense(self.D), dense(self.S))


@dataclass(frozen=True, eq=False)
class Origin:
    """The call that a result came from; sensitivities start here."""

    model: Any
    inputs: Any
    outputs: Any
    at: Any
    without: tuple[str, ...]


def assembled(system: Any, effects: Sequence[str], inputs: Any, outputs: Any, relaxing: bool = False) -> LinearSystem:
    """The matrices of a linearisation or `MechanicalSystem` with these effects, and the maps of inputs and outputs.

    ``relaxing``: the caller knows states of laws and of the air.
    """
    states = states_of(system)
    if states is not None and not relaxing:
        raise relaxes(states.names[0])
    used = {k: getattr(system, k) if e in effects else None for k, e in EFFECT_OF.items()}
    coordinates = tuple(system.coordinates)
    D0, shared = None, ()
    if hasattr(system, "input_map"):
        ports_in, ports_out = as_list(inputs), as_list(outputs)
        F, order_in, names_in = system.input_map(ports_in)
        L, D0, names_out = system.output_map(ports_out, ports_in)
        tilt, shared = system.tilt_map(ports_in)
        F, order_in = np.hstack([F, tilt]), np.concatenate([order_in, np.zeros(len(shared), dtype=np.int64)])
        D0 = np.hstack([D0, np.zeros((len(L), len(shared)))])
    else:
        F, names_in = directions(inputs, coordinates, "inputs")
        W, names_out = directions(outputs, coordinates, "outputs")
        L, order_in = W.T, np.zeros(F.shape[1], dtype=np.int64)
    if D0 is not None and not np.any(D0):
        D0 = None
    return LinearSystem(
        M=system.M,
        D=_sum(used["C"], used["G"]),
        S=_sum(system.K, used["N"]),
        coordinates=coordinates,
        F=np.ascontiguousarray(F, dtype=float),
        order_in=np.asarray(order_in, dtype=np.int64),
        inputs=tuple(names_in),
        L=np.ascontiguousarray(L, dtype=float),
        D0=None if D0 is None else np.ascontiguousarray(D0, dtype=float),
        outputs=tuple(names_out),
        effects=tuple(effects),
        source=system,
        shared=shared,
        states=states,
    )


def as_list(ports: Any) -> list[Any]:
    """One port or several."""
    return list(ports) if isinstance(ports, list | tuple) else [ports]


def directions(spec: Any, coordinates: tuple[str, ...], what: str) -> tuple[np.ndarray, tuple[str, ...]]:
    """Columns (n, k) from coordinate names, indices, a direction (n,) or several (n, k)."""
    n = len(coordinates)
    picked = [spec] if isinstance(spec, str | int | np.integer) else spec
    if isinstance(picked, np.ndarray) and picked.dtype.kind in "iu" and picked.ndim == 1:
        picked = picked.tolist()
    if isinstance(picked, list | tuple) and picked and all(_is_coordinate(p) for p in picked):
        indices = [_coordinate(p, coordinates, what) for p in picked]
        W = np.zeros((n, len(indices)))
        W[indices, range(len(indices))] = 1.0
        return W, tuple(coordinates[i] for i in indices)
    try:
        W = np.array(picked, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(
            f"{what} must be coordinate names, indices, a direction ({n},) or directions ({n}, k); got {spec!r}"
        ) from None
    if W.ndim == 1:
        W = W[:, None]
    if W.ndim != 2 or W.shape[0] != n or W.shape[1] == 0:
        raise ModelError(f"{what} has shape {np.shape(spec)}; directions must be ({n},) or ({n}, k)")
    if not np.all(np.isfinite(W)):
        raise ModelError(f"{what} contains NaN or infinite entries")
    return W, tuple(f"{what[:-1]}{j}" for j in range(W.shape[1]))


def _is_coordinate(p: Any) -> bool:
    return isinstance(p, str | int | np.integer) and not isinstance(p, bool)


def _coordinate(p: Any, coordinates: tuple[str, ...], what: str) -> int:
    if isinstance(p, str):
        return index(f"{what}: no coordinate", p, coordinates)
    if not -len(coordinates) <= p < len(coordinates):
        raise ModelError(f"{what}: coordinate {p} does not exist, there are {len(coordinates)}")
    return int(p) % len(coordinates)


def relaxes(name: str) -> ModelError:
    """The refusal of an analysis that has no place for states of laws or of the air."""
    remedy = (
        'inflow="bem" without attached= and stall='
        if name.startswith("the air")
        else "the element k= and c= in place of the law"
    )
    return ModelError(
        f"{name} has a state that relaxes, which this analysis does not know; mb.modes, mb.frf, mb.response and mb.simulate do, or give "
        f"{remedy}"
    )


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


def csc_arrays(a: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Column pointers, row indices and values of a matrix, as the sparse functions of the core take them."""
    from scipy.sparse import csc_matrix

    made = csc_matrix(a)
    return made.indptr.astype(np.int64), made.indices.astype(np.int64), made.data.astype(float)


# Reductions of the last systems, bounded by the numbers that they hold: larger ones are made again when they are asked for again.
_reductions: OrderedDict[bytes, tuple[_core.FrfReduction, int]] = OrderedDict()
_KEPT_NUMBERS = 8_000_000


def reduction_of(M: np.ndarray, D: np.ndarray | None, S: np.ndarray) -> tuple[_core.FrfReduction, bool]:
    """Reductions are kept by the contents of the matrices, up to 64 MB: a second call with other frequencies or ports is cheap."""
    digest = hashlib.blake2b(digest_size=16)
    for a in (M, D, S):
        digest.update(b"none" if a is None else np.ascontiguousarray(a).data)
        digest.update(str(None if a is None else a.shape).encode())
    key = digest.digest()
    known = _reductions.get(key)
    if known is not None:
        _reductions.move_to_end(key)
        return known[0], False
    with core_errors():
        made = _core.FrfReduction(M, D, S)
    _reductions[key] = made, 4 * M.size  # eigenvectors on both sides or Hessenberg form and basis, complex
    while sum(numbers for _, numbers in _reductions.values()) > _KEPT_NUMBERS:
        _reductions.popitem(last=False)
    return made, True


def _sum(a: Any, b: Any) -> Any:
    if a is None:
        return b
    return a if b is None else a + b
