"""Static equilibrium of open and closed loops."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.progress import call_progress
from .._lib.text import Block, counted, without_rounding
from .._lib.warning import warn_user
from ..errors import ConvergenceError
from ..model.schema import BODY
from ..results import Result, Stats, derived, quantity, result
from ..system.effects import check_without, effects
from ..system.snapshot import Snapshot
from ..system.state import AT_REST, State, doubts_of, state_of, warn_of_doubts
from .linearization import Linearization
from .linearize import linearization_at
from .state_result import StateResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..model.model import Model
    from ..system.state import StateLike


@result
class Equilibrium(StateResult, Result):
    """A state at rest in which all forces balance.

    Attributes
    ----------
    state
        To be given as ``at=`` to other analyses (the result itself does as well).
    linearization
        The exact linearisation there.
    stable
        True where the stiffness has no negative eigenvalue.
    free_directions
        Names of coordinates along which nothing restrains the model and nothing pushes it.
    residual
        Largest unbalanced generalised force over the size of the forces on the bodies that it is connected with, at ``state``.
    status
        "converged", or "unresolved" where ``residual`` is above 1e-9: stiff parts make such forces of the rounding of places, and
        no search comes nearer.
    doubts
        A sentence for each loop of which the drawing decides only just whether it moves, with its joints; one where knife edges or
        rolling discs hold a place that is one of a family; and one that names the coordinates whose forces are unresolved.
    error
        Estimated distance to the exact equilibrium: the Newton step that is left, what closing leaves open of loops and what rounding of
        places hides, with it of the arms of forces and of the strains of springs, radians or characteristic lengths.
    """

    state: State
    linearization: Linearization
    stable: bool
    free_directions: tuple[str, ...]
    residual: float = quantity(unit="1")
    iterations: int
    doubts: tuple[str, ...] = ()

    row: ClassVar[str] = "body"
    axes: ClassVar[Mapping[str, str]] = {"body": "bodies", "joint": "joints"}

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of joints and drives, in the order of `reactions`."""
        return tuple(self.reactions)

    @property
    @derived(dims=("body", "axis"), unit="m", name="position")
    def _positions(self) -> np.ndarray:
        return self.poses["position"]

    @property
    @derived(dims=("body", "axis", "axis_"), unit="1", name="rotation")
    def _rotations(self) -> np.ndarray:
        return self.poses["rotation"]

    @property
    @derived(dims=("joint", "component"), label="wrench on the second body, N and N m", name="reaction")
    def _wrenches(self) -> np.ndarray:
        return np.array(list(self.reactions.values())).reshape(len(self.reactions), 6)

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "stable": int(self.stable)}

    @cached_property
    def reactions(self) -> dict[str, np.ndarray]:
        """Wrench (6,) of each joint on its second body at the joint's point, world axes, N and N m.

        Drives stand under their own names, on the second body of their joint; its own reaction is without them.

        Where constraints are redundant, rigid bodies do not decide how they share; these are the reactions of
        minimum norm,
        moments divided by the model's characteristic length.
        """
        snapshot = self.linearization.snapshot
        with core_errors():
            all_ = snapshot.system.reactions(self.state.q, AT_REST, list(self.linearization.without))
        names = [*snapshot.tables["joint_name"], *snapshot.tables["drive_name"]]
        return dict(zip(names, all_, strict=True))

    def heading(self) -> str:
        how = "stable" if self.stable else "UNSTABLE"
        return (
            f"equilibrium of {self.model.name!r}: {self.status}, {how}, {counted(self.iterations, 'iteration')}, "
            f"residual {self.residual:.1e}, error {self.error:.1e}"
        )

    def blocks(self) -> list[Block]:
        """Poses of the bodies, then the reactions."""
        snapshot = self.linearization.snapshot
        length, t = snapshot.system.characteristic_length, snapshot.tables
        drawn = np.array([t["x"][start:][BODY.block.slice("at")] for start in t["body_x"]]).reshape(-1, 3)
        moved = np.linalg.norm(self.poses["position"] - drawn, axis=1)
        scale = max(length, float(np.abs(drawn).max(initial=0.0)))
        numbers = without_rounding(np.column_stack([self.poses["position"], moved]), scale, float(self.error))
        poses = [[name, *line] for name, line in zip(self.bodies, numbers.tolist(), strict=True)]
        out = [Block(["body", "x [m]", "y [m]", "z [m]", "moved [m]"], poses, self.heading())]
        if self.reactions:
            forces = self._wrenches * [1.0, 1.0, 1.0, 1.0 / length, 1.0 / length, 1.0 / length]
            shown = np.where(without_rounding(forces, error=float(self.error)) == 0.0, 0.0, self._wrenches)
            lines = [[name, *line] for name, line in zip(self.joints, shown.tolist(), strict=True)]
            out.append(Block(["reaction", "Fx [N]", "Fy [N]", "Fz [N]", "Mx [N m]", "My [N m]", "Mz [N m]"], lines))
        if self.free_directions:
            out.append(Block(title="unrestrained and unloaded: " + "; ".join(self.free_directions)))
        out.extend(Block(title=f"doubtful: {sentence}") for sentence in self.doubts)
        return out

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """The drawn model in grey and the equilibrium in colour, seen in the plane in which it is widest; returns the figure."""
        from ..plot.models import equilibrium as draw

        return draw(self, ax=ax)


