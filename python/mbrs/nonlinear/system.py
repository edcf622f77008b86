"""From a model to a system with local nonlinear elements: geometry linearised at a state, laws kept as they are."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from .._lib import checks
from ..errors import ModelError
from ..linear.linear_system import relaxes
from ..linear.linearization import Linearization
from ..linear.linearize import linearization_at, matrices_at
from ..linear.matrices import MechanicalSystem
from ..linear.relaxation import FunctionPlace, LawPlace, function_places, law_places
from ..model.book import Book
from ..model.ports import Port
from ..system.effects import check_without
from ..system.snapshot import Snapshot
from ..system.state import state_of
from .shifted_laws import ShiftedFunction, shifted

if TYPE_CHECKING:
    from ..model.model import Model
    from ..system.state import StateLike

# a displacement below this part of the characteristic length (or this angle) is rounding of an equilibrium
_UNDEFORMED = 1e-12


class NonlinearSystem(MechanicalSystem):
    """A `MechanicalSystem` that came from a model; ``linearization`` holds its state, coordinates and ports."""

    linearization: Linearization
    # (ports, complex amplitudes) that made the forces of an analysis, and numbers of the model that it had changed
    ports: tuple[tuple[tuple[Any, ...], np.ndarray], ...] = ()
    values: Mapping[str, float] = {}


def nonlinear_system(m: Model, *, at: StateLike = None, without: Sequence[str] = ()) -> NonlinearSystem:
    """M x" + (C + G) x' + (K + N) x + sum_e w_e (law_e(u_e + w_e . x, w_e . x') - law_e(u_e, 0)) = f about a state.

    Geometry is linear in the minimal coordinates x, laws are not: the matrices hold everything but the slopes of the
    laws, and every ``law=`` of a spring or joint becomes an element along the gradient w_e (dof,) of its displacement,
    which is u_e at the state.

    Parameters
    ----------
    m
        The model, with its present values.
    at
        None: the drawn state; or an equilibrium or a state. Laws are at rest there.
    without
        Effects to leave out, see `mb.effects`; "friction" and "contact" leave out the laws of that kind.

    Returns
    -------
    NonlinearSystem
        A `MechanicalSystem`; its ``coordinates`` are those of `mb.linearize`.

    Raises
    ------
    ModelError
        A law that moves at the state, a function of the time, or a `VaryingStiffness` that is displaced there.

    Warns
    -----
    MbrsWarning
        A drawn state that is not in balance.

    Notes
    -----
    Equations: docs/theory.md (11.1).
    Where joints constrain velocities, the displacement they leave constant is zero (docs/theory.md, section 22). Cost: one
    linearisation.

    Examples
    --------
    >>> import mbrs as mb
    >>> from mbrs.nonlinear.system import nonlinear_system
    >>> m = mb.Model("slider"); b = m.body("b", mass=1.0, inertia=(1, 1, 1))
    >>> _ = m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=4.0, law=mb.Cubic(3.0))
    >>> system = nonlinear_system(m); system.K.tolist(), system.elements
    ([[4.0]], (Cubic(3, w=[1.]),))
    """
    started = time.perf_counter()
    without = check_without(checks.one_or_names("without", without))
    snapshot = Snapshot.of(m, without)
    state = state_of(m, snapshot.system, at)
    if state.orbit is not None:
        raise ModelError(
            f"at= is a motion of {m.name!r} whose linearisation is averaged over the turn, which nonlinear elements do not allow; follow "
            "the motion in time (mb.simulate)"
        )
    r = matrices_at(snapshot, state, [*without, "law-slopes"])
    lin = linearization_at(snapshot, state, r, without, started, warn=at is None)
    if any(air.unsteady() for air in m.airs) and "aerodynamics" not in without:
        raise relaxes(f"the air {m.airs[0].name!r}")
    elements: list[Any] = []
    for place in law_places(lin):
        elements += _elements(lin, place)
    for function in function_places(lin):
        elements += _function_elements(lin, function)
    system = NonlinearSystem(lin.M, lin.C, lin.K, G=lin.G, N=lin.N, elements=elements, coordinates=lin.coordinates)
    system.linearization = lin
    system.core = lin.core
    return system


def _elements(lin: Linearization, place: LawPlace) -> list[Any]:
    length = lin.snapshot.system.characteristic_length
    where = f"the law on {place.name}"
    if abs(place.v) > _UNDEFORMED * length:
        raise ModelError(f"{where} moves at {place.v:.3g} in this state; its element would have to depend on time")
    if np.max(np.abs(place.direction), initial=0.0) <= _UNDEFORMED:
        return []  # what does not move from here, to first order, does no work
    u0 = place.u if abs(place.u) > _UNDEFORMED * max(length, 1.0) else 0.0
    return shifted(place.code, place.numbers.tolist(), place.direction, u0, where, place.memory.tolist())


def _function_elements(lin: Linearization, place: FunctionPlace) -> list[Any]:
    length = lin.snapshot.system.characteristic_length
    where = f"the law on {place.name}"
    if np.max(np.abs(place.v)) > _UNDEFORMED * length:
        fastest = place.v[np.argmax(np.abs(place.v))]
        raise ModelError(f"{where} moves at {fastest:.3g} in this state; its element would have to depend on time")
    if np.max(np.abs(place.direction), initial=0.0) <= _UNDEFORMED:
        return []
    return [ShiftedFunction(place.body, place.numbers, place.u, place.direction, where)]


def as_system(
    system: Any, force: Any, amplitude: Any = None, at: Any = None, without: Sequence[str] = (), inputs: Any = None
) -> tuple[Any, Any]:
    """Input of harmonic balance from a model or a system: the system, and forces as vectors (n,) by harmonic.

    ``force``, or in its place ``inputs``, may name ports of the model ("b.force.x", ``b.force("x")``), alone, in a list, or
    by harmonic in a dict; ``amplitude`` (N or N m, complex a - i b for a cos + b sin) belongs to each of them, one number
    or one for each.
    """
    if (force is None) == (inputs is None):
        raise ModelError("give exactly one of force= (vectors of a system) and inputs= (ports of a model)")
    if inputs is not None:
        if not isinstance(system, Book):
            raise ModelError("inputs= are ports of a model; a MechanicalSystem takes force=(n,)")
        force = inputs
    if not isinstance(system, Book):
        if at is not None or checks.one_or_names("without", without):
            raise ModelError("at= and without= are for models; a MechanicalSystem is what its matrices are")
        return system, force if amplitude is None else _scaled(force, amplitude)
    made = nonlinear_system(cast("Model", system), at=at, without=without)
    if callable(amplitude):
        return made, _force_in_time(made, force, amplitude)
    return made, force_of_ports(made, force, amplitude)


def force_of_ports(made: NonlinearSystem, force: Any, amplitude: Any = None) -> Any:
    """Vectors (n,) by harmonic, or one, of ports of the model from which a system was made."""
    if isinstance(force, Mapping):
        return {h: _vector(made, f, amplitude) for h, f in force.items()}
    return _vector(made, force, amplitude)


def _force_in_time(made: NonlinearSystem, given: Any, amplitude: Any) -> Any:
    """f(t) of ports whose amplitudes are a function of time."""
    ports = list(given) if isinstance(given, list | tuple) else [given]
    if not all(isinstance(p, str | Port) for p in ports):
        raise ModelError(
            "an amplitude that is a function of time belongs to ports of the model; give a port or a list of them"
        )
    columns = np.array([_vector(made, p, None) for p in ports]).T
    made.ports = ()

    def force(t: float) -> np.ndarray:
        size = np.asarray(amplitude(t), dtype=float)
        return np.asarray(columns @ np.broadcast_to(size, (len(ports),)))

    return force


def _scaled(force: Any, amplitude: Any) -> Any:
    size = checks.complex_array("amplitude", amplitude)
    if isinstance(force, Mapping):
        return {h: _times(f, size) for h, f in force.items()}
    return _times(force, size)


def _times(force: Any, size: np.ndarray) -> np.ndarray:
    vector = checks.complex_array("force", force)
    if size.ndim and size.shape != vector.shape:
        raise ModelError(
            f"amplitude must be one number or one for each of {vector.shape} forces, its shape is {size.shape}"
        )
    product = vector * size
    return product if np.any(product.imag) else product.real


def _vector(made: NonlinearSystem, force: Any, amplitude: Any) -> np.ndarray:
    ports = list(force) if isinstance(force, list | tuple) else [force]
    if not ports or not all(isinstance(p, str | Port) for p in ports):
        return np.asarray(force) if amplitude is None else _scaled(force, amplitude)
    columns, order, names = made.linearization.input_map(ports)
    if np.any(order):
        raise ModelError(
            f"harmonic balance takes forces and torques; {names[int(np.flatnonzero(order)[0])]!r} is a motion of ground"
        )
    given = checks.complex_array("amplitude", 1.0 if amplitude is None else amplitude)
    try:
        size = np.broadcast_to(given, (len(ports),))
    except ValueError:
        raise ModelError(
            f"amplitude must be one number or one for each of {len(ports)} ports, it is {checks.shown(amplitude)}"
        ) from None
    total = columns @ size
    made.ports = (*made.ports, (tuple(ports), np.array(size, complex)))
    return total if np.any(total.imag) else total.real
