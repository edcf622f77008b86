"""Force laws of one relative coordinate in plain NumPy: force, slopes by displacement and rate, memory after.

The same laws as ``rust/src/force``, written a second time. Complex-safe in displacement, rate, numbers and memory: which
branch acts is decided by real parts.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ModelError
from .joints import angle_places
from .reader import entries
from .so3 import Array

CUBIC, POLYNOMIAL, POLYNOMIAL_RATE, GAP, GAP_BOTH, COULOMB, HERTZ, TABLE, VAN_DER_POL, JENKINS, IWAN, VARYING = range(
    12
)
FRICTION, CONTACT = (COULOMB, JENKINS, IWAN), (GAP, GAP_BOTH, HERTZ)

Answer = tuple[Any, Any, Any, list[Any]]  # force, slope by displacement, slope by rate, memory after


@dataclass
class BoundLaw:
    """A law on one coordinate of a link: its numbers, and the index of its memory among that of all laws."""

    component: int
    code: int
    p: Array
    memory: int

    @property
    def n_memory(self) -> int:
        return memory_size(self.code, len(self.p))

    def acts(self, without: Collection[str]) -> bool:
        """False where an effect that was left out is this law."""
        return not (
            ("friction" in without and self.code in FRICTION) or ("contact" in without and self.code in CONTACT)
        )

    def __call__(self, u: Any, v: Any, memory: Array) -> Answer:
        return force(self.code, self.p, u, v, memory[self.memory : self.memory + self.n_memory])


def memory_size(code: int, n: int) -> int:
    """Number of memories of the law."""
    return {JENKINS: 1, IWAN: n // 2}.get(code, 0)


def force(code: int, p: Array, u: Any, v: Any, z: Any = (), phase: Any = 0.0) -> Answer:
    """The law at displacement u, rate v, memory z and phase of the excitation, which broadcast; the slopes hold the memory."""
    if code == CUBIC:
        return p[0] * u**3, 3 * p[0] * u**2, 0.0, []
    if code == POLYNOMIAL:
        return *_polynomial(p, u), 0.0, []
    if code == POLYNOMIAL_RATE:
        (f, k), (g, c) = _polynomial(p[: len(p) // 2], u), _polynomial(p[len(p) // 2 :], v)
        return f + g, k, c, []
    if code in (GAP, GAP_BOTH):
        (f, k), (g, other) = _gap(u, *p), _gap(-u, *p)
        return (f, k, 0.0, []) if code == GAP else (f - g, k + other, 0.0, [])
    if code == COULOMB:
        t = np.tanh(v / p[1])
        return p[0] * t, 0.0, p[0] / p[1] * (1 - t * t), []
    if code == HERTZ:
        touches = np.real(u - p[2]) > 0
        d = np.where(touches, u - p[2], 1.0)
        return touches * p[0] * d ** p[1], touches * p[0] * p[1] * d ** (p[1] - 1), 0.0, []
    if code == TABLE:
        return *_table(p[: len(p) // 2], p[len(p) // 2 :], u), 0.0, []
    if code == VAN_DER_POL:
        return p[0] * u**2 * v, 2 * p[0] * u * v, p[0] * u**2, []
    if code in (JENKINS, IWAN):
        return _sliders(p, u, z)
    if code == VARYING:
        k = p[0] * np.cos(p[1] * phase + p[2])
        return k * u, k, 0.0, []
    raise ModelError(f"mbrs.reference has no law of the code {code}")


def _polynomial(c: Array, x: Any) -> tuple[Any, Any]:
    f: Any = 0.0
    slope: Any = 0.0
    for a in c[::-1]:
        f, slope = f * x + a, slope * x + f
    return f, slope


def _gap(u: Any, k: Any, gap: Any, smoothing: Any) -> tuple[Any, Any]:
    d = u - gap
    if np.real(smoothing) == 0:
        return k * d * (np.real(d) > 0), k * (np.real(d) > 0)
    root = np.sqrt(d * d + smoothing * smoothing)
    return 0.5 * k * (d + root), 0.5 * k * (1 + d / root)


def _table(x: Array, y: Array, u: Any) -> tuple[Any, Any]:
    """Monotone between the points, straight beyond them; real numbers only."""
    from scipy.interpolate import PchipInterpolator

    spline, inside = PchipInterpolator(x, y), np.clip(u, x[0], x[-1])
    slope = spline.derivative()(inside)
    return spline(inside) + slope * (u - inside), slope


def _sliders(p: Array, u: Any, z: Any) -> Answer:
    """Springs k_i that end in sliders at z_i, which let go at the force f_i."""
    f: Any = 0.0
    slope: Any = 0.0
    after = []
    for (k, slip), place in zip(p.reshape(-1, 2), z, strict=True):
        trial = k * (u - place)
        sticks = np.abs(np.real(trial)) <= np.real(slip)
        here = np.where(sticks, trial, np.where(np.real(trial) > 0, slip, -slip))
        f, slope = f + here, slope + k * sticks
        after.append(np.where(sticks, place, u - here / k))
    return f, slope, 0.0, after


def attach(t: Mapping[str, Any], x: Array, elements: list[Any], joints: list[Any]) -> int:
    """Give every link its laws; memory is numbered element by element, then joint by joint, that of
    their angles after that of all laws. Returns its size."""
    for kind, owner in entries(t, "function", "owner_kind owner"):
        name = (elements, joints)[int(kind)][int(owner)].name
        raise ModelError(f"mbrs.reference has no laws given as functions, as on {name!r}")
    rows = list(entries(t, "law", "owner_kind owner component type n x"))
    n_memory = 0
    for kind, links in enumerate((elements, joints)):
        for index, link in enumerate(links):
            for _, _, component, code, n, start in (r for r in rows if r[0] == kind and r[1] == index):
                if code == TABLE:
                    raise ModelError(
                        f"mbrs.reference has no table laws, as on {link.name!r}; give a polynomial instead"
                    )
                if code > VARYING:
                    raise ModelError(f"mbrs.reference has no laws whose state has a rate, as on {link.name!r}")
                law = BoundLaw(int(component), int(code), x[start : start + n], n_memory)
                link.laws.append(law)
                link.has_force = True
                n_memory += law.n_memory
    for link in (*elements, *joints):
        angles = angle_places(link.kind)
        if angles and (link.laws or (link.has_force and np.any(link.k))):
            link.turns = n_memory
            n_memory += len(angles)
    return n_memory
