"""The full equations of a model, integrated from a motion that harmonic balance found with linearised geometry."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._lib.border import core_errors
from ..errors import ConvergenceError, MbrsError, MbrsWarning, ModelError
from ..linear.linearization import Linearization
from ..model.motions import Sine
from ..model.ports import Port, as_port
from ..model.schema import LAW_OF_CODE, MARKER
from ..motion.options import TIGHTEST
from ..system.snapshot import Snapshot
from ..system.state import State
from . import midpoint

OUTPUTS = 64  # instants of a period at which motions are compared
_DIFFERENCE = 1e-3  # of the time: the step of the differences that give the rates of the start
# Part of a force that does not come through the ports by which it was given. Larger: a force of another direction is put there. Smaller:
# rounding spreads a force over all bodies, where it does not follow its own.
_SAME_FORCE = 1e-9
_STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))  # eighth order, central
_IN_TIME = frozenset({"gravity", "damping", "friction", "contact", "centrifugal"})


class Distance(float):
    """Distance of a motion from one integrated in time, relative to its largest displacement; a number with its parts.

    The number is ``full`` where that is known, else ``balanced``.

    Attributes
    ----------
    balanced
        Against the equations that were balanced: matrices and laws, of a model with linearised geometry. What harmonics and
        samples leave out.
    full
        Against all equations of the model by `mb.simulate`, hence with the error of the linearised geometry; None for a
        `MechanicalSystem`, which has no geometry, and where ``why`` says why not.
    why
        Reason for which ``full`` is not known, or "".
    """

    balanced: float
    full: float | None
    why: str

    def __new__(cls, balanced: float, full: float | None = None, why: str = "") -> Distance:
        self = super().__new__(cls, balanced if full is None else full)
        self.balanced, self.full, self.why = float(balanced), full, why
        return self

    def __reduce__(self) -> Any:
        return Distance, (self.balanced, self.full, self.why)

    def __repr__(self) -> str:
        known = f"full={self.full!r}, " if self.full is not None else f"why={self.why!r}, " if self.why else ""
        return f"Distance({known}balanced={self.balanced!r})"

    def __str__(self) -> str:
        text = f"{self.balanced:.1e} from the equations that were balanced"
        if self.full is not None:
            return f"{self.full:.1e} from the full equations of the model, {text}"
        return f"{text} (full equations: {self.why})" if self.why else text


@dataclass(frozen=True)
class Push:
    """A load of the copy: a force or torque of harmonic content on a body."""

    body: str
    point: tuple[float, float, float] | None
    direction: np.ndarray
    is_rotation: bool
    amplitude: complex
    omega: float


def obstacle(system: Any) -> str:
    """Reason why the full equations of the model of a system cannot be integrated from a motion of it; "" if they can."""
    lin: Linearization | None = getattr(system, "linearization", None)
    if lin is None:
        return "there is no model behind these matrices"
    if lin.state.moving:
        return "the model moves steadily at the state of its linearisation"
    left = [name for name in lin.without if name not in _IN_TIME]
    if left:
        return f"a motion in time cannot be without {left[0]!r}"
    if any(law.kind.phase for law in system.elements):
        return "a varying stiffness follows the phase of the excitation, not time"
    if len(lin.snapshot.tables["drive_name"]):
        return "drives, which a linearisation holds still, move in time"
    if any(load.motions for load in lin.model.loads):
        return "a load of the model itself varies in time"
    return ""


def full_distance(solution: Any, terms: Sequence[tuple[float, Any]], length: float, rtol: float) -> float:
    """Largest distance over a time between all bodies of the model and where the motion x(t), put into the model's joints,
    has them: positions over the characteristic length and angles, relative to the largest of the motion itself.

    ``terms``: pairs (omega, force (dof,)) of the excitation, omega = 0 for static forces; ``length`` of the time in s.
    """
    from ..motion.simulate import simulate

    system = solution.system
    lin: Linearization = system.linearization
    model = _copy(system)
    for i, push in enumerate(_pushes(system, terms)):
        _add(model, f"_verified{i}", push)
    t = np.linspace(0.0, length, OUTPUTS + 1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MbrsWarning)  # rounding of the rates that are given
        start = _start(solution, length, model, simulate)
        traj = simulate(model, t, at=start, rtol=max(rtol, TIGHTEST), without=lin.without)
    own = lin.snapshot.system
    where = _poses(own, [_lifted(lin, x) for x in solution.displacement(t).T])
    there = _poses(own, list(traj.q))
    rest = _poses(own, [lin.state.q])
    scale = own.characteristic_length
    size = _apart(where, rest, scale)
    return _apart(there, where, scale) / max(size, np.finfo(float).tiny)


def _copy(system: Any) -> Any:
    lin: Linearization = system.linearization
    model = pickle.loads(pickle.dumps(lin.model))
    values = getattr(system, "values", None)
    if values:
        model.set(values)
    if not np.array_equal(Snapshot.of(model, lin.without).tables["x"], lin.snapshot.tables["x"]):
        raise ModelError(f"model {lin.model.name!r} was changed after this motion was computed; compute it again")
    return model


def _lifted(lin: Linearization, x: np.ndarray) -> np.ndarray:
    """The configuration whose joints are moved by the increments x from the state of the linearisation, loops closed."""
    with core_errors():
        return np.asarray(lin.snapshot.system.advance(lin.state.q, np.ascontiguousarray(x), list(lin.without)))


def _poses(system: Any, q: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n_t, n_bodies, 3) and rotations (n_t, n_bodies, 3, 3)."""
    with core_errors():
        made = [system.bodies(np.ascontiguousarray(r), np.zeros(0)) for r in q]
    return np.array([m["position"] for m in made]), np.array([m["rotation"] for m in made])


