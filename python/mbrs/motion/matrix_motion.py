"""Motion in time of a `MechanicalSystem`: its coordinates are the modal coordinates of a body that is held in place.

The body has M and the parts of C and K that store and dissipate energy; what remains of C, G, K, N and the laws are elements between
ground and nodes that move by w . x. So every scheme, law and estimate of `mb.simulate` is the one of models.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .._lib.checks import real_array, shown
from ..errors import ConvergenceError, ModelError
from ..flexible import ModalBody
from ..linear.linear_system import directions
from ..linear.matrices import MechanicalSystem, dense
from ..linear.response import ResponseResult
from ..model.function_law import FunctionLaw
from ..model.law_items import SavedLaw
from ..model.laws import Polynomial1D, VaryingStiffness
from ..model.model import Model
from ..results import Stats
from ..system.snapshot import Snapshot
from ..system.state import State, state_of
from .error import errors_from
from .options import DEFAULT
from .trajectory import Trajectory

_BODY, _HELD = "x", "held"
_AXES = ("x", "y", "z")
# the run that finds out how large the motion is
_COARSE = 1e-3
# runs in search of the size of the motion
_TRIALS = 6

Run = Callable[..., Trajectory]


def simulate_matrices(
    system: MechanicalSystem, t: Any, loads: Any, x0: Any, v0: Any, options: dict[str, Any], run: Run
) -> ResponseResult:
    """The motion of all coordinates by the ``options`` that are not None; ``run`` integrates a model."""
    options = {name: value for name, value in options.items() if value is not None}
    start = np.concatenate([_start(x0, system.n, "x0"), _start(v0, system.n, "v0")])
    scene = _Scene(system, loads)
    size = _size_of_motion(scene, t, start, run)
    model = scene.model(size)
    try:
        traj = run(model, t, at=_state(model, start), **options)
    except ConvergenceError as stopped:
        partial = _result(system, stopped.result, np.full(stopped.result.q.T.shape, np.inf))
        raise ConvergenceError(str(stopped).replace(repr(model.name), "the system"), partial) from None
    return _result(system, traj, _error(model, traj, start, options, run))


class _Scene:
    """Masses, elements and loads, which do not depend on the size of the motion."""

    def __init__(self, system: MechanicalSystem, loads: Any) -> None:
        n = system.n
        self.M = _symmetric_mass(dense(system.M))
        zero = np.zeros((n, n))
        parts = [zero if a is None else dense(a) for a in (system.K, system.N, system.C, system.G)]
        stiffness, damping = parts[0] + parts[1], parts[2] + parts[3]
        # (w, law on u = w . x) and (directions (m, n), law on all of them)
        self.lines: list[tuple[np.ndarray, Any]] = []
        self.joined: list[tuple[np.ndarray, Any]] = []
        self.K = self._passive(stiffness, lambda k: Polynomial1D([0.0, k]), _circulatory)
        self.C = self._passive(damping, lambda c: Polynomial1D([0.0, 0.0], velocity=[0.0, c]), _gyroscopic)
        for i, law in enumerate(system.elements):
            self._element(law, f"elements[{i}]")
        self.loads = list(_loads(loads, system.coordinates))

    def _element(self, law: Any, where: str) -> None:
        w, free = np.asarray(law.w, dtype=float), _free_law(law, where)
        if w.ndim == 1:
            self.lines.append((w, free))
        elif len(w) > len(_AXES):
            raise ModelError(
                f"{where}, {law!r} acts on {len(w)} coordinates; a motion of matrices takes laws of up to {len(_AXES)}: make a Model"
            )
        else:
            self.joined.append((w, free))

    def _passive(self, A: np.ndarray, line: Any, plane: Any) -> np.ndarray:
        """The positive semidefinite part of A; what remains becomes elements."""
        symmetric = 0.5 * (A + A.T)
        values, vectors = np.linalg.eigh(symmetric)
        for value, w in zip(values, vectors.T, strict=True):
            if value < 0.0:
                symmetric = symmetric - value * np.outer(w, w)
                self.lines.append((w, line(float(value))))
        self.joined += [(axes, plane(s)) for s, axes in _rotations(0.5 * (A - A.T))]
        passive: np.ndarray = 0.5 * (symmetric + symmetric.T)
        return passive

    def fastest(self) -> float:
        """A bound of the rates of the linear part, rad/s."""
        from scipy.linalg import eigvalsh

        square, decay = (float(np.abs(eigvalsh(A, self.M)).max()) for A in (self.K, self.C))
        return float(max(np.sqrt(square), decay))

    def model(self, size: float) -> Model:
        """The model whose tolerances belong to a motion of this size, sqrt(kg) m: the mass of the held body sets them."""
        n = len(self.M)
        shapes = [np.zeros((1, n)), *(np.atleast_2d(w) for w, _ in [*self.lines, *self.joined, *self.loads])]
        nodes = (_HELD, *(f"n{i}" for i in range(1, len(shapes))))
        node_shape = np.zeros((len(shapes), 6, n))
        for own, shape in zip(node_shape, shapes, strict=True):
            own[: len(shape)] = shape
        P2 = np.zeros((n, n, 3, 3))
        P2[:, :, 0, 0] = self.M
        body = ModalBody(
            mass=size**2,
            com=np.zeros(3),
            inertia=np.eye(3) * size**2,
            S=np.zeros((3, n)),
            P1=np.zeros((n, 3, 3)),
            P2=P2,
            K=self.K,
            C=self.C,
            nodes=nodes,
            node_position=np.zeros((len(shapes), 3)),
            node_shape=node_shape,
        )
        m = Model("matrices")
        carrier = m.flexible_body(_BODY, body)
        m.fixed(_HELD, m.ground, carrier.node(_HELD))
        at = iter(nodes[1:])
        origin = (0.0, 0.0, 0.0)
        for _, law in self.lines:
            node = next(at)
            m.bushing(f"e{node}", m.ground, carrier.node(node), at=origin, law={"x": law})
        for w, law in self.joined:
            node = next(at)
            m.bushing(f"e{node}", m.ground, carrier.node(node), at=origin, law={_AXES[: len(w)]: law})
        for _, load in self.loads:
            node = next(at)
            m.force(f"f{node}", carrier.node(node), value=(load, 0.0, 0.0))
        return m


def _size_of_motion(scene: _Scene, t: Any, start: np.ndarray, run: Run) -> float:
    """Largest sqrt(M_ii) |x_i|, from coarse runs; one made for more than came out is made again."""
    n = len(scene.M)
    weight = np.sqrt(np.diag(scene.M))
    fastest = max(scene.fastest(), 1.0 / (np.max(t) or 1.0))
    pushed = sum((np.abs(w) * _largest(load, t) for w, load in scene.loads), np.zeros(n))
    expected = (weight * np.abs(start[:n]), weight * np.abs(start[n:]) / fastest, pushed / weight / fastest**2)
    size = float(np.max(expected)) or 1.0
    for _ in range(_TRIALS):
        model = scene.model(size)
        try:
            traj = run(model, float(np.max(t)), at=_state(model, start), rtol=_COARSE)
        except ConvergenceError:
            return size  # where it ends, a motion that grows without bound has no size
        found = float(np.max(weight * np.abs(traj.q), initial=0.0)) or size
        if found >= size:
            return found
        size = found
    return size


def _largest(load: Any, t: Any) -> float:
    """The largest value of a load at instants over the time, or one where it is a motion of the package."""
    if not callable(load):
        return abs(float(load)) if isinstance(load, int | float | np.number) else 1.0
    instants = np.linspace(0.0, float(np.max(t)), 257)
    return float(np.max(np.abs([float(load(float(s))) for s in instants])))


def _error(model: Model, traj: Trajectory, start: np.ndarray, options: dict[str, Any], run: Run) -> np.ndarray:
    """(n, n_t) estimated errors of the displacements: the differences to other runs at the same times."""
    variant = f"{options['method']}/{options['order']}" if "order" in options else options["method"]
    asked = {**({} if "step" in options else {"rtol": DEFAULT}), **options, "method": variant}

    def apart(changed: dict[str, Any]) -> np.ndarray | None:
        """(n, n_t) distances from another run."""
        others = {"method": traj.method, **changed}
        if others["method"] != traj.method:
            others = {name: None for name in ("rho", "form", "update", "order")} | others
        try:
            other = run(model, traj.t, at=_state(model, start), **{**options, "rtol": None, "step": None, **others})
        except ConvergenceError:
            return None
        return np.asarray(np.abs(other.q - traj.q).T)

    found, _ = errors_from(traj, asked, 0.0, apart)
    if found is None:
        return np.full(traj.q.T.shape, np.inf)
    size = np.abs(traj.q).max(axis=0)
    rounding = np.finfo(float).eps * np.sqrt(len(traj.steps)) * size
    return np.asarray(found + rounding[:, None])


def _result(system: MechanicalSystem, traj: Trajectory, error: np.ndarray) -> ResponseResult:
    x = traj.q.T
    size = np.abs(x).max(axis=1, initial=0.0)
    return ResponseResult(
        t=traj.t,
        displacement=x,
        velocity=traj.rate.T,
        acceleration=traj.acceleration.T,
        kind="displacement",
        inputs=(),
        outputs=system.coordinates,
        error_history=error,
        stats=Stats(traj.stats.wall_time, dict(traj.stats.counts), traj.stats.effects, traj.stats.route),
        error=error.max(axis=1, initial=0.0) / np.where(size > 0.0, size, 1.0),
        status=traj.status,
    )


def _state(model: Model, start: np.ndarray) -> State:
    n = len(start) // 2
    drawn = state_of(model, Snapshot.of(model, ()).system, None)
    return State(start[:n], start[n:], "given", drawn.memory)


def _start(x: Any, n: int, name: str) -> np.ndarray:
    give = "give one number for each coordinate"
    return np.zeros(n) if x is None else real_array(name, real_array(name, x, None, give).ravel(), (n,), give)


def _symmetric_mass(M: np.ndarray) -> np.ndarray:
    try:
        np.linalg.cholesky(M)
        same = np.allclose(M, M.T)
    except np.linalg.LinAlgError:
        same = False
    if not same:
        raise ModelError("a motion needs a mass matrix M that is symmetric and positive definite")
    symmetric: np.ndarray = 0.5 * (M + M.T)
    return symmetric


def _rotations(A: np.ndarray) -> Iterator[tuple[float, np.ndarray]]:
    """A skew matrix as sum of s (a b^T - b a^T): s and the axes (2, n), from its real Schur form."""
    from scipy.linalg import schur

    if not np.any(A):
        return
    T, Q = schur(A, output="real")
    rounding = np.finfo(float).eps * len(A) * np.max(np.abs(A))
    for i in range(len(A) - 1):
        if abs(T[i, i + 1]) > rounding:
            yield float(T[i, i + 1]), Q[:, i : i + 2].T


def _circulatory(s: float) -> FunctionLaw:
    return FunctionLaw(lambda t, u, v: np.array([s * u[1], -s * u[0]]))


def _gyroscopic(s: float) -> FunctionLaw:
    return FunctionLaw(lambda t, u, v: np.array([s * v[1], -s * v[0]]))


def _free_law(law: Any, where: str) -> Any:
    """The law without its direction."""
    if isinstance(law, VaryingStiffness):
        raise ModelError(
            f"{where}, {law!r}: a motion has no phase of an excitation that it could follow; give "
            "mb.FunctionLaw(lambda t, u, v: k * np.cos(order * omega * t + phase) * u, w=...)"
        )
    if law.start:
        raise ModelError(f"{where}, {law!r} starts from a strained state of a model: simulate the model itself")
    if isinstance(law, FunctionLaw):
        if not hasattr(law, "function"):
            raise ModelError(f"{where}, {law!r} belongs to a model: simulate the model itself")
        return FunctionLaw(law.function, law.derivatives)
    return SavedLaw(type(law).__name__, law.code, law.numbers())


def _loads(loads: Any, coordinates: tuple[str, ...]) -> Iterator[tuple[np.ndarray, Any]]:
    pairs: Sequence[Any] = list(loads.items()) if isinstance(loads, Mapping) else list(loads or ())
    for pair in pairs:
        if not isinstance(pair, tuple | list) or len(pair) != 2:
            raise ModelError(
                f"loads must be {{coordinate: load}} or a list of pairs (direction, load), got {shown(pair)}"
            )
        columns, _ = directions(pair[0], coordinates, "loads")
        if columns.shape[1] != 1:
            raise ModelError(f"each load needs one direction, got {pair[0]!r}")
        yield columns[:, 0], pair[1]