def equilibrium(m: Model, *, at: StateLike = None, without: Sequence[str] = ()) -> Equilibrium:
    """Static equilibrium: B''^T (f(y)) = 0 with all loops closed.

    Newton with steps along |K|^-1, each shortened until the force along it, or the next step (P. Deuflhard's natural test),
    has become smaller; after many shortened steps descent in energy by trust regions with second-order
    corrections; dynamic relaxation where that stalls. Knife edges and rolling discs that steer keep no place, since every place can
    be reached by going to and fro: rest is where they carry no force. It ends at a stable equilibrium unless the start is in
    balance already or forces have no potential (those that follow a body), where a warning says if it is not.

    Parameters
    ----------
    m
        The model, with its present values; velocities do not count.
    at
        Where to start: None (drawn), an equilibrium or a state.
    without
        Names of effects to leave out.

    Returns
    -------
    Equilibrium

    Raises
    ------
    SingularError
        A force acts along a direction that nothing restrains; the message names it.
    ConvergenceError
        No equilibrium within the iterations.
    AssemblyError
        Loops that cannot close.

    Notes
    -----
    Equations: docs/theory.md (4.1) to (4.4).
    Cost O(dof^3) per iteration. ``stats.counts`` tells "equilibrium iterations", and where they were needed "line-search
    steps", "descent steps", "second-order corrections", "relaxation steps" and "saddles left".

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("rod", gravity=(0, -9.81, 0))
    >>> rod = m.body("rod", mass=1.0, inertia=(1e-3, 1/12, 1/12), at=(0.5, 0, 0))
    >>> hinge = m.revolute("hinge", m.ground, rod, at=(0, 0, 0), axis="z")
    >>> mb.equilibrium(m).position("rod").round(9).tolist()
    [0.0, -0.5, 0.0]
    """
    start = time.perf_counter()
    without = check_without(without)
    snapshot = Snapshot.of(m, without)
    if at is None:
        warn_of_doubts(m, snapshot.system, without)
        with core_errors():
            made = snapshot.system.assemble()
        begin = State(made["q"], AT_REST)
    else:
        begin = state_of(m, snapshot.system, at)
    try:
        with call_progress(f"equilibrium of {m.name!r}", 100.0 * snapshot.system.n_tree**3):
            r = snapshot.system.equilibrium(begin.q, list(without))
    except _core.CoreConvergenceError as problem:
        text, best, residual = problem.args
        raise ConvergenceError(text, _partial(snapshot, best, without, residual, start)) from None
    except _core.CoreError:
        with core_errors():
            raise
    return _equilibrium(snapshot, r, without, start)


def _equilibrium(snapshot: Snapshot, r: dict[str, Any], without: tuple[str, ...], start: float) -> Equilibrium:
    state = State(r["q"], AT_REST, "equilibrium")
    if not r["stable"]:
        why = (
            "the search ended there; start it elsewhere with at= to find another"
            if r["iterations"]
            else "it started in balance already; draw it slightly off to let it fall to a stable one"
        )
        warn_user(f"the equilibrium of {snapshot.model.name!r} is unstable: {why}")
    linearization = linearization_at(snapshot, state, r, without, start, warn=False)
    return Equilibrium(
        state=state,
        linearization=linearization,
        stable=r["stable"],
        free_directions=tuple(r["free_directions"]),
        residual=r["relative_residual"],
        iterations=r["iterations"],
        doubts=(*doubts_of(snapshot.system, without), *_families(r["family"]), *_unresolved(r)),
        stats=Stats(time.perf_counter() - start, r["counts"], linearization.stats.effects, "Newton"),
        error=r["error"],
        status="converged" if r["unresolved"] is None else "unresolved",
    )


def _unresolved(r: dict[str, Any]) -> Sequence[str]:
    if r["unresolved"] is None:
        return ()
    return (
        f"rounding of places makes forces of {r['relative_residual']:.1e} of all forces along {r['unresolved']}: places are as near "
        "as numbers allow, forces in stiff parts are not; draw the model nearer to the origin, or replace what is so stiff by a joint",
    )


def _families(edges: Sequence[str]) -> tuple[str, ...]:
    if not edges:
        return ()
    named = ", ".join(repr(name) for name in edges)
    return (
        f"nothing but {named} restrains a direction, by a force that could hold the model elsewhere as well: the place is one "
        "of a family of equilibria, that to which the search came",
    )


def _partial(
    snapshot: Snapshot, best: Any, without: tuple[str, ...], residual: float, start: float
) -> Equilibrium | None:
    """The best state an unfinished search reached."""
    state = State(np.asarray(best, dtype=float), AT_REST)
    with core_errors():
        r = snapshot.system.linearize(state.q, AT_REST, list(without))
    on = tuple(e for e in effects(snapshot.model).on if e not in without)
    return Equilibrium(
        state=state,
        linearization=linearization_at(snapshot, state, r, without, start, warn=False),
        stable=False,
        free_directions=(),
        residual=residual,
        iterations=0,
        stats=Stats(time.perf_counter() - start, r["counts"], on, "Newton"),
        error=np.nan,
        status="max-iterations",
    )
