"""M y" + (C + G) y' + (K + N) y about a state, by congruence with T = B' B'' from the absolute tangents.

The perturbed motion is q0(t) + T(t) y(t). World components of the twist and its rate change by
dv = T y' + (T' - W T) y and da = T y" + (2 T' - W T) y' + (T" - W T' - A T) y with W = w0 x, A = alpha0 x on rotation
rows, because d(omega) = d/dt dtheta - omega0 x dtheta.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import ModelError
from . import dynamics as dyn
from . import joints as jt
from .assembly import Partition, link_rows, partition, twist_map
from .kinematics import State, System, motion
from .linear import least_squares, minimum_norm
from .so3 import Array, skew


@dataclass
class Linearization:
    """M, C = sym D, G = skew D, K = sym S, N = skew S (dof, dof); T (6 nb, dof): twists of the body origins, world
    axes.

    ``residual`` (dof,) is T^T f with y" = 0: zero at an equilibrium or in a steady motion. ``lam``: multipliers of
    all joint rows, at the accelerations that unbalanced forces cause. ``W``, ``P`` (n_v, dof): velocity constraints
    W y' + P y = 0, whose multipliers act as W^T mu beside M, D, S (see `constrained_roots`).
    """

    M: Array
    C: Array
    G: Array
    K: Array
    N: Array
    T: Array
    coordinates: list[str]
    residual: Array
    lam: Array
    state: State
    partition: Partition
    W: Array
    P: Array

    @property
    def D(self) -> Array:
        return self.C + self.G

    @property
    def S(self) -> Array:
        return self.K + self.N


@dataclass
class Nominal:
    """The motion about which a system is linearised: T and its time derivatives, accelerations with y" = 0."""

    state: State
    T: Array
    dT: Array
    ddT: Array
    rates: Array
    a: Array


def split(twists: Array) -> tuple[Array, Array]:
    """(..., 6 nb) to translations and rotations (..., nb, 3)."""
    t = twists.reshape(*twists.shape[:-1], -1, 6)
    return t[..., :3], t[..., 3:]


def nominal_motion(sys: System, state: State, part: Partition) -> Nominal:
    """Velocities of the state, projected on the joints; accelerations that follow from constant independent rates."""
    T = twist_map(sys, motion(state), part).value
    v = dyn.twists_of(state)
    moving = bool(np.any(v != 0))
    if not moving:
        zero = np.zeros_like(T)
        return Nominal(state, T, zero, zero, np.zeros(T.shape[1], dtype=T.dtype), np.zeros(T.shape[0], dtype=T.dtype))
    rates = least_squares(T, v)
    state = replace(state, v=split(T @ rates)[0], w=split(T @ rates)[1])
    dT = twist_map(sys, motion(state, (state.v, state.w)), part).derivative(1)
    a = dT @ rates
    jets = twist_map(sys, motion(state, (state.v, state.w), split(a)), part)
    return Nominal(state, T, dT, jets.derivative(2), rates, a)


def turned(sys: System, spin: Array, X: Array) -> Array:
    """spin (nb, 3) cross the rotation rows of X, zero in the translation rows."""
    out = np.zeros_like(X, dtype=np.result_type(X, spin))
    for i in range(sys.nb):
        out[6 * i + 3 : 6 * i + 6] = skew(spin[i]) @ X[6 * i + 3 : 6 * i + 6]
    return out


def turning_of_columns(sys: System, state: State, part: Partition, T: Array, r: Array) -> Array:
    """(dT_k)^T r, column k for a unit y_k: the part of T^T r's derivative that exists off equilibrium only."""
    if T.shape[1] == 0 or not np.any(r != 0):
        return np.zeros((T.shape[1], T.shape[1]))
    jets = twist_map(sys, motion(state, split(T.T)), part)
    return (np.swapaxes(jets.derivative_along(T.shape[1]), -1, -2) @ r).T


def origin_map(sys: System, state: State, T: Array) -> Array:
    """T with translations of the body origins instead of the centres of mass: v_o = v_c - w x (R com)."""
    out = T.copy()
    for i, b in enumerate(sys.bodies):
        arm = state.R[i] @ b.com
        out[6 * i : 6 * i + 3] = T[6 * i : 6 * i + 3] + skew(arm) @ T[6 * i + 3 : 6 * i + 6]
    return out


