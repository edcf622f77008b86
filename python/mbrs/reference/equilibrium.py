"""Static equilibria and steady motions by Newton's method in minimal coordinates; loops are closed after every step."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import ConvergenceError, ModelError
from . import dynamics as dyn
from .assembly import Partition, assemble, close_loops, cut_jacobian, null_space, partition, twist_map
from .kinematics import State, System, advance, first_guess, motion, moving, split, tree_twists
from .linearize import Linearization, linearize, nominal_motion
from .so3 import Array


def equilibrium(
    sys: System, state0: State | None = None, tolerance: float = 1e-13, without: Collection[str] = ()
) -> tuple[State, Array, float]:
    """T^T (Q - elements) = 0 at rest, from ``state0`` (the assembled first guess by default).

    Returns the state, the multipliers of all joint rows (least norm for redundant sets) and the largest scaled
    generalised force that is left.
    """
    sys = sys.leaving_out(without)
    start = assemble(sys, first_guess(sys) if state0 is None else state0)
    lin, left = _Balance(sys, np.zeros(sys.ny), np.ones(sys.ny, dtype=bool), without).near(start.at_rest, tolerance)
    return lin.state, lin.lam, left


def steady_motion(
    sys: System, speed: Mapping[str, float], tolerance: float = 1e-13, without: Collection[str] = ()
) -> tuple[Linearization, Array]:
    """rho(y, y', 0) = 0 on the coordinates that are not driven, y' = speed on those that are; open trees.

    Returns the linearisation there and the generalised forces (n_driven,) that keep the speeds.
    """
    if sys.cut:
        raise ModelError("mbrs.reference finds steady motions of open trees only")
    rate = np.array([float(speed.get(name, 0.0)) for name in sys.coordinates])
    free = np.array([name not in speed for name in sys.coordinates], dtype=bool)
    lin, _ = _Balance(sys, rate, free, without).near(assemble(sys, first_guess(sys)).at_rest, tolerance)
    return lin, lin.residual[~free]


def turning(sys: System, state: State, rate: Array) -> State:
    """The state with the velocities that rates of the tree coordinates make."""
    if not np.any(rate):
        return state.at_rest
    v, w = split(twist_map(sys, motion(state), partition(sys, state)).value @ rate)
    return replace(state, v=v, w=w)


@dataclass
class _Balance:
    """Forces on the ``free`` coordinates (ny,) while the tree coordinates have constant rates (ny,).

    Steps use the real part of S, which is the derivative of rho at constant rates, and its least-norm inverse where directions are
    unrestrained; an imaginary part (a complex step) converges by the same steps and is waited for.
    """

    sys: System
    rate: Array
    free: Array
    without: Collection[str]

    def near(self, state: State, tolerance: float) -> tuple[Linearization, float]:
        """The linearisation where they vanish, from a state near by, and the scaled force that is left."""
        lin = self._linearized(state)
        size, imaginary = self._size(lin.partition, lin.residual), np.inf
        for _ in range(100):
            change, scale = float(np.max(np.abs(lin.residual.imag), initial=0.0)), self._force_scale(lin)
            done = size <= tolerance * scale
            if done and (change == 0 or change >= 0.5 * imaginary):
                return lin, size / scale
            imaginary, previous = change if done else np.inf, size
            lin = self._linearized(self._step(lin, size))
            size = self._size(lin.partition, lin.residual)
            if not done and size >= previous and size <= 1e-9 * scale:  # rounding, not distance, is left
                tolerance = 2 * size / scale
        raise ConvergenceError(
            f"no balance within 100 steps: generalised force {size:.3g} is left; approach speeds in steps", lin.state
        )

    def _linearized(self, state: State) -> Linearization:
        return linearize(self.sys, turning(self.sys, state, self.rate), without=self.without)

    def _columns(self, part: Partition) -> Array:
        """Lengths of the coordinates, zero where they are driven."""
        columns = np.where(self.sys.is_length, self.sys.length, 1.0) * self.free
        return columns[part.independent]

    def _size(self, part: Partition, residual: Array) -> float:
        return float(np.max(np.abs((self._columns(part) * residual).real), initial=0.0))

    def _force_scale(self, lin: Linearization) -> float:
        """The size of the terms whose sum vanishes: loads and the forces of single elements."""
        now = moving(lin.state, np.zeros(6 * self.sys.nb))
        parts = (dyn.loads(self.sys, now).value, dyn.elements(self.sys, now).value, 1e-3 * lin.K)
        return max(*(np.max(np.abs(part.real), initial=0.0) for part in parts), 1e-300) * max(self.sys.length, 1.0)

    def _step(self, lin: Linearization, size: float) -> State:
        """One Newton step, halved until the unbalanced force falls; never more than half a radian or half of L_c."""
        columns, part = self._columns(lin.partition), lin.partition
        dz = -np.linalg.pinv((columns[:, None] * lin.S * columns).real, rcond=1e-12) @ (columns * lin.residual)
        longest = np.max(np.abs(dz.real), initial=0.0)
        dy = columns * dz * min(1.0, 0.5 / max(longest, 1e-300))
        for _ in range(12):
            new = self._moved(lin, dy)
            if longest < 1e-10 or self._unbalanced(new, part) < size:
                break
            dy = 0.5 * dy
        return new

    def _moved(self, lin: Linearization, dy: Array) -> State:
        """The state after increments of the independent coordinates."""
        sys, state, part = self.sys, lin.state, lin.partition
        y = np.zeros(sys.ny, dtype=dy.dtype)
        y[part.independent] = dy
        if len(part.dependent):
            bodies = motion(state)
            y = null_space(cut_jacobian(sys, bodies, tree_twists(sys, bodies)), part).value @ dy
        return close_loops(sys, advance(sys, state, y), fixed=part.independent)

    def _unbalanced(self, state: State, part: Partition) -> float:
        base = nominal_motion(self.sys, turning(self.sys, state, self.rate), part)
        return self._size(part, base.T.T @ dyn.applied_residual(self.sys, base.state, base.a, self.without))
