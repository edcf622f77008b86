"""Four-step BDF in tree coordinates, solved by inverse quasi-Newton updates: no Jacobian of the equations.

docs/theory.md (17.12), (17.13):

    ggl:        theta' - T(theta) v + S J^T mu = 0,  M v' + h + J^T lam = 0,  Phi = 0,  J v = 0
    symmetric:  v = T^-1(theta) theta',              M v' + h + J^T lam = 0,  Phi = 0;  v projected afterwards

theta are increments from the last pose; T = J_l^-1 where three rotations act together. The start is by small steps of
the classical Runge-Kutta method.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mbrs.errors import ConvergenceError
from mbrs.reference import dynamics as dyn
from mbrs.reference.assembly import constraint_values, scales
from mbrs.reference.kinematics import State, System, advance
from mbrs.reference.motion import (
    Motion,
    explicit_rates,
    increment_rates,
    remember,
    tree_map,
    velocity_rows,
    with_rates,
)
from mbrs.reference.simulate import mass_matrix
from mbrs.reference.so3 import Array
from oracles.bdf import WEIGHTS
from oracles.root import root
from oracles.runge_kutta import accelerations, independent_rows, integrate, project
from oracles.runge_kutta import start as at_start
from oracles.steps import difference

START_PARTS = 64
CURVATURE = 0.1
_SOLVE: dict[str, Any] = {"tol": 1e-13, "fallback": False, "restarts": 0, "patience": 6}


@dataclass
class Course:
    """Motions step by step, and what the solver took."""

    motions: list[Motion] = field(default_factory=list)
    iterations: int = 0
    evaluations: int = 0
    formations: int = 0


def rates_of_increments(sys: System, increment: Array, speed: Array) -> Array:
    """The way back of `increment_rates`, by solving for its columns."""
    columns = np.array([increment_rates(sys, increment, e) for e in np.eye(sys.ny)]).T
    return np.linalg.solve(columns, speed)


class _Step:
    """Equations of one step in unknowns without unit; ``past`` holds the present motion and three before it."""

    def __init__(self, sys: System, past: list[Motion], slope: Array, h: float, form: str) -> None:
        self.sys, self.now, self.form, self.g = sys, past[0], form, h / WEIGHTS[0]
        self.rows, self.n_position = independent_rows(sys, self.now.state)
        M = mass_matrix(sys, self.now.state)
        _, length = scales(sys)
        self.inertia = float(np.mean(np.diag(M) * length**2))
        self.sigma = np.sqrt(self.inertia / np.diag(M))
        self.rho = scales(sys)[0][self.rows]
        back = [difference(sys, self.now.state, p.state) for p in past]
        self.theta_past = sum(w * y for w, y in zip(WEIGHTS[1:], back, strict=True)) / h
        self.rate_past = sum(w * p.rate for w, p in zip(WEIGHTS[1:], past, strict=True)) / h
        self.theta0 = h * self.now.rate + 0.5 * h * h * slope
        self.rate0 = self.now.rate + h * slope
        self.position = np.flatnonzero(~velocity_rows(sys))

    @property
    def size(self) -> int:
        n, m = self.sys.ny, len(self.rows)
        return 2 * n + m + self.n_position if self.form == "ggl" else n + m

    def motion(self, x: Array) -> tuple[Array, Motion, Array, Array]:
        """theta, the motion, multipliers of the kept rows, and mu."""
        n, m = self.sys.ny, len(self.rows)
        theta = self.theta0 + self.sigma * x[:n]
        if self.form == "ggl":
            rate, rest = self.rate0 + self.sigma * x[n : 2 * n] / self.g, x[2 * n :]
        else:
            rate, rest = rates_of_increments(self.sys, theta, theta / self.g + self.theta_past), x[n:]
        moved = Motion(advance(self.sys, self.now.state, theta), rate, self.now.memory)
        return theta, moved, rest[:m] * self.rho * self.inertia / self.g**2, rest[m:]

    def __call__(self, x: Array) -> Array:
        theta, m, lam, mu = self.motion(x)
        sys, state = self.sys, with_rates(self.sys, m)
        T, Jt = tree_map(sys, state, moving=True)
        J = Jt.value.T[self.rows]
        a = m.rate / self.g + self.rate_past
        bodies = T.value @ a + T.derivative(1) @ m.rate
        force = T.value.T @ dyn.applied_residual(sys, state, bodies, memory=m.memory) + J.T @ lam
        out = [self.g**2 / self.inertia * self.sigma * force]
        which = np.searchsorted(self.position, self.rows[: self.n_position])
        gaps = constraint_values(sys, state, sys.cut)[which] if len(which) else np.zeros(0)
        gaps = gaps * self.rho[: self.n_position]
        rates = self.g * self.rho * (J @ m.rate + explicit_rates(sys)[0][self.rows])
        if self.form == "ggl":
            speed = theta / self.g + self.theta_past - increment_rates(sys, theta, m.rate)
            stabilising = self.sigma * (J[: self.n_position].T @ (self.rho[: self.n_position] * mu))
            return np.concatenate([self.g * speed / self.sigma + stabilising, *out, gaps, rates])
        return np.concatenate([*out, gaps, rates[self.n_position :]])


def _slope(sys: System, m: Motion) -> Array:
    return accelerations(sys, m, independent_rows(sys, m.state)[0])


def start_motions(sys: System, state: State, rate: Array, h: float, n: int = 3) -> list[Motion]:
    """The present motion and n after it, h (s) apart, by steps of h/64."""
    begin = at_start(sys, state, rate)
    rows, n_position = independent_rows(sys, state)
    fine = integrate(sys, project(sys, begin, rows, n_position), h / START_PARTS, START_PARTS * n)
    return fine[::START_PARTS]


def bdf_bfgs(
    sys: System,
    state: State,
    rate: Array,
    h: float,
    n: int,
    form: str = "ggl",
    method: str = "inverse-bfgs",
    begin: list[Motion] | None = None,
) -> Course:
    """n steps of length h (s) from poses and tree rates (ny,); three of them are the start, or given as ``begin``."""
    course = Course(list(begin or start_motions(sys, state, rate, h, min(3, n))))
    H = None
    while len(course.motions) <= n:
        past = course.motions[:-5:-1]
        sys.t = (len(course.motions) - 1) * h
        slope = _slope(sys, past[0])
        sys.t += h
        step = _Step(sys, past, slope, h, form)
        for guess, last in ((H, False), (None, False), (None, True)):
            course.formations += guess is None
            way = "broyden" if last else method
            found = root(step, np.zeros(step.size), way, H0=guess, curvature=CURVATURE, **_SOLVE)
            course.iterations += len(found.norms) - 1
            course.evaluations += found.evaluations
            if min(found.norms) < 1e-11:
                break
        else:
            raise ConvergenceError(f"step {len(course.motions)} did not converge: norm {min(found.norms):.1e}")
        H = found.H
        m = step.motion(found.x)[1]
        if form == "symmetric":
            m = project(sys, m, step.rows, 0)
        course.motions.append(Motion(m.state, m.rate, remember(sys, m)))
    return course
