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


def force(code: int, p: Array, u: Any, v: Any, z: Array) -> Answer:
    """The law at displacement u, rate v and memory z; the slopes hold the memory."""
    if code == CUBIC:
        return p[0] * u**3, 3 * p[0] * u**2, 0.0, []
    if code == POLYNOMIAL:
        f, k = _polynomial(p, u)
        return f, k, 0.0, []
    if code == POLYNOMIAL_RATE:
        (f, k), (g, c) = _polynomial(p[: len(p) // 2], u), _polynomial(p[len(p) // 2 :], v)
        return f + g, k, c, []
    if code in (GAP, GAP_BOTH):
        f, k = _gap(u, *p)
        if code == GAP_BOTH:
            g, other = _gap(-u, *p)
            f, k = f - g, k + other
        return f, k, 0.0, []
    if code == COULOMB:
        t = np.tanh(v / p[1])
        return p[0] * t, 0.0, p[0] / p[1] * (1 - t * t), []
    if code == HERTZ:
        d = u - p[2]
        return (p[0] * d ** p[1], p[0] * p[1] * d ** (p[1] - 1), 0.0, []) if np.real(d) > 0 else (0.0, 0.0, 0.0, [])
    if code == VAN_DER_POL:
        return p[0] * u**2 * v, 2 * p[0] * u * v, p[0] * u**2, []
    if code in (JENKINS, IWAN):
        return _sliders(p, u, z)
    if code == VARYING:
        k = p[0] * np.cos(p[2])
        return k * u, k, 0.0, []
    raise ModelError(f"mbrs.reference has no law of the code {code} on joints and elements")


def _polynomial(c: Array, x: Any) -> tuple[Any, Any]:
    f: Any = 0.0
    slope: Any = 0.0
    for a in c[::-1]:
        f, slope = f * x + a, slope * x + f
    return f, slope


def _gap(u: Any, k: Any, gap: Any, smoothing: Any) -> tuple[Any, Any]:
    d = u - gap
    if np.real(smoothing) == 0:
        return (k * d, k) if np.real(d) > 0 else (0.0, 0.0)
    root = np.sqrt(d * d + smoothing * smoothing)
    return 0.5 * k * (d + root), 0.5 * k * (1 + d / root)


def _sliders(p: Array, u: Any, z: Array) -> Answer:
    """Springs k_i that end in sliders at z_i, which let go at the force f_i."""
    f: Any = 0.0
    slope: Any = 0.0
    after = []
    for i, (k, slip) in enumerate(p.reshape(-1, 2)):
        trial = k * (u - z[i])
        if abs(np.real(trial)) <= np.real(slip):
            f, slope = f + trial, slope + k
            after.append(z[i])
        else:
            here = slip if np.real(trial) > 0 else -slip
            f = f + here
            after.append(u - here / k)
    return f, slope, 0.0, after


def attach(t: Mapping[str, Any], x: Array, elements: list[Any], joints: list[Any]) -> int:
    """Give every link its laws; memory is numbered element by element, then joint by joint, that of
    their angles after that of all laws. Returns its size."""
    for kind, owner in zip(t.get("function_owner_kind", ()), t.get("function_owner", ()), strict=True):
        name = (elements, joints)[int(kind)][int(owner)].name
        raise ModelError(f"mbrs.reference has no laws given as functions, as on {name!r}")
    keys = ("owner_kind", "owner", "component", "type", "n", "x")
    rows = list(zip(*(t.get(f"law_{k}", ()) for k in keys), strict=True))
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
