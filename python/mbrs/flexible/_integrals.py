"""Integrals of shapes over the mass of a beam, and what inertial loads do to its stiffness."""

from __future__ import annotations

from collections.abc import Callable

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
        K = grid.tensioned(-outer(x))
        KG[i] = T.T @ K @ T
    for p in grid.points:
        turn: Array = (p.N @ T[p.dofs])[3:]
        section: Array = p.weight * p.section.mass_moments()
        crossed = np.einsum("rk,cl->rckl", turn, section @ turn)
        KG[3:] += (crossed - np.einsum("rc,jk,jl->rckl", section, turn, turn)).reshape(9, *KG.shape[1:])
    return 0.5 * (KG + np.swapaxes(KG, 1, 2))


def second_order(grid: Mesh, T: Array, clamped: bool) -> Array:
    """psi (n, 3, m, m) of the nodes of a beam: foreshortening, and bending that torsion turns to the side.

        u = -1/2 int_0^x (v'^2 + w'^2) ds,   v = -int_0^x (x - s) rx w" ds,   w = int_0^x (x - s) rx v" ds

    Of a free beam less the rigid motion that would move its mass on the whole, as in `inertial_stiffness` and `turned_stiffness`.
    """
    squares = np.array([p.weight * (p.slope @ T[p.dofs]).T @ (p.slope @ T[p.dofs]) for p in grid.points])
    bent = _turned_curvatures(grid, T)
    arm = np.array([p.x for p in grid.points])
    at = grid.x[:, None, None]
    out = np.zeros((len(grid.x), 3, *bent.shape[2:]))
    out[:, 0] = -_up_to(grid, squares)
    for i, c in enumerate(bent, start=1):
        out[:, i] = at * _up_to(grid, c) - _up_to(grid, arm[:, None, None] * c)
    if not clamped:
        mass, centre = rigid_body(grid)[0], rigid_body(grid)[1][0]
        beyond = _outboard(grid, [0.0, 1.0])
        out[:, 0] += np.einsum("p,pkl->kl", beyond(arm) / mass, squares)
        spread = rigid_moments(grid)[2] - mass * centre**2
        pulled, tipped = (_moments(grid, field) for field in ([0.0, 1.0], [1.0, -centre]))
        for i, c in enumerate(bent, start=1):
            mean, turn = np.einsum("p,pkl->kl", pulled / mass, c), np.einsum("p,pkl->kl", tipped / spread, c)
            out[:, i] -= mean + (at - centre) * turn
    return 0.5 * (out + np.swapaxes(out, 2, 3))


def turned_stiffness(grid: Mesh, T: Array, clamped: bool) -> Array:
    """KG (12, m, m) of fields across a clamped beam, whose bending moments torsion turns to the side (`second_order`).

    They are int rho psi dx and int rho x psi dx; those of a free beam vanish.
    """
    m = T.shape[1]
    KG = np.zeros((12, m, m))
    if clamped:
        for i, c in enumerate(_turned_curvatures(grid, T), start=1):
            KG[i] = np.einsum("p,pkl->kl", _moments(grid, [0.0, 1.0]), c)
            KG[3 + 3 * i] = np.einsum("p,pkl->kl", _moments(grid, [1.0, 0.0]), c)
    return KG


def _turned_curvatures(grid: Mesh, T: Array) -> Array:
    """psi of the curvatures -rx w" and rx v" at the quadrature points, times their weights, (2, p, m, m)."""
    out = []
    for p in grid.points:
        turn, (about_y, about_z) = p.N[3] @ T[p.dofs], p.B[4:] @ T[p.dofs]
        both = np.stack([np.outer(turn, about_y), np.outer(turn, about_z)])  # ry' = -w", rz' = v"
        out.append(p.weight * (both + np.swapaxes(both, 1, 2)))
    return np.swapaxes(np.array(out), 0, 1)


def _up_to(grid: Mesh, parts: Array) -> Array:
    """Sums over the quadrature points (p, ...) between the root and each node, (n, ...)."""
    n = len(grid.x) - 1
    of_elements = parts.reshape(n, -1, *parts.shape[1:]).sum(axis=1)
    return np.concatenate([np.zeros((1, *parts.shape[1:])), np.cumsum(of_elements, axis=0)])


def _moments(grid: Mesh, field: list[float]) -> Array:
    """int_s^L rho b (x - s) dx of a linear b at the quadrature points s."""
    pulled = _outboard(grid, field)
    tipped = _outboard(grid, [*field, 0.0])
    x = np.array([p.x for p in grid.points])
    return tipped(x) - x * pulled(x)


def _outboard(grid: Mesh, field: list[float]) -> Callable[[Array], Array]:
    """int_x^L rho b dx' for a polynomial b; exact, since rho is linear in every element."""
    ends = grid.x
    n = len(ends) - 1
    x = np.array([p.x for p in grid.points]).reshape(n, -1)
    mass = np.array([p.section.mass for p in grid.points]).reshape(n, -1)
    slope = (mass[:, -1] - mass[:, 0]) / (x[:, -1] - x[:, 0])
    rho = np.stack([slope, mass[:, 0] - slope * x[:, 0]])
    product = np.zeros((len(field) + 1, n))  # highest powers first, a column for each element
    for i, factor in enumerate(field):
        product[i : i + 2] += factor * rho
    integral = np.concatenate([product / np.arange(len(product), 0, -1)[:, None], np.zeros((1, n))])
    of_elements = np.polyval(integral, ends[1:]) - np.polyval(integral, ends[:-1])
    beyond = np.append(np.cumsum(of_elements[::-1])[::-1], 0.0)

    def outer(x: Array) -> Array:
        e = np.minimum(np.searchsorted(ends, x, side="right") - 1, n - 1)
        return np.polyval(integral[:, e], ends[e + 1]) - np.polyval(integral[:, e], x) + beyond[e + 1]

    return outer
