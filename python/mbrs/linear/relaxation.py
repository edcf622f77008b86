"""Laws whose states relax (`mb.Maxwell`) in linear analyses: springs in series with dashpots along directions.

Beside the slope at rest, which K holds, such a law answers small motions y by the force W diag(k s / (s + rate)) W^T y. With the
extension p' = u - z of each spring as one more rate this is a second-order system with a regular mass matrix,

    [M 0; 0 k] [y"; p"] + [D  W k; -k W^T  k rate] [y'; p'] + [S 0; 0 0] [y; p] = [f; 0],

in which p itself acts on nothing: one root zero for each spring, which belongs to no motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import _core
from .._lib.rotations import twist_at
from ..model.schema import LAW_OF_CODE
from ..model.tables import tables


@dataclass(frozen=True)
class LawPlace:
    """A law at a state: its place in the Tables, its direction (dof,), displacement and rate, and the object it is on."""

    index: int
    code: int
    numbers: np.ndarray
    direction: np.ndarray
    u: float
    v: float
    name: str


@dataclass(frozen=True, eq=False)
class Relaxation:
    """Directions (dof, m), stiffnesses and rates (m,) of springs with dashpots, and the objects they are on."""

    W: np.ndarray
    k: np.ndarray
    rate: np.ndarray
    names: tuple[str, ...]

    def stiffness(self, omega: np.ndarray) -> np.ndarray:
        """(m, n_omega) complex stiffnesses k i omega / (i omega + rate)."""
        s = 1j * np.asarray(omega)[None, :]
        return np.asarray(self.k[:, None] * s / (s + self.rate[:, None]))

    def extended(self, M: np.ndarray, D: np.ndarray | None, S: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mass, damping and gyroscopic, and stiffness matrix of (y, p)."""
        n, m = self.W.shape
        G = self.W * self.k
        zero = np.zeros((n, m))
        damping = np.zeros((n, n)) if D is None else D
        return (
            np.block([[M, zero], [zero.T, np.diag(self.k)]]),
            np.block([[damping, G], [-G.T, np.diag(self.k * self.rate)]]),
            np.block([[S, zero], [zero.T, np.zeros((m, m))]]),
        )


def law_places(lin: Any) -> Iterator[LawPlace]:
    """Every law that acts in a linearisation."""
    t = tables(lin.model)
    places = lin.snapshot.system.law_places(lin.state.q, lin.state.rate)
    for start, a, b, point, gradient, u, v in places:
        i = int(np.flatnonzero(t["law_x"] == start)[0])
        code, n = int(t["law_type"][i]), int(t["law_n"][i])
        if LAW_OF_CODE[code].effect in lin.without:
            continue
        kind = "joint" if t["law_owner_kind"][i] else "element"
        name = t[f"{kind}_name"][int(t["law_owner"][i])]
        w = gradient @ (_twist(lin, b, point) - _twist(lin, a, point))
        yield LawPlace(i, code, t["x"][start : start + n], w, u, v, f"{kind} {name!r}")


@dataclass(frozen=True)
class FunctionPlace:
    """A function of m coordinates at a state: its body, its numbers, directions (m, dof), displacements and rates (m,)."""

    body: Any
    numbers: np.ndarray
    direction: np.ndarray
    u: np.ndarray
    v: np.ndarray
    name: str


def function_places(lin: Any) -> Iterator[FunctionPlace]:
    """Every function that acts in a linearisation."""
    t = tables(lin.model)
    places = lin.snapshot.system.function_places(lin.state.q, lin.state.rate)
    for i, a, b, point, gradients, u, v in places:
        kind = "joint" if t["function_owner_kind"][i] else "element"
        name = t[f"{kind}_name"][int(t["function_owner"][i])]
        start, n = int(t["function_x"][i]), int(t["function_n"][i])
        w = gradients @ (_twist(lin, b, point) - _twist(lin, a, point))
        yield FunctionPlace(
            t["function_body"][i], t["x"][start : start + n], w, np.array(u), np.array(v), f"{kind} {name!r}"
        )


