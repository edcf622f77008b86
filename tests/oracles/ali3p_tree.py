"""A whole model for the reference's ALI3-P: tree coordinates with the rows of cut joints, as the core has them.

Numbers x may be complex: a complex step in them goes through assembly, start and all steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from mbrs.reference import dynamics as dyn
from mbrs.reference.assembly import assemble, constraint_values
from mbrs.reference.kinematics import State, System, advance, first_guess, split, twists_of
from mbrs.reference.motion import explicit_rates, tree_map, velocity_rows
from mbrs.reference.reader import located_points
from mbrs.reference.simulate import mass_matrix
from mbrs.reference.so3 import Array
from oracles.ali3p import Mechanism
from oracles.steps import turned_increment


class TreeMechanism(Mechanism):
    """The tables of a model, with other numbers x if given; p is not used."""

    def __init__(self, tables: Mapping[str, Any], x: Array | None = None) -> None:
        self.tables, self.sys = tables, System(tables, x)
        self.n = self.sys.ny
        velocity = velocity_rows(self.sys)
        self._order = np.argsort(velocity, kind="stable")
        self.n_velocity = int(velocity.sum())
        self.n_position = len(velocity) - self.n_velocity

    def real(self) -> TreeMechanism:
        """The same at real numbers."""
        return TreeMechanism(self.tables, self.sys.x.real) if np.iscomplexobj(self.sys.x) else self

    def start(self, p: Array) -> tuple[State, Array]:
        """The assembled drawn state; rates joint by joint closest to the given velocities, then changed as little as the rows
        ask for, angles weighed by the characteristic length.
        """
        sys = self.sys
        sys.t = 0.0
        state = assemble(sys, first_guess(sys))
        T, length = tree_map(sys, state)[0].value, self._length()
        v = twists_of(state)
        rate = np.zeros(sys.ny, dtype=np.result_type(T, v))
        weight = np.repeat([1.0, length], 3)
        for t in sys.tree:
            body, own = slice(6 * t.outer, 6 * t.outer + 6), slice(t.start, t.stop)
            column, miss = weight[:, None] * T[body, own], weight * (v[body] - T[body] @ rate)
            rate[own] = np.linalg.solve(column.T @ column, column.T @ miss)
        J = self.rows(0.0, state, p) * np.where(sys.is_length, length, 1.0)
        if len(J):
            # the normal equations with what is redundant left out
            keep = _independent(J.real)
            scaled = rate / np.where(sys.is_length, length, 1.0)
            miss = J @ scaled + explicit_rates(sys)[0][self._order]
            change = J[keep].T @ np.linalg.solve(J[keep] @ J[keep].T, miss[keep])
            rate = rate - change * np.where(sys.is_length, length, 1.0)
        return replace(state, v=0 * state.v, w=0 * state.w), rate

    def _length(self) -> Array:
        """The characteristic length with its derivative."""
        points = located_points(self.tables, self.sys.x, self.sys.bodies)
        away = np.sum((points - points.mean(axis=0)) ** 2, axis=1)
        length: Array = np.sqrt(away[np.argmax(away.real)])
        return length if length.real > 0 else np.ones(())

    def advance(self, q: State, dq: Array) -> State:
        """Poses moved along the joints."""
        return advance(self.sys, q, dq)

    def turned(self, x: Array, h: float, v0: Array, v1: Array) -> Array:
        """With the commutator of three rotations that act together."""
        return turned_increment(self.sys, x, h, v0, v1)

    def _maps(self, q: State, v: Array) -> tuple[State, Any, Any]:
        """The state with the velocities of the rates, and the maps with their rates."""
        T = tree_map(self.sys, q)[0].value
        linear, angular = split(T @ v)
        state = replace(q, v=linear, w=angular)
        return (state, *tree_map(self.sys, state, moving=True))

    def mass(self, q: State, p: Array) -> Array:
        """T^T M T."""
        return mass_matrix(self.sys, q)

    def residual(self, t: float, q: State, v: Array, a: Array, p: Array) -> Array:
        """T^T (M (T a + T' v) + h - Q)."""
        self.sys.t = t
        state, T, _ = self._maps(q, v)
        return T.value.T @ dyn.applied_residual(self.sys, state, T.value @ a + T.derivative(1) @ v)

    def phi(self, t: float, q: State, p: Array) -> Array:
        """Values of the cut rows."""
        self.sys.t = t
        return constraint_values(self.sys, q, self.sys.cut)

    def rows(self, t: float, q: State, p: Array) -> Array:
        """Their Jacobian, then the velocity rows."""
        return tree_map(self.sys, q)[1].value.T[self._order]

    def rate(self, t: float, q: State, v: Array, p: Array) -> Array:
        """J v + Phi_t."""
        self.sys.t = t
        return self.rows(t, q, p) @ v + explicit_rates(self.sys)[0][self._order]

    def bias(self, t: float, q: State, v: Array, p: Array) -> Array:
        """J' v + Phi_tt."""
        self.sys.t = t
        return (self._maps(q, v)[2].derivative(1).T @ v + explicit_rates(self.sys)[1])[self._order]


def _independent(J: Array) -> Array:
    from mbrs.reference.linear import pivots

    return np.array(pivots(J.T), dtype=int)
