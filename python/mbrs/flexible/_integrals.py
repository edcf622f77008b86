"""Integrals of shapes over the mass of a beam, and what inertial loads do to its stiffness."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from ._elements import Mesh

Array = np.ndarray


def rigid_moments(grid: Mesh) -> tuple[float, float, float, Array]:
    """int rho dx, int rho x dx, int rho x^2 dx, and int rho s s^T of the sections (3, 3)."""
    mass, first, second, own = 0.0, 0.0, 0.0, np.zeros((3, 3))
    for p in grid.points:
        dm = p.weight * p.section.mass
        mass, first, second = mass + dm, first + dm * p.x, second + dm * p.x**2
        own += p.weight * p.section.mass_moments()
    return mass, first, second, own


def rigid_body(grid: Mesh) -> tuple[float, Array, Array]:
    """Mass, centre of mass and inertia about it."""
    mass, first, second, own = rigid_moments(grid)
    centre = first / mass
    own[0, 0] += second - mass * centre**2
    return mass, np.array([centre, 0.0, 0.0]), np.trace(own) * np.eye(3) - own


def shape_integrals(grid: Mesh, T: Array) -> dict[str, Array]:
    """S, P1 and P2 for the shapes T (n_dof, m); particles at r + s move by phi_t + phi_r x s."""
    m = T.shape[1]
    S, P1, P2 = np.zeros((3, m)), np.zeros((m, 3, 3)), np.zeros((m, m, 3, 3))
    for p in grid.points:
        moved = p.N @ T[p.dofs]
        t, turn = moved[:3], _skews(moved[3:])
        dm, moments = p.weight * p.section.mass, p.weight * p.section.mass_moments()
        S += dm * t
        P1[:, 0, :] += dm * p.x * t.T
        P1 += np.einsum("ab,kcb->kac", moments, turn)  # s (phi_r x s)^T
        P2 += dm * np.einsum("ak,bl->klab", t, t)
        P2 += np.einsum("kab,bc,ldc->klad", turn, moments, turn)
    return dict(S=S, P1=P1, P2=P2)


def _skews(a: Array) -> Array:
    """(3, m) to (m, 3, 3)."""
    out = np.zeros((a.shape[1], 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -a[2], a[1], -a[0]
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = a[2], -a[1], a[0]
    return out


def inertial_stiffness(grid: Mesh, T: Array, clamped: bool, whole: Mesh | None = None) -> Array:
    """KG (12, m, m): the axial force of the fields b_x = 1 (a0_x) and b_x = x (W_xx) along the beam, and sections that turn in W.

    Particles s of a section that turns by r move by r (r . s)/2 - r^2 s/2 in second order.
    Clamped: N(x) = -int_x^L rho b_x. Free: for W_xx alone, counted from the centre of mass of the ``whole``, where it balances.
    """
    KG = np.zeros((12, T.shape[1], T.shape[1]))
    x = np.array([p.x for p in grid.points])
    moments = {0: [0.0, 1.0], 3: [1.0, 0.0]} if clamped else {3: [1.0, -rigid_body(whole or grid)[1][0]]}
    for i, field in moments.items():
        outer = _outboard(grid, field)
        K = grid.tensioned(np.array([-outer(at) for at in x]))
        KG[i] = T.T @ K @ T
    for p in grid.points:
        turn: Array = (p.N @ T[p.dofs])[3:]
        section: Array = p.weight * p.section.mass_moments()
        crossed = np.einsum("rk,cl->rckl", turn, section @ turn)
        KG[3:] += (crossed - np.einsum("rc,jk,jl->rckl", section, turn, turn)).reshape(9, *KG.shape[1:])
    return 0.5 * (KG + np.swapaxes(KG, 1, 2))


def foreshortening(grid: Mesh, T: Array, clamped: bool) -> Array:
    """psi (n, 3, m, m) of the nodes of a beam: u_x = -1/2 int_0^x (v'^2 + w'^2) dx, of a free beam less its mean over the mass.

    The mean is that of `inertial_stiffness`, in which the centre of mass of a free beam stays where it is.
    """
    m = T.shape[1]
    # of each quadrature point, in the order of x
    squares = np.array([p.weight * (p.slope @ T[p.dofs]).T @ (p.slope @ T[p.dofs]) for p in grid.points])
    n = len(grid.x) - 1
    along = np.zeros((n + 1, m, m))
    along[1:] = -np.cumsum(squares.reshape(n, -1, m, m).sum(axis=1), axis=0)
    if not clamped:
        beyond = _outboard(grid, [0.0, 1.0])
        share = np.array([beyond(p.x) for p in grid.points]) / rigid_body(grid)[0]
        along += np.einsum("p,pkl->kl", share, squares)
    out = np.zeros((n + 1, 3, m, m))
    out[:, 0] = 0.5 * (along + np.swapaxes(along, 1, 2))
    return out


def _outboard(grid: Mesh, field: list[float]) -> Any:
    """int_x^L rho b dx' for a linear b; exact, since rho is linear in every element."""
    ends = grid.x
    linear = []
    for a, b in itertools.pairwise(ends):
        inside = [p for p in grid.points if a < p.x < b]
        slope = (inside[-1].section.mass - inside[0].section.mass) / (inside[-1].x - inside[0].x)
        rho = np.poly1d([slope, inside[0].section.mass - slope * inside[0].x])
        linear.append((rho * np.poly1d(field)).integ())
    beyond = np.concatenate(
        [np.cumsum([f(b) - f(a) for f, a, b in zip(linear, ends[:-1], ends[1:], strict=True)][::-1])[::-1], [0.0]]
    )

    def outer(x: float) -> float:
        e = min(int(np.searchsorted(ends, x, side="right")) - 1, len(linear) - 1)
        return float(linear[e](ends[e + 1]) - linear[e](x) + beyond[e + 1])

    return outer
