"""Steady motion: some tree coordinates turn at constant speed, all forces on the others balance."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from ..errors import ConvergenceError, ModelError
from .assembly import assemble, twist_map
from .kinematics import State, System, advance, first_guess, motion, split
from .linearize import Linearization, linearize
from .so3 import Array


def steady_motion(
    sys: System, speed: Mapping[str, float], tolerance: float = 1e-12, without: Collection[str] = ()
) -> tuple[Linearization, Array]:
    """rho(y, y', 0) = 0 on the coordinates that are not driven, y' = speed on those that are; open trees.

    Newton with the real part of S of the moving state, which is the derivative of rho at constant rates; the imaginary part of a
    complex step must converge as well. Returns the linearisation there and
    the generalised forces (n_driven,) that keep the speeds.
    """
    if sys.cut:
        raise ModelError("mbrs.reference finds steady motions of open trees only")
    driven = np.array([name in speed for name in sys.coordinates])
    rate = np.array([float(speed.get(name, 0.0)) for name in sys.coordinates])
    state = assemble(sys, first_guess(sys)).at_rest
    imaginary = np.inf
    for _ in range(60):
        lin = linearize(sys, turning(sys, state, rate), without=without)
        step = np.zeros(sys.ny, lin.residual.dtype)
        S = lin.S.real[np.ix_(~driven, ~driven)]
        step[~driven] = -np.linalg.lstsq(S, lin.residual[~driven], rcond=1e-12)[0]
        longest, previous = np.max(np.abs(step.real), initial=0.0), imaginary
        imaginary = np.max(np.abs(step.imag), initial=0.0)
        if longest <= tolerance and (imaginary == 0.0 or imaginary >= 0.5 * previous):
            return lin, lin.residual[driven]
        state = advance(sys, state, step * min(1.0, 0.3 / max(longest, 1e-300)))
    raise ConvergenceError("no steady motion within 60 steps; approach the speeds in steps", state)


def turning(sys: System, state: State, rate: Array) -> State:
    """The state with the velocities that rates of the tree coordinates make."""
    from .assembly import partition

    T = twist_map(sys, motion(state), partition(sys, state)).value
    v, w = split(T @ rate)
    return replace(state, v=v, w=w)
