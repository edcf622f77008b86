"""The three-bladed rotor of `_wind_rotor` as one flexible body: hub and blades in one floating frame on the end of the shaft."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ..flexible import ModalBody
from ..model.model import Model
from ..model.motions import Ramp
from ._wind_rotor import AROUND, add_nacelle, air_loads, blade_axes, shaft_end, wind_blade
from ._windpact import HUB_INERTIA, HUB_MASS, HUB_RADIUS, SPEED

Array = np.ndarray
_BLADE_MODES = 4
# shapes of the hub on the shaft's end: three translations, three rotations
_MOVED, _TURNED = slice(0, 3), slice(3, 6)
_HUB = 6


def whole_rotor(
    speed: float = SPEED, families: int = 3, gravity: float | None = 9.81, air: float | None = None, scale: float = 1.0
) -> Model:
    """`wind_rotor` with hub and blades as one flexible body "rotor" on the end of the driven shaft.

    Parameters
    ----------
    speed, gravity, air, scale
        As of `wind_rotor`.
    families
        Of modes, up to three, from 1st flap, 1st edge, 2nd flap: two antisymmetric modes and a symmetric one of each.

    Returns
    -------
    Model
        3 bodies. Modal coordinates "rotor.q1", ...: of each family in turn two antisymmetric ones and the symmetric one; nodes
        "section1" to "section3" and "tip1" to "tip3". Data as of `wind_rotor`.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.whole_rotor()
    >>> m
    Model('wind rotor in one body': 3 bodies, 3 joints, 0 springs or dampers, 0 loads, 0 parameters)
    """
    m = Model("wind rotor in one body", gravity=None if gravity is None else (0.0, 0.0, -gravity))
    shaft, bearing, centre, frame = add_nacelle(m, speed, scale)
    m.drive("turning", bearing, Ramp(speed))
    body = rotor_body(families, scale)
    spin = tuple(speed * frame[:, 2])
    rotor = m.flexible_body("rotor", body, at=centre, orientation=frame, angular_velocity=spin)
    m.fixed("shaft end", shaft, rotor.node("frame"))
    if air is not None:
        m.section_load("rotor", **air_on_the_rotor(body, speed, air, scale), name="air")
    return m


@lru_cache(maxsize=8)
def rotor_body(families: int = 3, scale: float = 1.0) -> ModalBody:
    """Hub and blades in the axes of the shaft's end, reduced to two antisymmetric modes and a symmetric one of each family.

    Shapes before the reduction: six rigid ones, e_k and e_k x r, of the hub with all blades, and those of each clamped blade. Second
    order: e_k x (e_l x r) and e_k x phi_l beside the foreshortening of the blades.
    """
    import scipy.linalg

    blade = wind_blade(_BLADE_MODES, scale)
    parts = _Shapes(blade, scale)
    k, c = shaft_end(scale)
    K = scipy.linalg.block_diag(np.diag(k), *[blade.K] * 3)
    C = scipy.linalg.block_diag(np.diag(c), *[blade.C] * 3)
    _, phi = scipy.linalg.eigh(K, np.trace(parts.P2, axis1=2, axis2=3))
    T = phi[:, _chosen(phi, families)]
    top = np.argmax(np.abs(T[_HUB:]), axis=0) + _HUB
    T = T * np.sign(T[top, np.arange(T.shape[1])])
    nodes, at, shape = parts.nodes()
    mass, com = parts.mass, parts.first / parts.mass
    about = np.trace(parts.second) * np.eye(3) - parts.second
    KG = np.einsum("ikl,ka,lb->iab", parts.geometric(), T, T)
    return ModalBody(
        mass=mass,
        com=com,
        inertia=about - mass * ((com @ com) * np.eye(3) - np.outer(com, com)),
        S=parts.S @ T,
        P1=np.einsum("kab,kc->cab", parts.P1, T),
        P2=np.einsum("klab,kc,ld->cdab", parts.P2, T, T),
        K=_symmetric(T.T @ K @ T),
        C=_symmetric(T.T @ C @ T),
        KG=0.5 * (KG + np.swapaxes(KG, 1, 2)),
        nodes=("frame", *nodes),
        node_position=np.vstack([np.zeros(3), at]),
        node_shape=np.concatenate([np.zeros((1, 6, T.shape[1])), shape @ T]),
        line_position=parts.line,
        line_shape=parts.line_shape @ T,
        note=f"rotor of three blades, {families} families of two antisymmetric modes and a symmetric one",
    )


def _chosen(phi: Array, families: int) -> list[int]:
    """Two antisymmetric modes and the symmetric one of each family, the lowest whose largest coordinates of blades are the family's."""
    blades = phi[_HUB:].reshape(3, _BLADE_MODES, -1)
    family = np.argmax(np.sum(blades**2, axis=0), axis=0)
    together = np.sum(np.mean(blades, axis=0) ** 2, axis=0) > 0.5 * np.sum(np.mean(blades**2, axis=0), axis=0)
    out: list[int] = []
    for k in range(families):
        out += [*np.flatnonzero((family == k) & ~together)[:2], *np.flatnonzero((family == k) & together)[:1]]
    return out


