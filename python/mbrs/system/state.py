"""States of a model: where its bodies are and how fast they move, consistent with all joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .._lib.checks import real_array, shown
from .._lib.warning import warn_user
from ..errors import DoubtfulWarning, ModelError

if TYPE_CHECKING:
    from ..model.bodies import Body
    from ..model.model import Model

AT_REST = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Orbit:
    """A motion that repeats itself with the turn of a rotor: its period; coordinates, rates and accelerations (2 N, ...) of the tree at
    even times; W of the axes over all its coordinates; states of the air (2 N, m), each seen from its blade.
    """

    period: float
    q: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    W: np.ndarray
    states: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class State:
    """Poses and velocities of all bodies, as the core holds them.

    Attributes
    ----------
    q
        (n_q,) coordinates of the joints in the order of the tree (lengths in m, angles in rad that grow over turns, unit quaternions
        of spherical and free joints), then modal coordinates; made by the analyses, not by hand.
    rate
        (n_tree,) rates of the tree coordinates, or empty at rest.
    kind
        "drawn" (sensitivities then know the given velocities), "equilibrium" or "steady" (they follow it), or "given".
    memory
        (n_memory,) what laws with memory remember, or empty: centred.
    t
        s; the time it was taken at.
    driven
        Indices of the tree coordinates that a steady motion keeps at their speeds.
    acceleration
        (n_tree,) of the tree coordinates whose rates turn in a steady motion, or empty: zero.
    turn
        (dof, dof) W in rad/s: increments y = exp(W t) z have constant coefficients in z; None where y itself has.
    frame
        Axes of z: "fixed", "rotating", "joint" or "multiblade"; empty but for a steady motion.
    air
        The wake at the end of a motion, with which another goes on; None elsewhere.
    orbit
        The turn that this state begins, where linear analyses average over it; None elsewhere.
    """

    q: np.ndarray
    rate: np.ndarray
    kind: str = "given"
    memory: np.ndarray = field(default_factory=lambda: np.zeros(0))
    t: float = 0.0
    driven: tuple[int, ...] = ()
    acceleration: np.ndarray = field(default_factory=lambda: np.zeros(0))
    turn: np.ndarray | None = None
    frame: str = ""
    air: object | None = None
    orbit: Orbit | None = None

    @property
    def moving(self) -> bool:
        """True where any rate is not zero."""
        return bool(np.any(self.rate))

    def deformed(self, model: Model, body: Body | str, q: ArrayLike, rate: ArrayLike | None = None) -> State:
        """The same with a flexible body bent: what starts ``at`` it begins there.

        Parameters
        ----------
        model
            The model of this state.
        body
            A flexible body of it, or its name.
        q
            (m,) its modal coordinates, in the units of its modes.
        rate
            (m,) their rates, per second; as they are without it.

        Returns
        -------
        State
            All other coordinates are kept: joints at nodes of the body are closed again by the motion that starts from it.

        Raises
        ------
        ModelError
            Not a flexible body of the model, or another number of values.

        Examples
        --------
        >>> import numpy as np
        >>> import mbrs as mb
        >>> m = mb.Model("boom")
        >>> boom = m.flexible_body("boom", mb.flexible.beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=4.0, modes=2))
        >>> clamp = m.fixed("clamp", m.ground, boom.node("root"))
        >>> start = mb.linearize(m).state.deformed(m, boom, 1e-3 * np.ones(boom.n_modes))
        >>> traj = mb.simulate(m, t=0.01, at=start)
        """
        from ..model.tables import modal_part, modal_places, tables
        from .compiled import compiled

        name, held = getattr(body, "name", body), tables(model)
        places = {model.bodies[number].name: place for number, place in modal_places(held)}
        if name not in places:
            known = ", ".join(map(repr, places)) or "none"
            raise ModelError(f"{shown(name)} is not a flexible body of {model.name!r}; it has: {known}")
        place = places[name]
        rates = self.rate if self.rate.size else np.zeros(compiled(model).n_tree)
        out = []
        for what, values, given in (("q", self.q, q), ("rate", rates, rate)):
            new = np.array(values, dtype=float)
            if given is not None:
                own = real_array(f"{what}= of {name!r}", given, (place.stop - place.start,))
                modal_part(held, new)[place] = own
            out.append(new)
        return replace(self, q=out[0], rate=out[1], kind="given")


class HasState(Protocol):
    """A result that is a state: an equilibrium, a steady motion, a linearisation."""

    @property
    def state(self) -> State:
        """Poses and velocities of all bodies."""


# What ``at=`` takes: None is the drawn state.
StateLike = State | HasState | None


def drawn(model: Any, system: Any, hold: bool = True, without: Sequence[str] = ()) -> State:
    """The drawn configuration with its given velocities: two-point joints brought together, loops closed.

    ``hold``: drives stand still at their value of t = 0, as linear analyses see them.
    """
    from .._lib.border import core_errors

    with core_errors():
        made = system.assemble(hold, list(without))
    if made["velocities_contradict"]:
        warn_user(
            f"the given velocities of {model.name!r} contradict its joints; they were changed by up to "
            f"{made['velocity_correction']:.3g} m/s to agree"
        )
    return State(made["q"], made["rate"], "drawn")


def doubt(joints: Sequence[str], value: float, redundant: bool, tolerance: float) -> str:
    """A sentence on constraints that the drawing decides only just."""
    named = ", ".join(repr(j) for j in joints[:6]) + (f" and {len(joints) - 6} more" if len(joints) > 6 else "")
    if redundant:
        return (
            f"the loop of {named} is taken to move: as drawn its joints lock each other, but only by {value:.1e} (radians, or parts "
            f"of its length), less than the tolerance {tolerance:.1e} of the drawing"
        )
    return (
        f"the loop of {named} is locked by no more than {value:.1e} (radians, or parts of its length): it would move if its axes and "
        f"points agreed better; free one rotation, or use Model(tolerance={4 * value:.1e}) if the drawing is no more accurate"
    )


def doubts_of(system: Any, without: Sequence[str] = ()) -> tuple[str, ...]:
    """Sentences about constraints that the drawing decides only just."""
    from .._lib.border import core_errors

    with core_errors():
        found = system.doubts(list(without))
    return tuple(dict.fromkeys(doubt(*d) for d in found))


def warn_of_doubts(model: Any, system: Any, without: Sequence[str] = ()) -> None:
    """Name the loops of a model whose rank the tolerance of the drawing decides."""
    for sentence in doubts_of(system, without):
        warn_user(f"{model.name!r}: {sentence}", DoubtfulWarning)


def state_of(model: Any, system: Any, at: StateLike, hold: bool = True, without: Sequence[str] = ()) -> State:
    """The state that ``at=`` means: None (drawn), a `State`, or a result that carries one."""
    warn_of_doubts(model, system, without)
    if at is None:
        return drawn(model, system, hold, without)
    state = getattr(at, "state", at)
    if callable(state) or not isinstance(state, State):
        raise ModelError(
            f"at= takes None (the drawn state), an equilibrium, a steady motion or a state; got {shown(at)}"
        )
    if state.q.shape != (system.n_q,):
        raise ModelError(
            f"at= is a state of {state.q.size} coordinates, but model {model.name!r} has {system.n_q}; compute it again from this "
            f"model, with the same effects"
        )
    return state