def _apart(a: Any, b: Any, length: float) -> float:
    """Largest distance over a length, or angle, between bodies."""
    moved = np.linalg.norm(a[0] - b[0], axis=-1) / length
    # |R_a - R_b| = 2 sqrt(2) sin(angle/2) in the norm of all entries
    turned = np.linalg.norm(a[1] - b[1], axis=(-2, -1)) / np.sqrt(2.0)
    return float(max(np.max(moved, initial=0.0), np.max(turned, initial=0.0)))


def _start(solution: Any, length: float, model: Any, simulate: Any) -> State:
    """The state at t = 0: joints moved by x(0), rates of the tree coordinates from differences of the bodies' poses."""
    system = solution.system
    lin: Linearization = system.linearization
    own = lin.snapshot.system
    h = _DIFFERENCE * length
    weights = [(k * s, w * s) for k, w in _STENCIL for s in (1, -1)]
    x, velocity = solution.displacement(0.0)[:, 0], solution.velocity(0.0)[:, 0]
    # along the straight line through x: what bends are the joints, not the harmonics
    position, rotation = _poses(own, [_lifted(lin, x + k * h * velocity) for k, _ in weights])
    q = _lifted(lin, x)
    here = _poses(own, [q])[1][0]
    factors = np.array([w for _, w in weights])
    v = np.einsum("s,sbi->bi", factors, position) / h
    spin = np.einsum("s,sbij->bij", factors, rotation) / h @ np.swapaxes(here, -1, -2)
    w = 0.5 * np.stack([spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0], spin[:, 1, 0] - spin[:, 0, 1]], 1)
    rate = _rates(own, q, np.concatenate([v, w], 1).ravel())
    bare = State(q, rate, "given")
    if not any(law.has_memory for law in system.elements):
        return bare
    memory = simulate(model, np.zeros(1), at=bare, without=lin.without).memory[0].copy()
    places = _sliders(solution, length)
    memory[: len(places)] = places
    return State(q, rate, "given", memory)


def _rates(own: Any, q: np.ndarray, twists: np.ndarray) -> np.ndarray:
    """Rates of the tree coordinates that give the bodies these twists."""
    columns = []
    with core_errors():
        for unit in np.eye(own.n_tree):
            made = own.bodies(q, unit)
            columns.append(np.concatenate([made["velocity"], made["angular_velocity"]], 1).ravel())
    return np.asarray(np.linalg.lstsq(np.array(columns).T, twists, rcond=None)[0])