def _skew(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def _symmetric(A: Array) -> Array:
    return 0.5 * (A + A.T)


class _Shapes:
    """Integrals of all shapes over the mass, before the reduction."""

    def __init__(self, blade: ModalBody, scale: float) -> None:
        self.blade, self.axes = blade, [blade_axes(angle) for angle in AROUND]
        self.roots = [scale * HUB_RADIUS * R[:, 0] for R in self.axes]
        hub = scale**5 * HUB_INERTIA
        self.mass, self.first = scale**3 * HUB_MASS, np.zeros(3)
        self.second = 0.5 * hub * np.eye(3)  # int rho r r^T of a hub with three equal moments of inertia
        own = 0.5 * np.trace(blade.inertia) * np.eye(3) - blade.inertia
        for R, p in zip(self.axes, self.roots, strict=True):
            centre = p + R @ blade.com
            self.mass += blade.mass
            self.first += blade.mass * centre
            self.second += R @ own @ R.T + blade.mass * np.outer(centre, centre)
        self.n = _HUB + 3 * blade.n_modes
        self._integrate()
        self._draw()

    def places(self, i: int) -> slice:
        """The slice of a blade among all shapes."""
        return slice(_HUB + i * self.blade.n_modes, _HUB + (i + 1) * self.blade.n_modes)

    def _integrate(self) -> None:
        n, blade, unit = self.n, self.blade, np.eye(3)
        self.S, self.P1, self.P2 = np.zeros((3, n)), np.zeros((n, 3, 3)), np.zeros((n, n, 3, 3))
        self.S[:, _MOVED], self.S[:, _TURNED] = self.mass * unit, -_skew(self.first)
        turns = [_skew(e) for e in unit]
        for j in range(3):
            self.P1[j], self.P1[3 + j] = np.outer(self.first, unit[j]), self.second @ turns[j].T
        for i, (R, p) in enumerate(zip(self.axes, self.roots, strict=True)):
            own = self.places(i)
            self.S[:, own] = R @ blade.S
            self.P1[own] = np.einsum("ab,kbc,dc->kad", R, blade.P1, R) + np.einsum("a,bk->kab", p, R @ blade.S)
            self.P2[own, own] = np.einsum("ab,klbc,dc->klad", R, blade.P2, R)
        for j in range(3):  # int rho e_j phi_l^T and int rho (e_j x r) phi_l^T
            self.P2[j] = np.einsum("a,bl->lab", unit[j], self.S)
            self.P2[3 + j] = np.einsum("ab,lbc->lac", turns[j], self.P1)
        self.P2[_HUB:, :_HUB] = np.transpose(self.P2[:_HUB, _HUB:], (1, 0, 3, 2))
        self.P2[_TURNED, _MOVED] = np.transpose(self.P2[_MOVED, _TURNED], (1, 0, 3, 2))

    def geometric(self) -> Array:
        """KG (12, n, n): int rho b . psi_kl for b = a0 + W r, psi_kl the displacement of second order."""
        unit, out = np.eye(12), np.zeros((12, self.n, self.n))
        for i in range(12):
            a0, W = unit[i, :3], unit[i, 3:].reshape(3, 3)
            out[i, _TURNED, _TURNED] = self._turned_twice(a0, W)
            side = self._turned_shapes(a0, W)
            out[i, _TURNED, _HUB:], out[i, _HUB:, _TURNED] = side, side.T
            for b, (R, p) in enumerate(zip(self.axes, self.roots, strict=True)):
                field = np.concatenate([R.T @ (a0 + W @ p), (R.T @ W @ R).ravel()])
                out[i, self.places(b), self.places(b)] = np.tensordot(field, self.blade.KG, 1)
        return out

    def _turned_twice(self, a0: Array, W: Array) -> Array:
        """int rho b . (e_k x (e_l x r)), its symmetric part."""
        push = np.outer(a0, self.first) + W @ self.second  # int rho b r^T
        return _symmetric(push) - np.trace(push) * np.eye(3)

    def _turned_shapes(self, a0: Array, W: Array) -> Array:
        """int rho b . (e_k x phi_l) (3, shapes of blades)."""
        S, P1 = self.S[:, _HUB:], self.P1[_HUB:]
        push = np.einsum("a,bl->lab", a0, S) + np.einsum("ac,lcb->lab", W, P1)  # int rho b phi^T
        return np.stack([push[:, (k + 2) % 3, (k + 1) % 3] - push[:, (k + 1) % 3, (k + 2) % 3] for k in range(3)])

    def _of_blade(self, i: int, at: Array, shape: Array) -> tuple[Array, Array]:
        """Points and shapes of a blade among those of the rotor."""
        R, p = self.axes[i], self.roots[i]
        r, out = p + at @ R.T, np.zeros((len(at), 6, self.n))
        out[:, :3, _MOVED], out[:, 3:, _TURNED] = np.eye(3), np.eye(3)
        out[:, :3, _TURNED] = np.array([-_skew(x) for x in r])
        for half in (slice(0, 3), slice(3, 6)):
            out[:, half, self.places(i)] = R @ shape[:, half]
        return r, out

    def _draw(self) -> None:
        lines = [self._of_blade(i, self.blade.line_position, self.blade.line_shape) for i in range(3)]
        self.line, self.line_shape = (np.concatenate(part) for part in zip(*lines, strict=True))

    def nodes(self) -> tuple[list[str], Array, Array]:
        """Names, places and shapes of sections and tips."""
        names = ("section", "tip")
        own = [self.blade.node(name) for name in names]
        found = [self._of_blade(i, self.blade.node_position[own], self.blade.node_shape[own]) for i in range(3)]
        at, shape = (np.concatenate(part) for part in zip(*found, strict=True))
        return [f"{name}{i + 1}" for i in range(3) for name in names], at, shape


def air_on_the_rotor(body: ModalBody, speed: float, until: float, scale: float) -> dict[str, Any]:
    """The loads of all blades over the distance along the line of the rotor, which runs through one blade after the other."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(body.line_position, axis=0), axis=1))])
    starts = along[:: len(along) // 3][:3]
    several = [air_loads(angle, speed, until, scale) for angle in AROUND]
    return {
        "stations": np.concatenate([start + load["stations"] for start, load in zip(starts, several, strict=True)]),
        "table": np.concatenate([a["table"] @ blade_axes(t).T for t, a in zip(AROUND, several, strict=True)], axis=1),
        "times": several[0]["times"],
    }
