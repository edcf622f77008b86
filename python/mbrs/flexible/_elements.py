"""Finite elements of a straight, twisted beam along x: shape functions, matrices, and the mass as points with shapes.

Degrees of freedom per node: u v w rx ry rz (displacements along and rotations about x y z), then those inside the elements.
Euler-Bernoulli: cubic v and w, rz = v', ry = -w'. Timoshenko: cubic v and w, quadratic ry and rz of their own, so that
v' - rz can vanish exactly and nothing locks. u and rx are quadratic.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

Array = np.ndarray
# Products of cubic shapes, linear properties: degree 7; more for the sines of a twist that varies.
_POINTS = 6
_ENDS, _MIDDLE, _THIRDS = (0.0, 1.0), (0.0, 1.0, 0.5), (0.0, 1.0, 1 / 3, 2 / 3)
_TRANSLATIONS, _ROTATIONS = slice(0, 3), slice(3, 6)


@dataclass(frozen=True)
class Section:
    """Properties at one place, principal axes turned by ``twist`` about x: stiffnesses (0 where a deformation is left
    out), mass and rotary inertia per length.
    """

    mass: float
    EI_flap: float
    EI_edge: float
    GJ: float
    EA: float
    GA_flap: float
    GA_edge: float
    inertia_flap: float
    inertia_edge: float
    twist: float

    def across(self, edge: float, flap: float) -> Array:
        """A tensor with these principal values in (y, z)."""
        c, s = np.cos(self.twist), np.sin(self.twist)
        R = np.array([[c, -s], [s, c]])  # columns: the edge and the flap axis
        return R @ np.diag([edge, flap]) @ R.T

    def mass_moments(self) -> Array:
        """int rho s s^T over the section, (3, 3)."""
        out = np.zeros((3, 3))
        out[1:, 1:] = self.across(self.inertia_edge, self.inertia_flap)
        return out

    def stiffness(self, shear: bool) -> Array:
        """D (6, 6) for the strains (u', v' - rz, w' + ry, rx', ry', rz')."""
        D = np.zeros((6, 6))
        D[0, 0], D[3, 3] = self.EA, self.GJ
        bending = self.across(self.EI_edge, self.EI_flap)  # of the curvatures (rz', -ry')
        turned = np.array([[0.0, -1.0], [1.0, 0.0]])  # (ry', rz') to (rz', -ry'), transposed
        D[4:, 4:] = turned @ bending @ turned.T
        if shear:
            D[1:3, 1:3] = self.across(self.GA_edge, self.GA_flap)
        return D


@dataclass(frozen=True)
class Point:
    """A quadrature point: place along x, weight in m, properties, degrees of freedom ``dofs`` and their shapes.

    ``N`` (6, d): displacement and rotation of the section; ``B`` (6, d): its strains; ``slope`` (2, d): v' and w'.
    """

    x: float
    weight: float
    section: Section
    dofs: Array
    N: Array
    B: Array
    slope: Array


@dataclass(frozen=True)
class Mesh:
    """Nodes at ``x`` (n,), n_dof degrees of freedom of which 6 n lie at the nodes, and the quadrature points of all elements."""

    x: Array
    n_dof: int
    points: tuple[Point, ...]
    shear: bool

    def assembled(self) -> tuple[Array, Array]:
        """M and K (n_dof, n_dof), dense."""
        M, K = np.zeros((self.n_dof, self.n_dof)), np.zeros((self.n_dof, self.n_dof))
        for p in self.points:
            place = np.ix_(p.dofs, p.dofs)
            K[place] += p.weight * p.B.T @ p.section.stiffness(self.shear) @ p.B
            moments = p.section.mass_moments()
            rotary = np.trace(moments) * np.eye(3) - moments
            t, r = p.N[_TRANSLATIONS], p.N[_ROTATIONS]
            M[place] += p.weight * (p.section.mass * t.T @ t + r.T @ rotary @ r)
        return M, K

    def stiffness_of(self, T: Array) -> Array:
        """T^T K T (m, m) by the strains of the shapes T (n_dof, m): in K itself they cancel, the more the finer the mesh, by its number
        of elements to the fourth power.
        """
        out = np.zeros((T.shape[1], T.shape[1]))
        for p in self.points:
            strain = p.B @ T[p.dofs]
            out += p.weight * strain.T @ p.section.stiffness(self.shear) @ strain
        return out

    def tensioned(self, tension: Array) -> Array:
        """int N (v'^2 + w'^2) dx for the axial force N at the quadrature points, (n_dof, n_dof)."""
        out = np.zeros((self.n_dof, self.n_dof))
        for p, force in zip(self.points, tension, strict=True):
            out[np.ix_(p.dofs, p.dofs)] += p.weight * force * p.slope.T @ p.slope
        return out


def mesh(x: Array, section: Callable[[float], Section], shear: bool, straight: bool = False) -> Mesh:
    """Elements between neighbouring nodes ``x``; ``straight``: linear u and rx, so that all degrees of freedom lie at nodes."""
    spots, weights = np.polynomial.legendre.leggauss(_POINTS)
    inner = (0 if straight else 2) + (6 if shear else 0)
    n = len(x)
    points = []
    for e in range(n - 1):
        h = x[e + 1] - x[e]
        dofs = np.concatenate([6 * e + np.arange(12), 6 * n + inner * e + np.arange(inner)])
        for spot, weight in zip(0.5 * (spots + 1), 0.5 * weights, strict=True):
            at = x[e] + spot * h
            N, B, slope = _shapes(spot, h, shear, straight)
            points.append(Point(at, weight * h, section(at), dofs, N, B, slope))
    return Mesh(np.asarray(x, dtype=float), 6 * n + inner * (n - 1), tuple(points), shear)


def _shapes(s: float, h: float, shear: bool, straight: bool) -> tuple[Array, Array, Array]:
    """N, B and slope of one element at x = s h."""
    inner = (0 if straight else 2) + (6 if shear else 0)
    N, dN = np.zeros((6, 12 + inner)), np.zeros((6, 12 + inner))
    along = _ENDS if straight else _MIDDLE
    for field, extra in ((0, 12), (3, 13)):
        _lagrange(N, dN, field, [field, 6 + field, extra][: len(along)], along, s, h)
    if shear:
        first = 12 + inner - 6
        for field, extra in ((1, first), (2, first + 2)):
            _lagrange(N, dN, field, [field, 6 + field, extra, extra + 1], _THIRDS, s, h)
        for field, extra in ((4, first + 4), (5, first + 5)):
            _lagrange(N, dN, field, [field, 6 + field, extra], _MIDDLE, s, h)
    else:
        ends = [1 - 3 * s**2 + 2 * s**3, h * (s - 2 * s**2 + s**3), 3 * s**2 - 2 * s**3, h * (s**3 - s**2)]
        slopes = [(6 * s**2 - 6 * s) / h, 1 - 4 * s + 3 * s**2, (6 * s - 6 * s**2) / h, 3 * s**2 - 2 * s]
        curves = [(12 * s - 6) / h**2, (6 * s - 4) / h, (6 - 12 * s) / h**2, (6 * s - 2) / h]
        for value, turn, sign in ((1, 5, 1.0), (2, 4, -1.0)):  # rz = v', ry = -w'
            places, signs = [value, turn, 6 + value, 6 + turn], [1.0, sign, 1.0, sign]
            for place, own, a, b, c in zip(places, signs, ends, slopes, curves, strict=True):
                N[value, place], dN[value, place] = own * a, own * b
                N[turn, place], dN[turn, place] = sign * own * b, sign * own * c
    B = dN.copy()
    B[1] -= N[5]
    B[2] += N[4]
    return N, B, dN[1:3]


def _lagrange(N: Array, dN: Array, field: int, places: list[int], nodes: tuple[float, ...], s: float, h: float) -> None:
    values, slopes = _polynomials(nodes, s)
    for place, value, slope in zip(places, values, slopes, strict=True):
        N[field, place], dN[field, place] = value, slope / h


@lru_cache(maxsize=256)
def _polynomials(nodes: tuple[float, ...], s: float) -> tuple[list[float], list[float]]:
    """Polynomials that are one at a node and zero at the others, at s, and their slopes."""
    values, slopes = [], []
    for i, own in enumerate(nodes):
        others = [o for j, o in enumerate(nodes) if j != i]
        bottom = math.prod(own - o for o in others)
        values.append(math.prod(s - o for o in others) / bottom)
        slopes.append(sum(math.prod(s - o for o in others if o != left) for left in others) / bottom)
    return values, slopes
