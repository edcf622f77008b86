"""Derivatives along a direction in x: real quantities by a complex step, eigenpairs by
docs/theory.md (9.5) to (9.7).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ..errors import NotDifferentiableError
from . import so3
from .assembly import drawn_and_assembled
from .kinematics import State, System
from .linearize import Linearization, Matrices, linearize
from .modal import Modes, _largest
from .so3 import STEP, Array


@dataclass
class Derivative(Matrices):
    """d/dp of everything real at the linearisation state: matrices, centres of mass, rotations (world vectors)."""

    position: Array
    rotation: Array


def derivative(
    tables: Mapping[str, Any],
    direction: Array,
    state_of: Callable[[System], State] = drawn_and_assembled,
    independent: Sequence[int] | None = None,
    without: Collection[str] = (),
) -> tuple[Linearization, Derivative]:
    """The linearisation and its derivative along ``direction`` (n_x,) in x.

    ``state_of`` finds the state of a system with complex x: `drawn_and_assembled`, or
    ``lambda s: equilibrium(s)[0]`` to follow the equilibrium. The independent coordinates are those of the real system.
    """
    direction = np.asarray(direction, dtype=float)
    if independent is None:
        real = System(tables)
        independent = linearize(real, state_of(real), without=without).partition.independent.tolist()
    sys = System(tables, np.asarray(tables["x"]) + 1j * STEP * direction)
    lin = linearize(sys, state_of(sys), independent, without)

    def rate(a: Array) -> Array:
        return np.asarray(a).imag / STEP

    s = lin.state
    turn = so3.vee(rate(s.R) @ np.swapaxes(s.R.real, -1, -2))
    matrices = {f.name: rate(getattr(lin, f.name)) for f in fields(Matrices)}
    return lin, Derivative(**matrices, position=rate(s.r), rotation=turn)


def real_part(lin: Linearization) -> Linearization:
    """The linearisation without the imaginary parts of a complex step."""
    real = {f.name: getattr(lin, f.name).real for f in fields(Matrices)}
    s = lin.state
    return replace(lin, **real, residual=lin.residual.real, state=State(s.r.real, s.R.real, s.v.real, s.w.real))


def _slopes(lin: Linearization, d: Derivative, s: complex) -> tuple[Array, Array, Array]:
    """P(s), P'(s) and dP at fixed s."""
    return s * s * lin.M + s * lin.D + lin.S, 2 * s * lin.M + lin.D, s * s * d.M + s * d.D + d.S


def eigenvalue_derivative(lin: Linearization, m: Modes, d: Derivative) -> Array:
    """ds = -psi^T dP phi / (psi^T P' phi), (n,); in a repeated group the split along this one direction, in ascending
    order.

    nan where the pair is near-defective or a rigid mode.
    """
    out = np.full(len(m.eigenvalue), np.nan + 0j)
    for i, s in enumerate(m.eigenvalue):
        _, slope, dP = _slopes(lin, d, s)
        denominator = m.left[:, i] @ slope @ m.shape[:, i]
        if s != 0 and not m.defective[i] and denominator != 0:
            out[i] = -(m.left[:, i] @ dP @ m.shape[:, i]) / denominator
    for g in m.groups:
        if m.eigenvalue[g[0]] != 0:
            split = np.linalg.eigvals(group_matrix(lin, m, d, g))
            out[g] = split[np.lexsort((split.real, split.imag))]
    return out


def group_matrix(lin: Linearization, m: Modes, d: Derivative, group: Sequence[int]) -> Array:
    """(g, g): its eigenvalues are the derivatives of a repeated eigenvalue; linear in the direction of the
    parameters.
    """
    F, W, s = m.shape[:, group], m.left[:, group], complex(np.mean(m.eigenvalue[list(group)]))
    _, slope, dP = _slopes(lin, d, s)
    return -np.linalg.solve(W.T @ slope @ F, W.T @ dP @ F)


def frequency_derivative(s: Array, ds: Array) -> tuple[Array, Array]:
    """d|s|/2pi and d(-Re s/|s|) from ds."""
    with np.errstate(divide="ignore", invalid="ignore"):
        omega = np.abs(s)
        domega = (s.conj() * ds).real / omega
        return domega / (2 * np.pi), -ds.real / omega + s.real * domega / omega**2


def shape_derivative(lin: Linearization, m: Modes, d: Derivative, i: int) -> Array:
    """d phi_i under the normalisation of `Modes`, from the bordered system [[P, P' phi], [row, 0]]."""
    s, phi = m.eigenvalue[i], m.shape[:, i]
    if m.defective[i] or s == 0 or any(i in g for g in m.groups):
        raise NotDifferentiableError(
            f"mode {i} is repeated, rigid or near-defective; its shape alone has no derivative"
        )
    P, slope, dP = _slopes(lin, d, s)
    ds = eigenvalue_derivative(lin, m, d)[i]
    bilinear = m.symmetric and s.imag != 0
    row = phi @ slope if bilinear else phi.conj() @ lin.M
    amount = 0j
    if bilinear:
        amount = 0.5 * (2j * ds.imag - phi @ (2 * ds * lin.M + 2 * s * d.M + d.D) @ phi)
    border = np.block([[P, (slope @ phi)[:, None]], [row[None, :], np.zeros((1, 1))]])
    dphi = np.linalg.solve(border, np.append(-(dP + ds * slope) @ phi, amount))[:-1]
    if bilinear:
        return dphi
    j = _largest(phi)
    shift = -0.5 * (phi.conj() @ d.M @ phi).real - 1j * (dphi[j] / phi[j]).imag
    return dphi + shift * phi
