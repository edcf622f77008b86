"""Exact linearisation of a model at a state."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.warning import warn_user
from ..errors import ModelError
from ..model.model import Model
from ..results import Stats
from ..system.air_flow import require_covered_at
from ..system.effects import check_without, effects
from ..system.snapshot import Snapshot
from ..system.state import State, state_of
from .linearization import Linearization
from .periodic_turn import orbit_matrices

if TYPE_CHECKING:
    from ..system.state import StateLike

BALANCED: float = _core.BALANCED


def linearize(m: Model, *, at: StateLike = None, without: Sequence[str] = ()) -> Linearization:
    """Linearise a model exactly at a state.

    M y" + (C + G) y' + (K + N) y = B^T f, with y the increments of the minimal coordinates: springs, preload, follower
    loads, gravity, gyroscopic and centrifugal terms, and the geometric stiffness of all constraint forces.

    Parameters
    ----------
    m
        The model, with its present values.
    at
        None: the drawn state with its given velocities; or an equilibrium, a steady motion, a state.
    without
        Names of effects to leave out, see `mb.effects`.

    Returns
    -------
    Linearization

    Raises
    ------
    AssemblyError
        Loops that cannot close.
    SingularError
        A singular pose.

    Warns
    -----
    MbrsWarning
        At rest off equilibrium: the matrices then belong to a state that does not last.

    Notes
    -----
    Equations: docs/theory.md (5.1) to (5.6).
    Cost O(n_bodies * depth) for the tree, O(path^2) for each element, O(n^3) where loops are closed. Recursions
    after Singh,
    Russo and Wensing (IEEE Robotics and Automation Letters 7(2), 2022), transformation after Jiang, Chen and Luo
    (2011).

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("rod", gravity=(0, -9.81, 0))
    >>> rod = m.body("rod", mass=1.0, inertia=(1/12, 1e-3, 1/12), at=(0, -0.5, 0))
    >>> hinge = m.revolute("hinge", m.ground, rod, at=(0, 0, 0), axis="z")
    >>> mb.linearize(m).K.round(6).tolist()
    [[4.905]]
    """
    start = time.perf_counter()
    without = check_without(without)
    snapshot = Snapshot.of(m, without)
    state = state_of(m, snapshot.system, at)
    if state.orbit is not None:
        return averaged(snapshot, state, without, start)
    r = matrices_at(snapshot, state, without)
    return linearization_at(snapshot, state, r, without, start, warn=True)


def matrices_at(snapshot: Snapshot, state: State, without: Sequence[str]) -> dict[str, Any]:
    """The core's linearisation at a state, in the axes of a steady motion."""
    with core_errors():
        found: dict[str, Any] = snapshot.system.linearize(
            state.q, state.rate, list(without), state.memory.tolist(), state.acceleration.tolist(), state.turn
        )
    return found


def averaged(snapshot: Snapshot, state: State, without: tuple[str, ...], start: float) -> Linearization:
    """The linearisation at the beginning of a periodic motion with the means of its matrices over the turn."""
    assert state.orbit is not None
    found = linearization_at(snapshot, state, matrices_at(snapshot, state, without), without, start, warn=False)
    turn = orbit_matrices(snapshot, state.orbit, without, found.coordinates)
    M, D, S = turn.mean
    if turn.lags is not None:
        # states of the air come to rest in a linearisation, each in its blade
        E, P, R, A = turn.lags.mean
        A = A + turn.lags.turning
        D, S = D + E @ np.linalg.solve(A, R), S + E @ np.linalg.solve(A, P)
    with core_errors():
        core = _core.SecondOrder(0.5 * (M + M.T), 0.5 * (D + D.T), 0.5 * (D - D.T), 0.5 * (S + S.T), 0.5 * (S - S.T))
    return found.replaced(core=core, residual=np.zeros(found.n), over_turn=turn)


def linearization_at(
    snapshot: Snapshot, state: State, r: dict[str, Any], without: tuple[str, ...], start: float, warn: bool
) -> Linearization:
    """The linearisation of the core's matrices ``r`` at a state."""
    model, error = snapshot.model, r["error"]
    require_covered_at(snapshot, state, without)
    if state.kind == "equilibrium" and error > BALANCED:  # of values that have changed since
        state = replace(state, kind="given")
    if warn and not state.moving and error > BALANCED:
        warn_user(
            f"the {state.kind} state of {model.name!r} is not in balance: {_unbalance(r)}; linearise at mb.equilibrium(m) instead"
        )
    on = tuple(e for e in effects(model).on if e not in without)
    return Linearization(
        core=r["second_order"],
        coordinates=tuple(r["coordinates"]),
        T=r["T"],
        bodies=tuple(snapshot.tables["body_name"]),
        residual=r["residual"],
        multipliers=r["multipliers"],
        ground_coupling=r["ground_coupling"],
        state=state,
        without=without,
        snapshot=snapshot,
        modal_map=r["modal_map"] if "modal_map" in r else np.zeros((0, len(r["coordinates"]))),
        stats=Stats(time.perf_counter() - start, r["counts"], on, "minimal coordinates"),
        error=error,
        status="converged" if error <= BALANCED or state.moving else "off-equilibrium",
    )


def _unbalance(r: dict[str, Any]) -> str:
    """The coordinate that a state off balance sets in motion most, and how much."""
    try:
        acceleration = np.linalg.solve(r["second_order"].M, r["residual"])
    except np.linalg.LinAlgError:  # a coordinate without inertia
        worst = int(np.argmax(np.abs(r["residual"])))
        return f"{r['residual'][worst]:.3g} N or N m are unbalanced at {r['coordinates'][worst]!r}"
    worst = int(np.argmax(np.abs(acceleration)))
    return f"{r['coordinates'][worst]!r} would accelerate at {-acceleration[worst]:.3g} (m or rad)/s2"


def second_order_of(m: Any, at: Any, without: Sequence[str]) -> Linearization:
    """The linearisation, given or made, on which modes, transfer functions and responses work."""
    if isinstance(m, Linearization):
        if at is not None or tuple(without):
            raise ModelError("at= and without= belong to the call of mb.linearize that made this linearisation")
        return m
    if isinstance(at, Linearization) and not without and at.model is m:
        return at
    return linearize(m, at=at, without=without)
