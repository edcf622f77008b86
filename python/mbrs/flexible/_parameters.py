"""Beams whose properties are expressions of parameters: every number of the body as an expression.

The shapes are those at the present values. The integrals over fixed shapes are linear in what multiplies them under the integral,
so that

    number(p) = number(p_0) + sum_c coefficient_c (e_c(p) - e_c(p_0)),

e_c the expressions among the properties. The reduced matrices are then those of Rayleigh and Ritz with kept shapes; derivatives of
frequencies by p are those of the whole beam as far as the shapes hold its motion (the quotient is stationary in them).

A length L stretches the mesh by r = L/L_0: displacements keep their values at the same share of the length, so that slopes and
rotations across the beam get 1/r, and every integral is a sum of powers of r.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import ModelError
from ._elements import Mesh, Section
from ._integrals import inertial_stiffness, rigid_moments, shape_integrals, turned_stiffness

Array = np.ndarray
_INERTIA = ("mass", "inertia_flap", "inertia_edge")
# an expression of a parameter, and its weights at the stations
Channel = tuple[Any, Array]
# parts of an array by their powers of the stretch
Parts = dict[int, Array]


def is_expression(value: Any) -> bool:
    """True of an expression of parameters, which knows its number now."""
    return hasattr(value, "space") and hasattr(value, "value")


def plain(value: Any) -> Any:
    """The numbers now of a property, of which any may be an expression."""
    if value is None or isinstance(value, float | int | str):
        return value
    if is_expression(value):
        return value.value
    entries = np.asarray(value, dtype=object)
    if not any(is_expression(v) for v in entries.flat):
        return value
    return np.reshape([plain(v) for v in entries.flat], entries.shape)


def channels(parts: Sequence[Any], n: int) -> list[Channel]:
    """The expressions in a product of parts, each a number or n of them."""
    scalars = [p for p in parts if is_expression(p)]
    others = [np.broadcast_to(np.asarray(p, dtype=object), (n,)) for p in parts if not is_expression(p)]
    product = [math.prod(o[i] for o in others) for i in range(n)]
    if not any(is_expression(v) for v in product):
        return [(math.prod(scalars), np.array(product, dtype=float))] if scalars else []
    unit = np.eye(n)
    entries = [math.prod([*scalars, v]) for v in product]
    return [(e, unit[i]) for i, e in enumerate(entries) if is_expression(e)]


def driven(
    grid: Mesh,
    T: Array,
    base: dict[str, Array],
    found: dict[str, list[Channel]],
    x: Array,
    clamped: bool,
    damping: Any,
    stretch: Any = None,
) -> dict[str, Array]:
    """Arrays of numbers and expressions in place of those of ``base`` (mass, com, inertia, S, P1, P2, K, C, KG)."""
    stiffened = bool(np.any(base["KG"]))
    powers = _powers(stretch)
    out = {name: base[name].astype(object) for name in ("S", "P1", "P2", "K", "KG")}
    totals = [np.asarray(a).astype(object) for a in rigid_moments(grid)]
    if stretch is not None:
        own = _inertia_parts(grid, T, clamped, grid if stiffened else None) | {"K": _stiffness_parts(grid, T)}
        for key, parts in own.items():
            for power, coefficients in parts.items():
                _add(out[key], coefficients, powers[power] - 1.0)
        _add_rigid(totals, grid, [powers[power] - 1.0 for power in _RIGID_POWERS])
    for name, several in found.items():
        for e, weights in several:
            part = _part(grid, name, weights, x)
            if not clamped and name == "mass" and stiffened and not _in_place(part, grid):
                raise ModelError(
                    "beam: a mass that shifts along a free beam as parameters change moves the centre about which it is stiffened; "
                    "leave out one of both: stiffening=False"
                )
            change = e - e.value
            if name not in _INERTIA:
                _add_parts(out["K"], _stiffness_parts(part, T), change, powers)
                continue
            for key, parts in _inertia_parts(part, T, clamped, grid if stiffened else None).items():
                _add_parts(out[key], parts, change, powers)
            _add_rigid(totals, part, [powers[power] * change for power in _RIGID_POWERS])
    mass, first, second, section = totals
    out |= _rigid(mass[()], first[()], second[()], section)
    out["C"] = _damping(damping, out["K"], out["P2"], np.sqrt(np.diag(base["K"])))
    return out


# Powers of the stretch: mass, int rho x, int rho x^2, int rho s s^T.
_RIGID_POWERS = (1, 2, 3, 1)
# Rows of a section's motion: translations, rotation about the beam, rotations across it, which get 1/r.
_MOVED, _ABOUT, _ACROSS = (0, 1, 2), (3,), (4, 5)
# Rows of its strains: u', shear and twist, and curvatures.
_SLOPES, _CURVATURES = slice(0, 4), slice(4, 6)


def _powers(stretch: Any) -> dict[int, Any]:
    """The powers of the stretch that integrals have."""
    if stretch is None:
        return dict.fromkeys(range(-3, 4), 1.0)
    inverse, square = 1.0 / stretch, stretch * stretch
    return {-3: inverse * inverse * inverse, -1: inverse, 0: 1.0, 1: stretch, 2: square, 3: square * stretch}


def stretched_nodes(at: Array, shape: Array, quadratic: Array, stretch: Any) -> dict[str, Array]:
    """Places (n, 3), shapes (n, 6, m) and second-order displacements (n, 3, m, m) of nodes of a beam that is stretched."""
    place, bent = at.astype(object), shape.astype(object)
    _add(place, at, stretch - 1.0)
    across = np.zeros_like(shape)
    across[:, _ACROSS] = shape[:, _ACROSS]
    _add(bent, across, 1.0 / stretch - 1.0)
    # int v'^2 dx, with slopes over the length; int int rx v" dx dx does not change
    second, shortened = quadratic.astype(object), np.zeros_like(quadratic)
    shortened[:, 0] = quadratic[:, 0]
    _add(second, shortened, 1.0 / stretch - 1.0)
    return {"node_position": place, "node_shape": bent, "node_quadratic": second}


def _stiffness_parts(part: Mesh, T: Array) -> Parts:
    """T^T K T by powers: strains are slopes, or curvatures of displacements, over the length."""
    return {-1: _strained(part, T, _SLOPES), -3: _strained(part, T, _CURVATURES)}


def _inertia_parts(part: Mesh, T: Array, clamped: bool, whole: Mesh | None) -> dict[str, Parts]:
    """S, P1, P2 and, about the centre of a whole, KG by powers."""
    kinds = {
        kind: _only(part, rows) for kind, rows in (("t", _MOVED), ("a", _ABOUT), ("x", _ACROSS), ("ax", (3, 4, 5)))
    }
    of = {kind: shape_integrals(mesh, T) for kind, mesh in kinds.items()}
    out: dict[str, Parts] = {
        "S": {1: of["t"]["S"]},
        "P1": {2: of["t"]["P1"], 1: of["a"]["P1"], 0: of["x"]["P1"]},
        "P2": _squares({kind: found["P2"] for kind, found in of.items()}),
    }
    out["P2"][1] = out["P2"][1] + of["t"]["P2"]
    if whole is not None:
        KG = {kind: inertial_stiffness(mesh, T, clamped, whole) for kind, mesh in kinds.items()}
        # the axial force of an even field grows with r, that of a linear one with r^2; both act on squares of slopes
        even, linear = KG["t"].copy(), KG["t"].copy()
        even[3:], linear[:3] = 0.0, 0.0
        squares = _squares({kind: found - KG["t"] for kind, found in KG.items()})
        turned = turned_stiffness(part, T, clamped)
        across, tipped = turned.copy(), turned.copy()
        across[3:], tipped[:3] = 0.0, 0.0
        out["KG"] = squares | {0: squares[0] + even, 1: squares[1] + linear + across, 2: tipped}
    return out


def _squares(of: dict[str, Array]) -> Parts:
    """A square of rotations by powers: those about the beam, mixed ones, those across."""
    return {1: of["a"], 0: of["ax"] - of["a"] - of["x"], -1: of["x"]}


def _only(part: Mesh, rows: tuple[int, ...]) -> Mesh:
    """The same mesh with some rows of the motion of its sections alone."""
    keep = np.zeros((6, 1))
    keep[list(rows)] = 1.0
    return dataclasses.replace(part, points=tuple(dataclasses.replace(p, N=keep * p.N) for p in part.points))


def _add_parts(total: Array, parts: Parts, change: Any, powers: dict[int, Any]) -> None:
    for power, coefficients in parts.items():
        _add(total, coefficients, powers[power] * change)


def _add_rigid(totals: list[Array], part: Mesh, changes: list[Any]) -> None:
    for total, coefficient, change in zip(totals, rigid_moments(part), changes, strict=True):
        _add(total, np.asarray(coefficient), change)


def _part(grid: Mesh, name: str, weights: Array, x: Array) -> Mesh:
    """The same mesh with one property alone."""
    none = {f.name: 0.0 for f in dataclasses.fields(Section)}

    def only(point: Any) -> Any:
        values = {**none, "twist": point.section.twist, name: float(np.interp(point.x, x, weights))}
        return dataclasses.replace(point, section=Section(**values))

    return dataclasses.replace(grid, points=tuple(only(p) for p in grid.points))


def _strained(part: Mesh, T: Array, rows: slice) -> Array:
    """T^T K T of some of the strains."""
    out = np.zeros((T.shape[1], T.shape[1]))
    for p in part.points:
        strains = (p.B @ T[p.dofs])[rows]
        out += p.weight * strains.T @ p.section.stiffness(part.shear)[rows, rows] @ strains
    symmetric: Array = 0.5 * (out + out.T)
    return symmetric


def _in_place(part: Mesh, grid: Mesh) -> bool:
    """Does the part leave the centre of mass where it is, to rounding?"""
    (m, first, _, _), (mass, moment, _, _) = rigid_moments(part), rigid_moments(grid)
    return bool(abs(first * mass - moment * m) <= len(grid.points) * np.finfo(float).eps * abs(moment * m))


def _add(total: Array, coefficients: Array, change: Any) -> None:
    for place, coefficient in np.ndenumerate(coefficients):
        if coefficient != 0.0:
            total[place] = total[place] + float(coefficient) * change


def _rigid(mass: Any, first: Any, second: Any, own: Array) -> dict[str, Any]:
    centre = first / mass
    own[0, 0] = own[0, 0] + second - mass * centre * centre
    trace = own[0, 0] + own[1, 1] + own[2, 2]
    return {"mass": mass, "com": np.array([centre, 0.0, 0.0], dtype=object), "inertia": trace * np.eye(3) - own}


def _damping(ratio: Any, K: Array, P2: Array, omega: Array) -> Array:
    """C = 2 zeta M sqrt(M^-1 K), which the modes of the body damp equally: exact on the diagonal, beside it to first order in the
    entries of K and M, 2 zeta (K_ij + w_i w_j M_ij)/(w_i + w_j).
    """
    m = len(K)
    out = np.zeros((m, m)).astype(object)
    if ratio is None:
        return out
    if np.ndim(np.asarray(ratio, dtype=object)):
        raise ModelError("beam: damping= of a beam with parameters is one ratio for all modes, or a parameter")
    M = P2[:, :, 0, 0] + P2[:, :, 1, 1] + P2[:, :, 2, 2]
    for i in range(m):
        out[i, i] = 2.0 * ratio * np.sqrt(K[i, i] * M[i, i])
        for j in range(i):
            if is_expression(K[i, j]) or is_expression(M[i, j]):
                both = K[i, j] + float(omega[i] * omega[j]) * M[i, j]
                out[i, j] = out[j, i] = (2.0 / float(omega[i] + omega[j])) * ratio * both
    return out