def _sliders(solution: Any, length: float) -> list[float]:
    """Places of the sliders at t = 0, in the order of the core, that of elements before joints."""
    x = solution.displacement(np.linspace(-length, 0.0, 4097))
    moved: list[float] = []
    for law in solution.system.elements:
        if law.has_memory:
            moved += [slider.z + law.displaced for slider in midpoint.sliders_of(law, law.w @ x)]
    t = solution.system.linearization.snapshot.tables
    # two numbers for each slider
    sliding = [LAW_OF_CODE[int(code)].state == "map" for code in t["law_type"]]
    known = sum(int(n) // 2 for n, slides in zip(t["law_n"], sliding, strict=True) if slides)
    if len(moved) != known:
        raise ModelError("a slider of the model does not move, to first order, and its place is not known")
    return moved


def _pushes(system: Any, terms: Sequence[tuple[float, Any]]) -> list[Push]:
    """Loads on bodies for the forces in minimal coordinates: the ports they were given by, or else the smallest wrenches on
    the bodies' origins that do the same work."""
    lin: Linearization = system.linearization
    out = []
    for omega, force in terms:
        f = np.asarray(force, complex)
        if not np.any(f):
            continue
        known = _by_ports(system, f, omega)
        if known is None:
            wrench = np.linalg.lstsq(lin.T.T, f, rcond=None)[0].reshape(-1, 2, 3)
            known = [
                Push(lin.bodies[b], None, np.eye(3)[i], bool(kind), complex(wrench[b, kind, i]), omega)
                for b, kind, i in np.argwhere(wrench)
            ]
        out += known
    return out


def _by_ports(system: Any, f: np.ndarray, omega: float) -> list[Push] | None:
    for ports, amplitude in getattr(system, "ports", ()):
        columns = system.linearization.input_map(ports)[0]
        given = columns @ amplitude
        size = np.vdot(given, given)
        factor = np.vdot(given, f) / size if size else 0.0
        if size and np.linalg.norm(f - factor * given) <= _SAME_FORCE * np.linalg.norm(f):
            made: list[Port] = [as_port(system.linearization.model, p) for p in ports]
            return [
                Push(p.body, _point(system, p), np.asarray(p.direction), p.is_rotation, complex(factor * a), omega)
                for p, a in zip(made, amplitude, strict=True)
            ]
    return None


def _point(system: Any, port: Port) -> tuple[float, float, float] | None:
    """The drawn world point of a port, None for the body's origin."""
    if port.point is not None or port.marker is None:
        return port.point
    t = system.linearization.snapshot.tables
    start = t["marker_x"][system.linearization.model.marker_index[port.marker]]
    x, y, z = (float(v) for v in t["x"][start:][MARKER.block.slice("at")])
    return (x, y, z)


def _add(model: Any, name: str, push: Push) -> None:
    size, phase = abs(push.amplitude), float(np.angle(push.amplitude))
    if push.omega == 0.0:
        value: Any = tuple(push.amplitude.real * push.direction)
    else:
        # Re a exp(i w t) = |a| sin(w t + arg a + pi/2)
        value = tuple(Sine(size * float(d), push.omega, phase=phase + np.pi / 2) if d else 0.0 for d in push.direction)
    if push.is_rotation:
        model.torque(name, push.body, value=value)
    else:
        model.force(name, push.body, at=push.point, value=value)


def distances(
    balanced: float, solution: Any, terms: Sequence[tuple[float, Any]], length: float, rtol: float, full: bool | None
) -> Distance:
    """Both distances; ``full``: whether the second must be known (True), may be missing (None), or is not wanted (False)."""
    if full is False or (full is None and not hasattr(solution.system, "linearization")):
        return Distance(balanced)
    why = obstacle(solution.system)
    if not why:
        try:
            return Distance(balanced, full_distance(solution, terms, length, rtol))
        except ConvergenceError as problem:
            why = f"the integration stopped: {problem}"
        except MbrsError as problem:
            why = str(problem)
    if full:
        raise ModelError(f"the full equations cannot be integrated: {why}")
    return Distance(balanced, None, why)
