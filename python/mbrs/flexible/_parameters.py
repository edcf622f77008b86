"""Beams whose properties are expressions of parameters: every number of the body as an expression.

The shapes are those at the present values. The integrals over fixed shapes are linear in what multiplies them under the integral,
so that

    number(p) = number(p_0) + sum_c coefficient_c (e_c(p) - e_c(p_0)),

e_c the expressions among the properties. The reduced matrices are then those of Rayleigh and Ritz with kept shapes; derivatives of
frequencies by p are those of the whole beam as far as the shapes hold its motion (the quotient is stationary in them).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import ModelError
from ._elements import Mesh, Section
from ._integrals import inertial_stiffness, rigid_moments, shape_integrals

Array = np.ndarray
_INERTIA = ("mass", "inertia_flap", "inertia_edge")
# an expression of a parameter, and its weights at the stations
Channel = tuple[Any, Array]


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
    grid: Mesh, T: Array, base: dict[str, Array], found: dict[str, list[Channel]], x: Array, clamped: bool, damping: Any
) -> dict[str, Array]:
    """Arrays of numbers and expressions in place of those of ``base`` (mass, com, inertia, S, P1, P2, K, C, KG)."""
    out = {name: base[name].astype(object) for name in ("S", "P1", "P2", "K", "KG")}
    mass, first, second, own = (np.asarray(a).astype(object) for a in rigid_moments(grid))
    for name, several in found.items():
        for e, weights in several:
            part = _part(grid, name, weights, x)
            if not clamped and name == "mass" and np.any(base["KG"]) and not _in_place(part, grid):
                raise ModelError(
                    "beam: a mass that shifts along a free beam as parameters change moves the centre about which it is stiffened; "
                    "leave out one of both: stiffening=False"
                )
            change = e - e.value
            if name not in _INERTIA:
                _add(out["K"], _strained(part, T), change)
                continue
            for key, coefficients in shape_integrals(part, T).items():
                _add(out[key], coefficients, change)
            if np.any(base["KG"]):
                _add(out["KG"], inertial_stiffness(part, T, clamped, grid), change)
            moments = rigid_moments(part)
            for total, coefficient in zip((mass, first, second, own), moments, strict=True):
                _add(total, np.asarray(coefficient), change)
    out |= _rigid(mass[()], first[()], second[()], own)
    out["C"] = _damping(damping, out["K"], out["P2"], np.sqrt(np.diag(base["K"])))
    return out


def _part(grid: Mesh, name: str, weights: Array, x: Array) -> Mesh:
    """The same mesh with one property alone."""
    none = {f.name: 0.0 for f in dataclasses.fields(Section)}

    def only(point: Any) -> Any:
        values = {**none, "twist": point.section.twist, name: float(np.interp(point.x, x, weights))}
        return dataclasses.replace(point, section=Section(**values))

    return dataclasses.replace(grid, points=tuple(only(p) for p in grid.points))


def _strained(part: Mesh, T: Array) -> Array:
    """T^T K T."""
    out = np.zeros((T.shape[1], T.shape[1]))
    for p in part.points:
        strains = p.B @ T[p.dofs]
        out += p.weight * strains.T @ p.section.stiffness(part.shear) @ strains
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
