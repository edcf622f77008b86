"""Closing loops, and the choice of minimal coordinates: q = B' B'' y with B'' = [-J_d^-1 J_i; 1]."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import AssemblyError, ModelError
from . import joints as jt
from . import so3
from .jets import Jet, jet, product, stack
from .kinematics import (
    Motion,
    State,
    System,
    advance,
    first_guess,
    link_pair,
    motion,
    place_modal,
    place_outer,
    relative_pose,
    tree_twists,
)
from .linear import minimum_norm, pivots
from .reader import Link
from .rows import Row, is_length
from .so3 import Array
from .topology import TreeJoint

RowsOf = Callable[[Link], list[Row]]


@dataclass
class Partition:
    """Dependent and independent tree coordinates and the independent cut rows."""

    dependent: Array
    independent: Array
    rows: Array


def cut_row_names(sys: System) -> list[str]:
    return [f"{link.name}[{i}]" for link in sys.cut for i in range(len(jt.all_rows(link)))]


def constraint_values(sys: System, state: State, links: Sequence[Link]) -> Array:
    bodies, out = motion(state), []
    for link in links:
        p = link_pair(link, bodies)
        if link.row is None:
            length = link.length if link.kind == "distance" else 0.0
            out += [jt.value(row, p) - length for row in jt.position_rows(link)]
        elif link.first is None:
            assert link.motion is not None
            phi = jt.value(link.row, p) - link.motion(sys.t)[0]
            turns = np.round(phi.real / (2 * np.pi)) if link.row[0] in ("angle", "beta") else 0.0
            out.append(phi - 2 * np.pi * turns)
        else:  # within half a turn of the drawn positions
            first = jt.value(link.first.row, link_pair(link.first, bodies))
            out.append(jt.value(link.row, p) - link.ratio * first - link.length)
    return np.array(out)


def row_map(links: Sequence[Link], bodies: Motion, twists: list[jt.Vectors], rows_of: RowsOf = jt.all_rows) -> Jet:
    """The rates (m,) of rows of links, for m motions with these twists, as columns of a jet (m, rows)."""
    out = []
    for link in links:
        if rows_of(link):
            parts = []
            for part, factor in jt.terms(link):
                p = link_pair(part, bodies)
                xi = p.twist(twists[part.a.body], twists[part.b.body])
                parts.append(factor * (jt.slopes(rows_of(part), p) @ xi.T))
            out.append(sum(parts[1:], parts[0]))
    return stack(out).T if out else jet(np.zeros((len(twists[-1][0].value), 0)))


def cut_jacobian(sys: System, bodies: Motion, twists: list[jt.Vectors], velocity: bool = True) -> Jet:
    """J^T (ny, nc) of the cut rows over the tree coordinates; without the rows that restrict velocities alone where positions
    are meant.
    """
    return row_map(sys.cut, bodies, twists, jt.all_rows if velocity else jt.position_rows)


def scales(sys: System, velocity: bool = True) -> tuple[Array, Array]:
    """Factors that make J free of units: rows in metres by 1/L_c, columns in metres by L_c."""
    rows_of = jt.all_rows if velocity else jt.position_rows
    rows = np.array([is_length(row) for link in sys.cut for row in rows_of(link)], dtype=bool)
    return np.where(rows, 1 / sys.length, 1.0), np.where(sys.is_length, sys.length, 1.0)


def jacobian(sys: System, state: State, velocity: bool = True) -> Array:
    """J = dPhi/dy (nc, ny) of the cut rows, unscaled."""
    bodies = motion(state)
    return cut_jacobian(sys, bodies, tree_twists(sys, bodies), velocity).value.T


def partition(sys: System, state: State, independent: Sequence[int] | None = None) -> Partition:
    """Dependent and independent coordinates, by column-pivoted QR of the scaled cut rows, or as told by ``independent``.

    Rows that restrict velocities alone take a freedom like the others: about a state at rest what they leave is a
    constant.
    """
    row_scale, column_scale = scales(sys)
    J = row_scale[:, None] * jacobian(sys, state) * column_scale
    dependent = pivots(J)
    if independent is not None:
        dependent = np.setdiff1d(np.arange(sys.ny), np.asarray(independent, dtype=int))
        if len(dependent) != len(pivots(J)) or len(pivots(J[:, dependent])) != len(dependent):
            raise ModelError(f"coordinates {list(independent)} do not determine the others; choose another set")
    rows = pivots(J[:, dependent].T)
    return Partition(dependent, np.setdiff1d(np.arange(sys.ny), dependent), rows)


def null_space(Jt: Jet, part: Partition) -> Jet:
    """B'' (ny, dof) with its derivatives, from J B'' = 0 differentiated as often as the jet asks."""
    ny, n = Jt.value.shape[-2], len(part.independent)
    J = [None if c is None else np.swapaxes(c, -1, -2)[..., part.rows, :] for c in Jt.c]
    assert J[0] is not None
    pivot = J[0][:, part.dependent]
    known = np.zeros((ny, n))
    known[part.independent, np.arange(n)] = 1.0
    place = np.eye(ny)[:, part.dependent]

    def depend(right: Array) -> Array:
        return place @ np.linalg.solve(pivot, -right)

    B: list[Array] = [known + depend(J[0] @ known)]
    if Jt.order >= 1 and J[1] is not None:
        B.append(depend(J[1] @ B[0]))
        if Jt.order >= 2:
            B.append(depend((0 if J[2] is None else J[2] @ B[0]) + 2 * J[1] @ B[1]))
    return Jet(*B, *[None] * (Jt.order + 1 - len(B)))


def twist_map(sys: System, bodies: Motion, part: Partition) -> Jet:
    """T = B' B'' (6 nb, dof) with its derivatives: per body the centre of mass's translation, then the rotation,
    world axes.
    """
    twists = tree_twists(sys, bodies)
    B1 = stack([half.T for body in twists[:-1] for half in body])
    if len(part.dependent) == 0:
        return product(np.matmul, B1, np.eye(sys.ny))
    return B1 @ null_space(cut_jacobian(sys, bodies, twists), part)


def assemble(sys: System, state: State, tolerance: float = 1e-13) -> State:
    """Bring the joints together: tree joints exactly, then cut ones by Newton steps of least norm in (length / L_c,
    angle). A tree joint keeps its free coordinates, read off the given poses as docs/tables.md defines them.

    The Jacobian's real part serves for the steps, so an imaginary part converges as well; both must before it ends.
    """
    dtype = np.result_type(state.r, state.R, sys.x, float)
    r, R = state.r.astype(dtype), state.R.astype(dtype)
    for t in sys.tree:
        if t.link.kind == "modal":
            place_modal(t, r, R)
            continue
        u, turn = relative_pose(t, state.r, state.R)
        turn, along = _free_turn(t, turn), np.where(np.isin(np.arange(3), t.translations), u, 0.0)
        place_outer(t, r, R, along + t.link.pitch * so3.atan2(turn[1, 0], turn[0, 0]) * np.eye(3)[2], turn)
    return close_loops(sys, State(r, R, state.v, state.w), tolerance)


def _free_turn(t: TreeJoint, R: Array) -> Array:
    """The rotation next to R that the joint allows."""
    z, x = np.eye(3)[2], np.eye(3)[0]
    if t.turns_freely:
        return R
    if t.link.kind in ("fixed", "prismatic"):
        return np.eye(3)
    if t.link.kind != "universal":
        return so3.exp(so3.atan2(R[1, 0], R[0, 0]) * z)
    R = R if t.sign > 0 else R.T
    turn = so3.exp(so3.atan2(R[1, 0], R[0, 0]) * z) @ so3.exp(so3.atan2(R[2, 1], R[2, 2]) * x)
    return turn if t.sign > 0 else turn.T


def close_loops(
    sys: System,
    state: State,
    tolerance: float = 1e-13,
    fixed: Sequence[int] | Array = (),
    ways: Callable[[State], Array] | None = None,
) -> State:
    """Newton on the cut rows; the tree coordinates in ``fixed`` get no increments. Steps are the shortest in (length / L_c, angle),
    or over the columns (ny, n) of ``ways``.
    """
    if not any(jt.position_rows(link) for link in sys.cut):
        return state
    row_scale, column_scale = scales(sys, velocity=False)
    basis = np.delete(np.diag(column_scale), np.asarray(fixed, dtype=int), axis=1)
    gap, imaginary = np.inf, np.inf
    for _ in range(60):
        phi = row_scale * constraint_values(sys, state, sys.cut)
        previous, gap, change = gap, np.max(np.abs(phi.real)), np.max(np.abs(phi.imag))
        done = gap <= tolerance or (gap <= 1e-9 and gap >= 0.5 * previous)  # the second: rounding far from the origin
        if done and (change == 0 or change >= 0.5 * imaginary):
            return state
        imaginary = change if done else np.inf
        basis = basis if ways is None else ways(state)
        J = row_scale[:, None] * jacobian(sys, state, velocity=False).real
        state = advance(sys, state, basis @ minimum_norm(J @ basis, -phi))
    raise AssemblyError(
        f"the loops do not close: gap {gap:.3g} (in units of {sys.length:.3g} m); check the joints' points"
    )


@dataclass
class Mobility:
    """Degrees of freedom of a system as drawn, rank of its cut rows, and the rows that others imply, as ``joint[row]``."""

    dof: int
    rank: int
    redundant: list[str]
    partition: Partition


def mobility(sys: System) -> Mobility:
    """The mobility of the assembled drawn state; rows are counted in the order of docs/tables.md."""
    part = partition(sys, assemble(sys, first_guess(sys)))
    kept = set(part.rows.tolist())
    redundant = [name for i, name in enumerate(cut_row_names(sys)) if i not in kept]
    return Mobility(len(part.independent), len(part.dependent), redundant, part)
