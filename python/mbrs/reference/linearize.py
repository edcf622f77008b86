"""M y" + (C + G) y' + (K + N) y about a state: derivatives of the forces in absolute coordinates, projected by T = B' B''.

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
from .assembly import Partition, partition, twist_map
from .kinematics import Moving, State, System, motion, moving, split, twists_of
from .linear import minimum_norm
from .so3 import Array, skew


@dataclass
class Matrices:
    """M, C = sym D, G = skew D, K = sym S, N = skew S (dof, dof); T (6 nb, dof): twists of the body origins, world axes;
    ``lam``: multipliers of all joint rows, at the accelerations that unbalanced forces cause.
    """

    M: Array
    C: Array
    G: Array
    K: Array
    N: Array
    T: Array
    lam: Array

    @property
    def D(self) -> Array:
        return self.C + self.G

    @property
    def S(self) -> Array:
        return self.K + self.N


@dataclass
class Linearization(Matrices):
    """The matrices about a state; ``residual`` (dof,) is T^T f with y" = 0: zero at an equilibrium or in a steady motion."""

    coordinates: list[str]
    residual: Array
    state: State
    partition: Partition


@dataclass
class Nominal:
    """The motion about which a system is linearised: T and its time derivatives, accelerations with y" = 0."""

    state: State
    T: Array
    dT: Array
    ddT: Array
    rates: Array
    a: Array


def nominal_motion(sys: System, state: State, part: Partition) -> Nominal:
    """Velocities of the state, projected on the joints; accelerations that follow from constant independent rates."""
    T = twist_map(sys, motion(state), part).value
    v = twists_of(state)
    if not np.any(v != 0):
        zero = np.zeros_like(T)
        return Nominal(state, T, zero, zero, np.zeros(T.shape[1], dtype=T.dtype), np.zeros(T.shape[0], dtype=T.dtype))
    rates = minimum_norm(T, v)
    state = replace(state, v=split(T @ rates)[0], w=split(T @ rates)[1])
    dT = twist_map(sys, motion(state, (state.v, state.w)), part).derivative(1)
    a = dT @ rates
    jets = twist_map(sys, motion(state, (state.v, state.w), split(a)), part)
    return Nominal(state, T, dT, jets.derivative(2), rates, a)


def spin_terms(sys: System, spin: Array, X: Array) -> Array:
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

    Cost O(nb^3). Source: docs/theory.md (5.7) to (5.10), (5.14) for ``without``, and (5.5) for a moving state.
    """
    dyn.check_effects(without)
    sys = sys.leaving_out(without)
    if np.any(twists_of(state) != 0) and any(jt.velocity_rows(link) for link in sys.joints):
        raise ModelError(
            "a model with joints that restrict velocities is linearised at rest only; give it no velocities"
        )
    part = partition(sys, state, independent)
    base = nominal_motion(sys, state, part)
    state, T = base.state, base.T
    now, n = perturbed(sys, base), T.shape[1]
    resisting, pushed = dyn.elements(sys, now, without) - dyn.loads(sys, now, without), dyn.inertia(sys, now)
    f = (resisting if "centrifugal" in without else resisting + pushed).value[0]
    (S, D, _), (Si, Di, M) = (
        np.split(T.T @ part.derivative_along(3 * n)[:, 0].T, 3, axis=1) for part in (resisting, pushed)
    )
    D = D if "gyroscopic" in without else D + Di
    S = S if "centrifugal" in without else S + Si
    G_all, _ = dyn.constraint_jacobian(sys, state)
    W = G_all[len(G_all) - sum(len(jt.velocity_rows(link)) for link in sys.joints) :] @ T
    # at the accelerations that f really causes, so that off equilibrium too the joints carry what they must
    saddle = np.block([[M, W.T], [W, np.zeros((len(W), len(W)))]])
    acceleration = minimum_norm(saddle, -np.concatenate([T.T @ f, np.zeros(len(W))]))[:n]
    lam = dyn.multipliers(sys, state, f + acceleration @ pushed.derivative_along(3 * n)[2 * n :, 0])
    if "constraint-force-stiffness" not in without:
        bent = dyn.constraint_forces(sys, moving(state, base.a, pose=T.T), lam).derivative_along(n)[:, 0]
        S = S + T.T @ bent.T + turning_of_columns(sys, state, part, T, f + G_all.T @ lam)
    names = [sys.coordinates[i] for i in part.independent]
    C, G, K, N = (0.5 * (X + s * X.T) for X in (D, S) for s in (1, -1))
    return Linearization(M, C, G, K, N, origin_map(sys, state, T), lam, names, T.T @ f, state, part)


def perturbed(sys: System, base: Nominal) -> Moving:
    """The motion with derivatives along y, y' and y"."""
    T, dT, spin, turn = base.T, base.dT, base.state.w, split(base.a)[1]
    dv = dT - spin_terms(sys, spin, T)
    da = base.ddT - spin_terms(sys, spin, dT) - spin_terms(sys, turn, T)
    zero = np.zeros_like(T)
    changes = ((T, zero, zero), (dv, T, zero), (da, dT + dv, T))
    return moving(base.state, base.a, *(np.hstack(parts).T for parts in changes))
