"""The modal method for a rotor in the frame that does not turn: Coleman's transformation, modes, superposition.

About steady rotation the rotor's increments y (blades, hub; turning axes) obey M y" + D y' + S y = f(t), constant for an
isotropic rotor. With multiblade coordinates and the hub's motion in fixed axes, y = T(t) z, T' = T W speed,

    M_f z" + D_f z' + S_f z = T^T f,  M_f = T^T M T, D_f = T^T (D + 2 speed M W) T, S_f = T^T (S + speed D W + speed^2 M W^2) T

are constant, too. Their modes, z = sum phi_j c_j, c_j' = s_j c_j + g_j(t), are superposed, exactly for loads that are linear
between the given times. Linear in the deflections: weight and air loads act on the undeformed rotor.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np

from . import dynamics as dyn
from .assembly import assemble, partition, twist_map
from .equilibrium import turning
from .kinematics import State, System, advance, drawn_state, motion, moving
from .linearize import linearize
from .so3 import Array


@dataclass
class FixedFrame:
    """A rotor in fixed axes: ``M``, ``D``, ``S`` (n, n) over z, roots and right shapes in state form."""

    M: Array
    D: Array
    S: Array
    eigenvalue: Array
    shape: Array
    periodic: float  # how far the matrices are from constant, relative


class Rotor:
    """A model that turns about one joint, without its drive, linearised about its steady rotation.

    ``joint``: name of that coordinate; ``blades``: names of equal flexible bodies, evenly spaced in the sense of the
    rotation; ``hub``: of a coordinate ``hub.x`` to ``hub.rz`` in axes that turn, z the axis.
    """

    def __init__(self, sys: System, joint: str, blades: Sequence[str], hub: str, speed: float) -> None:
        self.sys, self.speed = sys, speed
        names = sys.coordinates
        self.driven = names.index(joint)
        rate = np.eye(sys.ny)[self.driven] * speed
        self.state = turning(sys, assemble(sys, drawn_state(sys)).at_rest, rate)
        bare = copy(sys)
        bare.loads = []
        lin = linearize(bare, self.state, without=("gravity",))
        self.kept = [i for i in range(sys.ny) if i != self.driven]
        self.names = [names[i] for i in self.kept]
        pick = np.ix_(self.kept, self.kept)
        self.M, self.D, self.S = (X[pick] for X in (lin.M, lin.D, lin.S))
        self.inertia = lin.residual[self.kept]  # what the rotation alone asks for
        m = sum(name.startswith(f"{blades[0]}.q") for name in names)
        self.blades = np.array([[self.names.index(f"{b}.q{k + 1}") for b in blades] for k in range(m)])
        axes = [[self.names.index(f"{hub}.{e}") for e in group] for group in (("x", "y"), ("rx", "ry"))]
        self.hub = np.array(axes)

    def transformation(self, t: float) -> tuple[Array, Array]:
        """T (dof, dof) and W with T' = T W speed."""
        n, psi = len(self.names), self.speed * t
        T, W = np.eye(n), np.zeros((n, n))
        count = self.blades.shape[1]
        around = psi + 2 * np.pi * np.arange(count) / count
        for places in self.blades:  # q_i = a_0 + a_1 cos psi_i + b_1 sin psi_i
            T[np.ix_(places, places)] = np.stack([np.ones(count), np.cos(around), np.sin(around)], axis=1)
            W[places[1], places[2]], W[places[2], places[1]] = 1.0, -1.0
        c, s = np.cos(psi), np.sin(psi)
        for places in self.hub:  # fixed components to turning ones
            T[np.ix_(places, places)] = [[c, s], [-s, c]]
            W[places[0], places[1]], W[places[1], places[0]] = 1.0, -1.0
        return T, W

    def matrices(self, t: float) -> tuple[Array, Array, Array]:
        """M_f, D_f and S_f."""
        T, W = self.transformation(t)
        w = self.speed
        # T' = T W w, so that the products with W stand behind T
        M, D, S = (T.T @ X @ T for X in (self.M, self.D, self.S))
        return M, D + 2 * w * M @ W, S + w * D @ W + w**2 * M @ W @ W

    def fixed(self) -> FixedFrame:
        """The matrices, which must be constant over a turn, and their modes."""
        M, D, S = self.matrices(0.0)
        others = [self.matrices(t / self.speed) for t in (0.7, 1.9, 4.4)]
        varies = max(np.abs(a - b).max() / np.abs(a).max() for o in others for a, b in zip((M, D, S), o, strict=True))
        n = len(M)
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, S), -np.linalg.solve(M, D)]])
        s, phi = np.linalg.eig(A)
        order = np.argsort(np.abs(s), kind="stable")
        return FixedFrame(M, D, S, s[order], phi[:, order], float(varies))

    def load(self, t: float) -> Array:
        """f(t) of weight and applied loads on the undeformed rotor, turned to where it is then."""
        sys, sys.t = self.sys, t
        y = np.zeros(sys.ny)
        y[self.driven] = self.speed * t
        there: State = advance(sys, self.state.at_rest, y)
        T = twist_map(sys, motion(there), partition(sys, there)).value
        weight = dyn.loads(sys, moving(there, np.zeros(6 * sys.nb))).value[0]
        return (T.T @ weight)[self.kept] - self.inertia

    def superposed(self, t: Array) -> Array:
        """The motion (n_t, dof) in turning axes, from rest there, over all modes in fixed axes.

        c' = s c + g with g linear between the times is integrated exactly.
        """
        fixed, n = self.fixed(), len(self.names)
        s, right, left = fixed.eigenvalue, fixed.shape[:n], np.linalg.inv(fixed.shape)[:, n:]
        turns = [self.transformation(v)[0] for v in t]
        g = np.array([left @ np.linalg.solve(fixed.M, T.T @ self.load(v)) for T, v in zip(turns, t, strict=True)])
        c = np.zeros((len(t), len(s)), dtype=complex)
        for i, h in enumerate(np.diff(t)):
            e = np.exp(s * h)
            c[i + 1] = e * c[i] + (e - 1) / s * g[i] + (e - 1 - s * h) / s**2 * (g[i + 1] - g[i]) / h
        return np.array([T @ (right @ modal).real for T, modal in zip(turns, c, strict=True)])
