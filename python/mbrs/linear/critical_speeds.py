"""Critical speeds: where a multiple of the speed of rotation meets a mode, from the pencil in the speed itself."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .._lib.text import Block

# A forward force does work on a mode from this share of its motion on. Larger: whirl on slightly unequal supports counts as not
# excited; smaller: rounding excites backward whirl on round ones. Pinned by tests/truth/test_campbell.py.
EXCITED = 1e-6
# Relative accuracy of a critical speed at which Newton stops, and the change of rows at which matrices count as polynomials of the speed.
# A root with |s|^2 below this many times what rounding of the stiffness adds up to in its shape is that of a rigid motion, at 0 but for
# rounding. Too small: the turning itself counts as a critical speed; too large: soft modes beside stiff ones are lost. Pinned by
# tests/linear/test_critical_rigid.py.
RIGID = 1e3
LOCATED, POLYNOMIAL = 1e-11, 1e-9
# Steps below this that do not become smaller are rounding. Larger: a slowly converging root is called found; smaller: stiff models lose
# critical speeds. Pinned by tests/truth/test_campbell.py (bearings of 1e14 N/m).
STALLED = 1e-6
# Entries of a row that are small beside its stiffness and the turning count as this part of them. Larger: a row that leaves the
# polynomials passes; smaller: rounding of rows that vanish refuses matrices that are polynomials.
_SMALL_ROW = 1e-3
# Parts of the largest, free of units, below which a term of a polynomial, the leading coefficient of a root, the area across the
# axis (a square) and the speed of a body are rounding. Larger: soft terms, distant roots, weak whirl, slow bodies are lost; smaller:
# rounding makes roots at infinity, and whirl of what only twists.
_ABSENT_TERM, _AT_INFINITY, _ACROSS, _TURNS = 1e-12, 1e-12, 1e-16, 1e-9
# Sine of the angle between the two slopes of a root below which no step separates speed and frequency. Larger: flat crossings are
# given up; smaller: steps are rounding.
_PARALLEL = 1e-14
_ITERATIONS = 30


@dataclass(frozen=True)
class CriticalSpeed:
    """A speed at which ``order`` x speed is the frequency of a mode.

    ``speed`` rad/s, ``mode`` (column of the diagram, from 0), ``whirl`` +1 forward, -1 backward, 0 neither, ``damping`` ratio there,
    ``unbalance``: share of the motion across the axis that a force turning with the rotor works on (1 for forward whirl, 0 for
    backward whirl on round supports, 1/2 in a plane), None where unbalance does not act at this order; ``error`` relative.
    """

    speed: float
    mode: int
    order: float
    whirl: int
    damping: float
    unbalance: float | None
    error: float

    @property
    def rpm(self) -> float:
        """Revolutions per minute."""
        return self.speed * 30.0 / np.pi

    @property
    def frequency(self) -> float:
        """Hz, of the mode: order x speed / 2 pi."""
        return self.order * self.speed / (2 * np.pi)

    @property
    def excited(self) -> bool | None:
        """Does unbalance excite it? None where the order is not that of unbalance."""
        return None if self.unbalance is None else self.unbalance > EXCITED


class CriticalSpeeds(tuple[CriticalSpeed, ...]):
    """Critical speeds in ascending order; prints as a table."""

    __slots__ = ()

    def block(self) -> Block:
        """The printed table."""
        from .._lib.text import Block

        if not self:
            return Block(title="no critical speeds in this range")
        sense = {1: "forward", -1: "backward", 0: "-"}
        answer = {True: "yes", False: "no", None: "-"}
        rows = [
            [c.speed, c.rpm, c.frequency, f"{c.order:g}x", c.mode + 1, sense[c.whirl], c.damping, answer[c.excited]]
            for c in self
        ]
        head = ["speed rad/s", "r/min", "Hz", "order", "mode", "whirl", "damping", "unbalance excites"]
        return Block(head, rows, title="critical speeds")

    def __str__(self) -> str:
        return self.block().text()

    def _repr_html_(self) -> str:
        return self.block().html()

    __repr__ = __str__


@dataclass(frozen=True)
class Matrices:
    """M, D, S of a steady motion."""

    M: np.ndarray
    D: np.ndarray
    S: np.ndarray

    def over(self, kept: np.ndarray) -> Matrices:
        """Matrices over some of the coordinates."""
        place = np.ix_(kept, kept)
        return Matrices(self.M[place], self.D[place], self.S[place])

    def dynamic(self, s: complex) -> np.ndarray:
        """s^2 M + s D + S."""
        return np.asarray(s * s * self.M + s * self.D + self.S)


class SpeedPencil:
    """M, D, S as polynomials of second degree in the speed through three of its values: exact where nothing deflects."""

    def __init__(self, speeds: Iterable[float], values: Iterable[Matrices]) -> None:
        at = np.array(list(speeds))
        given = list(values)
        self.middle, self.half = float(0.5 * (at[0] + at[-1])), float(0.5 * (at[-1] - at[0]))
        basis = np.linalg.inv(np.vander((at - self.middle) / self.half, 3, increasing=True))
        self.coefficients = tuple(
            np.einsum("ij,jkl->ikl", basis, np.array([getattr(v, key) for v in given])) for key in ("M", "D", "S")
        )

    def at(self, speed: float) -> Matrices:
        """The polynomials."""
        x = (speed - self.middle) / self.half
        return Matrices(*(c[0] + x * (c[1] + x * c[2]) for c in self.coefficients))

    def slopes(self, speed: float) -> Matrices:
        """Their derivatives by the speed."""
        x = (speed - self.middle) / self.half
        return Matrices(*((c[1] + 2 * x * c[2]) / self.half for c in self.coefficients))

    def agrees(self, speed: float, found: Matrices) -> bool:
        """Are the matrices at another speed those of the polynomials, row by row?"""
        d = natural(found)
        for mine, other in zip((getattr(self.at(speed), k) for k in "MDS"), (found.M, found.D, found.S), strict=True):
            scaled, change = np.abs(other) * d * d[:, None], np.abs(mine - other) * d * d[:, None]
            size = np.max(scaled, axis=1, initial=0.0)
            floor = np.max(np.abs(found.S) * d * d[:, None], axis=1, initial=0.0) + speed**2
            if np.any(np.max(change, axis=1, initial=0.0) > POLYNOMIAL * np.maximum(size, _SMALL_ROW * floor)):
                return False
        return True

    def roots(self, order: float, kept: np.ndarray) -> np.ndarray:
        """Complex speeds with det(S + i n W D - n^2 W^2 M) = 0 over the coordinates ``kept``."""
        from scipy.linalg import eig

        place = np.ix_(kept, kept)
        M, D, S = ([c[k][place].astype(complex) for k in range(3)] for c in self.coefficients)
        # W = middle + half x
        w = np.array([self.middle, self.half]) * order
        terms = [np.zeros_like(S[0]) for _ in range(5)]
        for k in range(3):
            terms[k] += S[k]
            for j, factor in enumerate(1j * w):
                terms[k + j] += factor * D[k]
            for j, factor in enumerate((w[0] ** 2, 2 * w[0] * w[1], w[1] ** 2)):
                terms[k + j] -= factor * M[k]
        d = 1.0 / np.sqrt(sum(np.abs(np.diag(t)) for t in terms) + np.finfo(float).tiny)
        terms = [t * d * d[:, None] for t in terms]
        while len(terms) > 2 and _absent(terms[-1], terms):
            terms.pop()
        n, degree = len(d), len(terms) - 1
        B = np.eye(n * degree, dtype=complex)
        A = np.zeros_like(B)
        for k in range(degree - 1):
            A[k * n : (k + 1) * n, (k + 1) * n : (k + 2) * n] = np.eye(n)
        for k in range(degree):
            A[(degree - 1) * n :, k * n : (k + 1) * n] = -terms[k]
        B[(degree - 1) * n :, (degree - 1) * n :] = terms[degree]
        alpha, beta = eig(A, B, right=False, homogeneous_eigvals=True)
        finite = np.abs(beta) > _AT_INFINITY * np.abs(alpha)
        return np.asarray(self.middle + self.half * alpha[finite] / beta[finite])


def _absent(term: np.ndarray, terms: list[np.ndarray]) -> bool:
    size = sum(np.abs(t) for t in terms)
    return bool(np.all(np.max(np.abs(term), axis=1) <= _ABSENT_TERM * np.max(size, axis=1)))


def natural(m: Matrices) -> np.ndarray:
    """(dof,) scales that give every coordinate unit mass."""
    return np.asarray(1.0 / np.sqrt(np.maximum(np.diag(m.M), np.finfo(float).tiny)))


@dataclass(frozen=True)
class Crossing:
    """A root: the speed, s = sigma + i n speed, right and left vectors (dof,), the relative residual."""

    speed: float
    s: complex
    shape: np.ndarray
    left: np.ndarray
    error: float


def crossing(
    near: float, order: float, pencil: SpeedPencil, exact: Callable[[float], Matrices] | None, kept: np.ndarray
) -> Crossing | None:
    """Newton for s = sigma + i n W with det(s^2 M + s D + S) = 0, sigma and W real; None where it does not converge. At order 0 the
    root sought is s = 0.

    ``exact`` gives the matrices where the polynomials are not exact: then their slopes alone are the polynomials'.
    """
    speed, sigma, before = near, 0.0, np.inf
    here = exact or pencil.at
    for _ in range(_ITERATIONS):
        m, slope, s = here(speed).over(kept), pencil.slopes(speed).over(kept), sigma + 1j * order * speed
        d = natural(m)
        U, values, Vh = np.linalg.svd(m.dynamic(s) * d * d[:, None])
        u, v = U[:, -1], Vh[-1].conj()
        by_s = u.conj() @ ((2 * s * m.M + m.D) * d * d[:, None]) @ v
        by_speed = u.conj() @ (slope.dynamic(s) * d * d[:, None]) @ v + 1j * order * by_s
        if order == 0.0:
            change = np.array([0.0, -(values[-1] / by_speed).real if by_speed else np.inf])
        else:
            step = np.array([[by_s.real, by_speed.real], [by_s.imag, by_speed.imag]])
            if abs(np.linalg.det(step)) <= _PARALLEL * np.abs(by_s) * np.abs(by_speed):
                return None
            change = np.linalg.solve(step, [-values[-1], 0.0])
        sigma, speed = sigma + float(change[0]), speed + float(change[1])
        if not np.isfinite(speed) or speed <= 0.0:
            return None
        moved = max(abs(change[1]) / speed, abs(change[0]) / max(abs(sigma), order * speed, np.finfo(float).tiny))
        # stiff elements beside soft ones leave rounding that no step removes: it is the error then
        stalled = moved <= STALLED and moved >= 0.5 * before
        before = moved
        if moved <= LOCATED or stalled:
            if order != 0.0 and abs(s) ** 2 <= RIGID * np.finfo(float).eps * float(
                np.abs(v) @ (np.abs(m.S) * d * d[:, None]) @ np.abs(v)
            ):
                return None
            shape, left = np.zeros((2, len(pencil.at(speed).M)), dtype=complex)
            shape[kept], left[kept] = v * d, u * d
            return Crossing(speed, sigma + 1j * order * speed, shape, left, float(moved))
    return None


def forward_share(rows: np.ndarray, left: np.ndarray, axis: np.ndarray) -> float:
    """Share of the motion of ``rows`` (n, 3, dof) that turns forward about the axis, of a left vector: what a force that turns with
    the rotor works on.
    """
    a = axis / np.linalg.norm(axis)
    e1 = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(a, e1)
    # Re (e1 - i e2) exp(i W t) turns forward; its work on the mode is left^H rows^T (e1 - i e2)
    moved = np.einsum("nij,j->ni", rows, left.conj())
    total = 2.0 * float(np.sum(np.abs(moved) ** 2))
    return float(np.sum(np.abs(moved @ (e1 - 1j * e2)) ** 2)) / total if total > 0.0 else 0.0


def whirl_of(rows: np.ndarray, shape: np.ndarray, axis: np.ndarray, least: float) -> int:
    """+1 or -1 where the orbits of ``rows`` (n, 3, dof), added up, are at least the part ``least`` of circles, else 0."""
    a = axis / np.linalg.norm(axis)
    moved = np.einsum("nij,j->ni", rows, shape)
    across = moved - np.outer(moved @ a, a)
    size = float(np.sum(np.abs(across) ** 2))
    # torsion and axial motion leave only rounding across the axis
    if size <= _ACROSS * float(np.sum(np.abs(moved) ** 2)):
        return 0
    area = float(np.sum(np.cross(across.real, -across.imag) @ a))
    return 0 if abs(area) <= least * size / 2 else int(np.sign(area))


def orbit_rows(lin: Any) -> np.ndarray:
    """(n, 3, dof) motions whose orbits tell whirl: centres of mass and rotations of bodies, points along flexible ones, each times the
    root of its mass (or inertia).
    """
    from .._lib.rotations import twist_at
    from ..model.schema import BODY
    from ..model.tables import modal_places

    t, rows = lin.snapshot.tables, []
    modal = dict(modal_places(t))
    n_bodies = len(lin.model.bodies)
    for i, mass in enumerate(lin.body_mass_matrices[:n_bodies]):
        twist, R = lin.T[6 * i : 6 * i + 6], lin.poses["rotation"][i]
        start = int(t["body_x"][i])
        com = R @ t["x"][start:][BODY.block.slice("com")]
        if i in modal:
            shapes = lin.model.bodies[i].modal
            weight = np.sqrt(mass[0, 0] / max(len(shapes.line_position), 1))
            for p, shape in zip(shapes.line_position, shapes.line_shape, strict=True):
                moved = twist_at(twist, R @ p)[:3] + R @ shape[:3] @ lin.modal_map[modal[i]]
                rows.append(weight * moved)
            continue
        rows.append(np.sqrt(mass[0, 0]) * twist_at(twist, com)[:3])
        rows.append(np.sqrt(max(float(np.sum(t["x"][start:][BODY.block.slice("inertia")][:3])), 0.0) / 3) * twist[3:])
    return np.array(rows).reshape(-1, 3, lin.n)


def turning_rows(lin: Any) -> np.ndarray:
    """(n, 3, dof): the same of those bodies alone that turn about the axis, which unbalance acts on."""
    omega = np.linalg.norm(lin.poses["angular_velocity"], axis=1)
    fast = omega > _TURNS * np.max(omega, initial=0.0)
    rows, at = orbit_rows(lin), 0
    kept: list[int] = []
    for i, body in enumerate(lin.model.bodies):
        modal = getattr(body, "modal", None)
        n = 2 if modal is None or "flexible_body" not in lin.snapshot.tables else len(modal.line_position)
        if fast[i]:
            kept.extend(range(at, at + n))
        at += n
    return np.asarray(rows[kept])
