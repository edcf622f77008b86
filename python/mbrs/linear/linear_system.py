"""The system of the linear analyses: matrices of one linear system, and maps from named inputs to named outputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .. import _core
from .._lib.border import require_memory
from .._lib.checks import real_array, shown
from ..errors import ModelError
from ..model.names import index
from .relaxation import States

_SPARSE_FROM = 400


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """M y" + D y' + S y = F u, outputs L y + D0 u; an input may enter through its derivative of order ``order_in``.

    ``source`` is the linearisation or `MechanicalSystem` with the matrices; ``other`` a system of the core in their place. Columns of F
    beyond the inputs belong once more to the inputs that ``shared`` names: ground that turns under gravity acts by its angular
    acceleration and by its angle.
    """

    source: Any
    coordinates: tuple[str, ...]
    F: np.ndarray
    order_in: np.ndarray
    inputs: tuple[str, ...]
    L: np.ndarray
    D0: np.ndarray | None
    outputs: tuple[str, ...]
    effects: tuple[str, ...]
    shared: tuple[int, ...] = ()
    # states of laws and of the air, beside M, D and S
    states: States | None = None
    other: _core.SecondOrder | None = None

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
        return bool(self.source.is_sparse) and self.n > _SPARSE_FROM

    @property
    def core(self) -> _core.SecondOrder:
        """The matrices in the core, with all that has been derived from them."""
        made: _core.SecondOrder = self.source.core if self.other is None else self.other
        return made

    @property
    def maps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray | None]:
        """L, F, order_in, D0, as the core takes them."""
        return self.L, self.F, self.order_in, self.D0

    @cached_property
    def M(self) -> Any:
        """Mass, dense, or sparse where the system `is_large`."""
        return self._of.M

    @cached_property
    def D(self) -> Any:
        """C + G, or None."""
        return _sum(self._of.C, self._of.G)

    @cached_property
    def S(self) -> Any:
        """K + N."""
        return _sum(self._of.K, self._of.N)

    @property
    def _of(self) -> Any:
        return self.source if self.is_large else self.core


@dataclass(frozen=True, eq=False)
class Origin:
    """The call that a result came from; sensitivities start here."""

    model: Any
    inputs: Any
    outputs: Any
    at: Any
    without: tuple[str, ...]


def assembled(system: Any, effects: Sequence[str], inputs: Any, outputs: Any, relaxing: bool = False) -> LinearSystem:
    """A linearisation or `MechanicalSystem` with the maps of inputs and outputs; ``effects``: those that its matrices hold.

    ``relaxing``: the caller knows states of laws and of the air.
    """
    states = system.states
    if states is not None and not relaxing:
        raise relaxes(states.names[0])
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
        source=system,
        coordinates=coordinates,
        F=np.ascontiguousarray(F, dtype=float),
        order_in=np.asarray(order_in, dtype=np.int64),
        inputs=tuple(names_in),
        L=np.ascontiguousarray(L, dtype=float),
        D0=None if D0 is None else np.ascontiguousarray(D0, dtype=float),
        outputs=tuple(names_out),
        effects=tuple(effects),
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
        columns = f"{what}: {len(indices)} directions of {n} coordinates"
        require_memory(3.0 * 8.0 * n * len(indices), columns, "ask for fewer at a time")
        W = np.zeros((n, len(indices)))
        W[indices, range(len(indices))] = 1.0
        return W, tuple(coordinates[i] for i in indices)
    give = f"give names of coordinates, indices, a direction ({n},) or directions ({n}, k)"
    W = real_array(what, picked, None, give)
    W = real_array(what, W[:, None] if W.ndim == 1 else W, (n, "k"), give)
    return W, tuple(f"{what[:-1]}{j}" for j in range(W.shape[1]))


def _is_coordinate(p: Any) -> bool:
    return isinstance(p, str | int | np.integer) and not isinstance(p, bool)


def _coordinate(p: Any, coordinates: tuple[str, ...], what: str) -> int:
    if isinstance(p, str):
        return index(f"{what}: no coordinate", p, coordinates)
    if not -len(coordinates) <= p < len(coordinates):
        raise ModelError(f"{what}: coordinate {shown(p)} does not exist, there are {len(coordinates)}")
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


def csc_arrays(a: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Column pointers, row indices and values of a matrix, as the sparse functions of the core take them."""
    from scipy.sparse import csc_matrix

    made = csc_matrix(a)
    return made.indptr.astype(np.int64), made.indices.astype(np.int64), made.data.astype(float)


def _sum(a: Any, b: Any) -> Any:
    if a is None:
        return b
    return a if b is None else a + b