def relaxation_of(system: Any) -> Relaxation | None:
    """The relaxing states of a linearisation, or None: matrices of a user have none."""
    if not hasattr(system, "snapshot"):
        return None
    if not any(LAW_OF_CODE[int(code)].state == "rate" for code in system.snapshot.tables["law_type"]):
        return None
    found = [
        (place.direction, *pair, place.name)
        for place in law_places(system)
        for pair in _core.law_relaxations(place.code, [float(x) for x in place.numbers], place.u)
    ]
    if not found:
        return None
    W, k, rate, names = zip(*found, strict=True)
    return Relaxation(np.array(W).T, np.array(k), np.array(rate), tuple(names))


def _twist(lin: Any, body: int, point: np.ndarray) -> np.ndarray:
    if body < 0:
        return np.zeros((6, lin.n))
    return twist_at(lin.T[6 * body : 6 * body + 6], point - lin.poses["position"][body])


def relaxing_modes(system: Any, relaxation: Relaxation, damping: Any, stiffness: Any) -> dict[str, Any]:
    """The answer of `_core.dense_modes` for the extended system, without the roots that belong to no motion.

    ``damping`` and ``stiffness``: (symmetric, skew) parts of the system, each or None.
    """
    n, m = relaxation.W.shape
    zero = np.zeros((m, m))
    M, D, S = relaxation.extended(system.M, _total(*damping), _total(*stiffness))
    C = np.zeros_like(D)
    C[:n, :n] = 0.0 if damping[0] is None else damping[0]
    C[n:, n:] = D[n:, n:]
    K = np.block([[stiffness[0], np.zeros((n, m))], [np.zeros((m, n)), zero]])
    N = None if stiffness[1] is None else S - K
    r = dict(_core.dense_modes(M, C, D - C, K, N, None))
    size = np.linalg.norm(r["shape"], axis=0)
    alone = np.linalg.norm(r["shape"][:n], axis=0) <= np.sqrt(np.finfo(float).eps) * size
    own = np.flatnonzero((np.array(r["kind"]) == "rigid") & alone)
    column = {int(i): c for c, i in enumerate(r["partner_mode"])}
    kind = np.array(r["kind"], dtype="U10")
    for i in own:
        c = column[int(i)]
        s, shape, left = complex(r["partner"][i]), r["partner_shape"][:, c], r["partner_left"][:, c]
        r["eigenvalue"][i], r["partner"][i], kind[i] = s, np.nan, "relaxation"
        r["shape"][:, i], r["left"][:, i] = shape, left
        r["backward_error"][i], r["condition"][i] = _accuracy(s, shape, left, M, D, S)
        r["error"][i] = r["condition"][i] * max(r["backward_error"][i], np.finfo(float).eps)
    order = np.argsort(np.abs(r["eigenvalue"]), kind="stable")
    place = np.argsort(order)
    for key in ("eigenvalue", "partner", "backward_error", "condition", "error", "near_defective"):
        r[key] = np.asarray(r[key])[order]
    r["kind"] = kind[order].tolist()
    r["shape"], r["left"] = r["shape"][:n, order], r["left"][:n, order]
    others = [c for c, i in enumerate(r["partner_mode"]) if i not in own]
    r["partner_mode"] = place[np.asarray(r["partner_mode"], dtype=int)[others]]
    r["partner_shape"], r["partner_left"] = r["partner_shape"][:n, others], r["partner_left"][:n, others]
    members = [[int(place[i]) for i in range(a, a + count) if i not in own] for a, count in r["groups"]]
    r["groups"] = [(min(g), len(g)) for g in members if len(g) > 1 and max(g) - min(g) == len(g) - 1]
    return r


def _total(a: Any, b: Any) -> Any:
    return b if a is None else a if b is None else a + b


def _accuracy(
    s: complex, shape: np.ndarray, left: np.ndarray, M: np.ndarray, D: np.ndarray, S: np.ndarray
) -> tuple[float, float]:
    """Backward error of a root and its condition, with the norms of the matrices as the sizes of their changes."""
    size = sum(abs(s) ** k * np.linalg.norm(a) for k, a in enumerate((S, D, M)))
    residual = s**2 * (M @ shape) + s * (D @ shape) + S @ shape
    slope = abs(left @ (2.0 * s * (M @ shape) + D @ shape))
    backward = np.linalg.norm(residual) / (size * np.linalg.norm(shape))
    return float(backward), float(size * np.linalg.norm(shape) * np.linalg.norm(left) / (slope * abs(s)))