def linearize(
    sys: System, state: State, independent: Sequence[int] | None = None, without: Collection[str] = ()
) -> Linearization:
    """Linearise about a closed state (docs/tables.md; equation in the module's head).

    Parameters
    ----------
    independent
        Tree coordinates to keep, so that another program's choice can be compared; by default column-pivoted QR
        decides.
    without
        Effects to leave out: gravity, gyroscopic, centrifugal, preload-stiffness, constraint-force-stiffness, damping.

    Cost O(nb^3). Source: docs/theory.md (5.7) to (5.10), and (5.5) for a moving state.
    """
    dyn.check_effects(without)
    sys = sys.leaving_out(without)
    if np.any(dyn.twists_of(state) != 0) and any(jt.velocity_rows(link) for link in sys.joints):
        raise ModelError(
            "a model with joints that restrict velocities is linearised at rest only; give it no velocities"
        )
    part = partition(sys, state, independent)
    base = nominal_motion(sys, state, part)
    state, T = base.state, base.T
    f = dyn.applied_residual(sys, state, base.a, without)
    lam = _multipliers(sys, base, f)
    M, D, S = _congruence(sys, base, lam, without)
    G_all, _ = dyn.constraint_jacobian(sys, state)
    if (
        "constraint-force-stiffness" not in without
    ):  # without it, the congruence of the absolute tangents is all there is
        S = S + turning_of_columns(sys, state, part, T, f + G_all.T @ lam)
    W, P, _ = velocity_constraints(sys, base)
    names = [sys.coordinates[i] for i in part.independent]
    C, G, K, N = (0.5 * (X + s * X.T) for X in (D, S) for s in (1, -1))
    return Linearization(M, C, G, K, N, origin_map(sys, state, T), names, T.T @ f, lam, state, part, W, P)


def velocity_constraints(sys: System, base: Nominal) -> tuple[Array, Array, Array]:
    """W y' + P y = 0 of the velocity rows G v = 0 (n_v, dof), and the remainder of G a + G' v with y" = 0.

    W = G T; P y collects (dG) v and G (T' - W0 T) y.
    """
    state, T = base.state, base.T
    links = [link for link in sys.joints if jt.velocity_rows(link)]
    n = sum(len(jt.velocity_rows(link)) for link in links)
    G = dyn.constraint_jacobian(sys, state)[0]
    G = G[len(G) - n :]
    v = dyn.twists_of(state)
    along, rate, i = np.zeros_like(G @ T), np.zeros(n, dtype=T.dtype), 0
    for link in links:
        p = jt.pair(link, *dyn.directions(state, link))
        on = dyn.reach(link, link_rows(link, p, jt.velocity_rows(link)), p)
        for k in range(len(jt.velocity_rows(link))):
            turning = on.J.derivative_along(12)[:, :, k] @ on.take(v)  # d(G v) for the twelve directions at fixed v
            along[i] = turning[on.kept] @ T[on.columns]
            rate[i] = turning[on.kept] @ v[on.columns]
            i += 1
    return G @ T, along + G @ (base.dT - turned(sys, state.w, T)), rate + G @ base.a


def _multipliers(sys: System, base: Nominal, f: Array) -> Array:
    """lam for the accelerations that f really causes, so that off equilibrium too the joints carry what they must."""
    _, _, Mi = dyn.inertia_tangents(sys, base.state, base.a)
    T = base.T
    W, _, rate = velocity_constraints(sys, base)
    n, nv = T.shape[1], len(W)
    bordered = np.block([[T.T @ Mi @ T, W.T], [W, np.zeros((nv, nv))]])
    acceleration = minimum_norm(bordered, -np.concatenate([T.T @ f, rate]))[:n]
    return dyn.multipliers(sys, base.state, f + Mi @ T @ acceleration)


def _congruence(sys: System, base: Nominal, lam: Array, without: Collection[str]) -> tuple[Array, Array, Array]:
    state, T = base.state, base.T
    Ki, Ci, Mi = dyn.inertia_tangents(sys, state, base.a)
    Ke, Ce = dyn.element_tangents(sys, state, "damping" not in without, "preload-stiffness" not in without, without)
    static = Ke + dyn.load_forces(sys, state, "gravity" not in without)[1]
    if "constraint-force-stiffness" not in without:
        static = static + dyn.constraint_stiffness(sys, state, lam)
    spin, turn = state.w, split(base.a)[1]
    dv = base.dT - turned(sys, spin, T)
    D = Ce @ T
    S = static @ T + Ce @ dv
    if "gyroscopic" not in without:
        D = D + Ci @ T + Mi @ (base.dT + dv)
    if "centrifugal" not in without:
        S = S + Ki @ T + Ci @ dv + Mi @ (base.ddT - turned(sys, spin, base.dT) - turned(sys, turn, T))
    return T.T @ Mi @ T, T.T @ D, T.T @ S
