"""Exact linearisation of a model at a state."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .._lib.border import core_errors
from ..errors import MbrsWarning, ModelError
from ..model.model import Model
from ..results import Stats
from ..system.effects import check_without, effects
from ..system.snapshot import Snapshot
from ..system.state import State, state_of
from .linearization import Linearization
from .parts import split_damping, split_stiffness
from .rounding import motion_scale, stiffness_without_rounding

# Rounding of a few dozen terms that cancel, relative to their size.
_CANCELLED = 1e-14
# An unbalanced force above this part of all forces makes a linearisation at rest questionable.
BALANCED = 1e-6


def linearize(m: Model, *, at: Any = None, without: Sequence[str] = ()) -> Linearization:
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
    with core_errors():
        r = snapshot.system.linearize(
            state.q, state.rate, list(without), state.memory.tolist(), state.acceleration.tolist()
        )
    return linearization_at(snapshot, state, r, without, start, warn=True)


def linearization_at(
    snapshot: Snapshot, state: State, r: dict[str, Any], without: tuple[str, ...], start: float, warn: bool
) -> Linearization:
    """The linearisation that the core's matrices ``r`` at a state make, without what rounding left in them."""
    model = snapshot.model
    r = _seen_from(state, r)
    D, S = _without_rounding(snapshot, state, r) if state.moving else (r["D"], r["S"])
    sizes = np.asarray(r["force_sizes"])
    reach = motion_scale(r["T"], snapshot.system.characteristic_length)
    forces = np.outer(np.sqrt(sizes) * reach, np.sqrt(sizes) * reach)
    C, G = split_damping(D, state.moving or _cross_coupled(model, "c"))
    K, N = split_stiffness(S, forces, conservative=not state.moving and not _has_no_potential(model))
    natural = sizes * reach
    left_over = np.divide(np.abs(r["residual"]), natural, out=np.zeros(len(reach)), where=natural > 0.0)
    error = float(np.max(left_over, initial=0.0))
    if state.kind == "equilibrium" and error > BALANCED:  # of values that have changed since
        state = replace(state, kind="given")
    if warn and not state.moving and error > BALANCED:
        warnings.warn(
            f"the {state.kind} state of {model.name!r} is not in balance: {_unbalance(r)}; linearise at mb.equilibrium(m) instead",
            MbrsWarning,
            stacklevel=3,
        )
    on = tuple(e for e in effects(model).on if e not in without)
    made = Linearization(
        M=r["M"],
        C=C,
        G=G,
        K=K,
        N=N,
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
    return made if state.moving else made.replaced(K=stiffness_without_rounding(made, reach, forces))


def _unbalance(r: dict[str, Any]) -> str:
    """The coordinate that a state off balance sets in motion most, and how much."""
    try:
        acceleration = np.linalg.solve(r["M"], r["residual"])
    except np.linalg.LinAlgError:  # a coordinate without inertia
        worst = int(np.argmax(np.abs(r["residual"])))
        return f"{r['residual'][worst]:.3g} N or N m are unbalanced at {r['coordinates'][worst]!r}"
    worst = int(np.argmax(np.abs(acceleration)))
    return f"{r['coordinates'][worst]!r} would accelerate at {-acceleration[worst]:.3g} (m or rad)/s2"


def _seen_from(state: State, r: dict[str, Any]) -> dict[str, Any]:
    """D and S of increments z in the axes of a steady motion, y = exp(W t) z: D + 2 M W and S + D W + M W^2."""
    W = state.turn
    if W is None:
        return r
    if W.shape != r["M"].shape:
        raise ModelError(
            f"at= is a steady motion with {len(W)} degrees of freedom, which are {len(r['M'])} here; compute it again from this model, "
            "with the same effects"
        )
    D = np.zeros_like(r["M"]) if r["D"] is None else r["D"]
    return {**r, "D": D + 2.0 * r["M"] @ W, "S": r["S"] + D @ W + r["M"] @ W @ W}


def _without_rounding(snapshot: Snapshot, state: State, r: dict[str, Any]) -> tuple[np.ndarray | None, np.ndarray]:
    """D and S of a moving state without entries that inertia terms leave where they cancel.

    Rotation at w adds terms of size w^2 sqrt(M_ii M_jj) to S_ij and w sqrt(M_ii M_jj) to D_ij. Their rounding in a row that
    nothing else holds, that of the turning itself, would pass for a stiffness there. It is taken out here, where w is known:
    the matrices alone do not tell it from a weak spring beside a stiff one, and in a plane motion D is rounding as well.
    """
    spin = np.linalg.norm(snapshot.system.bodies(state.q, state.rate)["angular_velocity"], axis=1)
    w = float(np.max(spin, initial=0.0))
    size = np.sqrt(np.diag(r["M"]))
    rounding = _CANCELLED * np.outer(size, size)

    def cleaned(x: np.ndarray, scale: float) -> np.ndarray:
        return np.where(np.abs(x) <= scale * rounding, 0.0, x)

    D = r["D"]
    return None if D is None else cleaned(D, w), cleaned(r["S"], w * w)


def _has_no_potential(model: Any) -> bool:
    """True where loads turn with a body, torques are fixed in the world (their work depends on the order of turns), or bushings couple
    across.
    """
    follows = any(load.frame == "body" or load.type == "torque" for load in model.loads)
    return follows or _cross_coupled(model, "k")


def _cross_coupled(model: Any, name: str) -> bool:
    """True where a full 6 x 6 bushing is not symmetric, such as that of a journal bearing, and where a law sees several coordinates."""
    if any(len(law.components) > 1 for laws in model.laws.values() for law in laws):
        return True
    cached = model.cache.get("full bushings")
    if cached is None or cached[0] != model.structure_version:
        full = [(e.name, n) for e in model.elements for n in ("k", "c") if e.shapes.get(n) == (6, 6)]
        cached = model.cache["full bushings"] = (model.structure_version, full)
    values = (model.value(f"{element}.{n}") for element, n in cached[1] if n == name)
    return any(not np.array_equal(k, k.T) for k in values)


def second_order_of(m: Any, at: Any, without: Sequence[str]) -> Linearization:
    """The linearisation, given or made, on which modes, transfer functions and responses work."""
    if isinstance(m, Linearization):
        if at is not None or tuple(without):
            raise ModelError("at= and without= belong to the call of mb.linearize that made this linearisation")
        return m
    if isinstance(at, Linearization) and not without and at.model is m:
        return at
    return linearize(m, at=at, without=without)
