"""Axes in which the linearisation of a steady motion is constant: fixed, turning with the rotor, or multiblade coordinates.

The increments of the model's coordinates are y = T(t) z with T = exp(W t), W constant, so that

    M_f = T^T M T,   D_f = T^T (D T + 2 M T W),   S_f = T^T (S T + D T W + M T W^2)

belong to z. At the drawn angle T = 1: z keeps the names of y.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._lib.border import core_errors
from .._lib.rotations import skew
from ..errors import ModelError
from ..model.schema import BODY
from ..model.tables import modal_places
from ..system.snapshot import Snapshot
from ..system.state import State
from .inertia import mass_matrices, mass_matrix_at
from .spin import Spin
from .strains import strains_at

# Angles (rad) of the turn at which tangents are compared: no two differ by a simple fraction of a turn, and the first one tells
# multiblade patterns of up to 23 blades apart.
ANGLES = (0.27, 1.31, 2.39, 3.83, 5.27)
# Change of a row of M, D, S or of the residual over a turn, over the row's own size, that still counts as constant. Larger: slightly
# unsymmetric rotors get modes that hold for one angle; smaller: rounding of drawn points refuses symmetric ones. The second number is
# the same over the tolerance of the drawing: axes that lean by it make changes of some times that size. Pinned by
# tests/truth/test_steady_rotation.py and tests/invariance/test_steady_motion.py.
VARIES, VARIES_AS_DRAWN = 1e-8, 10.0
# Rounding of a row over the sum of the absolute terms that it was made of, before the inertial ones cancel. Larger: changes that
# small pass, which no mode feels; smaller: rows that vanish (the turning itself) seem to change. Pinned by the same tests.
ROUNDING = 1e-10
# The same over the largest entry of the connected part, coordinates in natural units: what noise in the last digits of a drawing makes of
# rows that vanish by symmetry (two points that were drawn as one, an axis through a centre of mass). Larger: changes of soft parts on
# stiff bearings pass. Smaller: such noise refuses symmetric rotors. Pinned by tests/truth/test_steady_rotation.py with jitter.
NOISE = 2e-11
_ROUNDED_PLACES = 64 * np.finfo(float).eps
# Bodies advance along the maps of the joints, for which no air is needed.
STILL_AIR = ("aerodynamics",)
# How well the motion of all bodies has to be representable in a frame, over its size.
FITS = 1e-9


@dataclass(frozen=True)
class Tangent:
    """M, D, S and the residual at one angle, with what the increments of coordinates move: ``rows`` (n_rows, dof) twists of all
    bodies (world axes) and modal coordinates, in natural units.
    """

    t: float
    M: np.ndarray
    D: np.ndarray
    S: np.ndarray
    residual: np.ndarray
    rows: np.ndarray
    rotation: np.ndarray
    q: np.ndarray
    position: np.ndarray

    def seen(self, T: np.ndarray, W: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """M_f, D_f, S_f and the residual in z."""
        TW = T @ W
        D = self.D @ T + 2.0 * self.M @ TW
        S = self.S @ T + self.D @ TW + self.M @ TW @ W
        return T.T @ self.M @ T, T.T @ D, T.T @ S, T.T @ self.residual


@dataclass(frozen=True)
class Frame:
    """``name`` of the axes, W (dof, dof) in rad/s, and how much the rows change over a turn, relative."""

    name: str
    W: np.ndarray
    varies: float


@dataclass(frozen=True)
class Turn:
    """Tangents over a turn of one steady motion."""

    snapshot: Snapshot
    spin: Spin
    state: State
    without: tuple[str, ...]
    names: tuple[str, ...]
    force_scale: float
    tangents: tuple[Tangent, ...]
    scale: np.ndarray
    omega: np.ndarray

    @property
    def fits(self) -> float:
        """Tolerance for the agreement of the motions of bodies, over their size."""
        return max(FITS, self.snapshot.model.tolerance)

    @property
    def axis(self) -> np.ndarray | None:
        """The rate vector (3,) that all turning bodies share, or None."""
        size = np.linalg.norm(self.omega, axis=1)
        turning = self.omega[size > self.fits * np.max(size, initial=0.0)]
        if not len(turning) or np.max(np.abs(turning - turning[0])) > self.fits * np.max(size):
            return None
        return np.asarray(turning[0])

    # --- transformations -----

    def target(self, name: str, tangent: Tangent, outside_of: Sequence[tuple[int, ...]] = ()) -> np.ndarray | None:
        """B with rows(t) T(t) = B rows(0), (n_rows, n_rows); None where elastic shapes do not turn into each other."""
        w_frame = np.zeros(3) if name == "fixed" else self.axis
        if w_frame is None:
            return None
        n_frames, n_rows = len(self.omega), len(tangent.rows)
        B = np.eye(n_rows)
        R = rotation_about(w_frame, tangent.t)
        for i in range(2 * n_frames):
            B[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = R
        model, length = self.snapshot.model, self.snapshot.system.characteristic_length
        for body, own in modal_places(self.snapshot.tables):
            if any(body in blade for blade in outside_of):
                continue
            w = self.tangents[0].rotation[body].T @ (self.omega[body] - w_frame)
            A = modal_generator(_elastic(model, body), w, length)
            if A is None:
                return None
            at = slice(6 * n_frames + own.start, 6 * n_frames + own.stop)
            B[at, at] = expm(A * tangent.t)
        return B

    def transformations(self, name: str) -> list[np.ndarray] | None:
        """T at every angle, or None where these axes do not fit the joints."""
        first, out = self.tangents[0], []
        for tangent in self.tangents:
            if len(tangent.M) != len(first.M):
                return None
            B = self.target(name, tangent)
            if B is None:
                return None
            T = fitted(tangent.rows * self.scale, B @ first.rows * self.scale, self.fits)
            if T is None:
                return None
            out.append(T * self.scale[:, None] / self.scale[None, :])
        return out

    def generator(self, T: Sequence[np.ndarray]) -> np.ndarray | None:
        """W of T = exp(W t), or None where there is none."""
        from scipy.linalg import logm

        scaled = [x * self.scale[None, :] / self.scale[:, None] for x in T]
        if all(np.max(np.abs(x - np.eye(len(x))), initial=0.0) <= self.fits for x in scaled):
            return np.asarray(np.zeros_like(scaled[0]))
        made = logm(scaled[1])
        if np.max(np.abs(made.imag)) > self.fits:
            return None
        W = made.real / self.tangents[1].t
        for x, tangent in zip(scaled, self.tangents, strict=True):
            if np.max(np.abs(expm(W * tangent.t) - x)) > self.fits:
                return None
        W[np.abs(W) <= self.fits * np.max(np.abs(W))] = 0.0
        return np.asarray(W * self.scale[:, None] / self.scale[None, :])

    # --- comparison -----

    def variation(self, T: Sequence[np.ndarray], W: np.ndarray) -> tuple[float, int]:
        """Largest change of a row over its own size, less what rounding explains, and where."""
        base = self.tangents[0].seen(T[0], W)
        s, first = self.scale, self.tangents[0]
        natural = [np.abs(x) * s[None, :] * s[:, None] for x in base[:3]]
        rows, terms = [np.sum(x, axis=1) for x in natural], self._terms(first, W)
        part = connected(sum(x != 0.0 for x in natural))
        largest = [np.array([np.max(x[part == own]) for own in part]) for x in natural]
        worst, place = 0.0, 0
        for other, Tk in zip(self.tangents[1:], T[1:], strict=True):
            seen = other.seen(Tk, W)
            for k in range(3):
                change = np.max(np.abs(seen[k] - base[k]) * s[None, :] * s[:, None], axis=1, initial=0.0)
                allowed = ROUNDING * terms[k] + NOISE * largest[k]
                own = np.maximum(rows[k], np.finfo(float).tiny)
                relative = np.maximum(change - allowed, 0.0) / own
                if np.max(relative, initial=0.0) > worst:
                    worst, place = float(np.max(relative)), int(np.argmax(relative))
            change = np.maximum(np.abs(seen[3] - base[3]) * s - ROUNDING * terms[2] - NOISE * largest[2], 0.0)
            # what turning does to the masses is a force, too, where no other acts
            speed = float(np.max(np.linalg.norm(self.omega, axis=1), initial=0.0))
            change /= np.maximum(max(self.force_scale, np.finfo(float).tiny), terms[0] * speed**2)
            if np.max(change, initial=0.0) > max(worst, self.fits):
                worst, place = float(np.max(change)), -1 - int(np.argmax(change))
        return worst, place

    def _terms(self, tangent: Tangent, W: np.ndarray) -> list[np.ndarray]:
        """(dof,) natural sums of absolute terms that rows of M_f, D_f, S_f are added up from, elements (|g|^T |k| |g|) included."""
        s = self.scale
        speed = float(np.max(np.linalg.norm(self.omega, axis=1), initial=0.0))
        M, D, S = (np.abs(x) * s[None, :] * s[:, None] for x in (tangent.M, tangent.D, tangent.S))
        turned = np.sum(np.abs(W) * s[None, :] / s[:, None], axis=1) + speed
        inertia, stiff = np.sum(M, axis=1), np.sum(S, axis=1)
        length = self.snapshot.system.characteristic_length
        for _, _, k, gradients, reach in self.elements(tangent):
            # places are rounded, so that elements without load have forces of this rounding, too
            strain = np.abs(gradients) @ np.array([length] * 3 + [1.0] * 3)
            stiff += _ROUNDED_PLACES / ROUNDING * (strain @ np.abs(k) @ strain) * reach * s
        return [inertia, np.sum(D, axis=1) + 2.0 * M @ turned, stiff + D @ turned + M @ turned**2]

    def elements(self, tangent: Tangent) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """Each element: its name, strains (n, dof) over the coordinates, stiffness (n, n), gradients (n, 6) over the relative twist,
        and the natural motion (dof,) of its ends.
        """
        length = self.snapshot.system.characteristic_length
        twists = tangent.rows[: 6 * len(self.omega)].reshape(-1, 6, len(tangent.M)).copy()
        twists[:, :3] *= length
        made = strains_at(self.snapshot, tangent.q, self.without, twists.reshape(-1, len(tangent.M)), tangent.position)
        for name, bodies, own, k in zip(made.names, made.bodies, made.own, made.stiffness, strict=True):
            reach = np.zeros(len(tangent.M))
            for body in bodies[bodies >= 0]:
                reach += np.sum(np.abs(tangent.rows[6 * body : 6 * body + 6]), axis=0)
            yield name, made.rows[own], k, made.gradients[own], reach

    # --- refusal -----

    def refused(self, tried: dict[str, Any]) -> ModelError:
        model = self.snapshot.model
        parts = []
        for name, words in (
            ("fixed", "axes that stand"),
            ("rotating", "axes that turn with it"),
            ("multiblade", "multiblade coordinates"),
        ):
            if name not in tried:
                continue
            T, _, row = tried[name]
            if row < 0:
                who = self.names[-1 - row]
                parts.append(f"in {words} the force on {who!r} changes over a turn")
                continue
            culprit, how = self._culprit(T)
            parts.append(
                f"in {words} {how} {culprit!r} changes over a turn"
                if culprit
                else f"in {words} the row of {self.names[row]!r} changes over a turn"
            )
        cut = self._cut_shapes()
        if cut and "fixed" not in tried:
            parts.insert(
                0,
                f"the shapes of {cut!r} do not turn into each other about the axis (is a bending pair cut in two? take one mode more)",
            )
        if not parts:
            parts.append(f"the joints of {model.name!r} fit neither axes that stand nor axes that turn with it")
        return ModelError(
            f"no axes make the linearisation of {model.name!r} constant: {'; '.join(parts)}{self._weight()}. "
            "Make the rotor or its supports symmetric "
            "about the axis and balanced (three or more equal blades count as symmetric), let bearings hold a body that does not turn, "
            "average over the turn of three or more equal blades (average=25), or follow the motion in time (mb.simulate)"
        )

    def _cut_shapes(self) -> str:
        """The elastic body that turns and has no generator."""
        length, names = self.snapshot.system.characteristic_length, self.snapshot.tables["body_name"]
        for body, _ in modal_places(self.snapshot.tables):
            w = self.tangents[0].rotation[body].T @ self.omega[body]
            if modal_generator(_elastic(self.snapshot.model, body), w, length) is None:
                return str(names[body])
        return ""

    def _weight(self) -> str:
        model, w = self.snapshot.model, self.omega[int(np.argmax(np.linalg.norm(self.omega, axis=1)))]
        if model.gravity is None or "gravity" in self.without:
            return ""
        across = np.linalg.norm(np.cross(w, np.asarray(model.gravity, dtype=float)))
        return "; weight acts across the axis (without=('gravity',) leaves it out)" if across > 0.0 else ""

    def _culprit(self, T: Sequence[np.ndarray]) -> tuple[str, str]:
        """The element or body whose own matrix changes most, relative to itself."""
        s = self.scale
        found: list[tuple[float, str, str]] = []
        per_angle = [dict(self._parts(tangent, Tk)) for tangent, Tk in zip(self.tangents, T, strict=True)]
        for (how, name), base in per_angle[0].items():
            size = np.max(np.abs(base * s * s[:, None]), initial=0.0)
            change = max(np.max(np.abs(p[how, name] - base) * s * s[:, None], initial=0.0) for p in per_angle[1:])
            if size > 0.0:
                found.append((float(change / size), name, how))
        worst = max(found, default=(0.0, "", ""))
        return (worst[1], worst[2]) if worst[0] > VARIES else ("", "")

    def _parts(self, tangent: Tangent, T: np.ndarray) -> Iterator[tuple[tuple[str, str], np.ndarray]]:
        for name, rows, k, _, _ in self.elements(tangent):
            seen = rows @ T
            yield ("the stiffness of", name), seen.T @ k @ seen
        length = self.snapshot.system.characteristic_length
        names = self.snapshot.tables["body_name"]
        for i, mass in enumerate(mass_matrices(self.snapshot.tables, tangent.rotation)):
            rows = tangent.rows[6 * i : 6 * i + 6].copy()
            rows[:3] *= length
            seen = rows @ T
            yield ("the inertia of", names[i]), seen.T @ mass @ seen


def sampled(snapshot: Snapshot, spin: Spin, state: State, without: tuple[str, ...]) -> Turn:
    """Tangents at t = 0 and at `ANGLES` of every speed of rotation."""
    with core_errors():
        omega = snapshot.system.bodies(state.q, state.rate)["angular_velocity"]
    size = np.linalg.norm(omega, axis=1)
    speeds: list[float] = []
    for one in sorted(size[size > FITS * np.max(size, initial=0.0)], reverse=True):
        if not speeds or speeds[-1] - one > FITS * speeds[0]:
            speeds.append(float(one))
    times = [0.0] + [angle / speed for speed in speeds[:4] for angle in ANGLES]
    with core_errors():
        first = snapshot.system.linearize(
            state.q, state.rate, list(without), state.memory.tolist(), state.acceleration.tolist(), raw=True
        )
    names = tuple(first["coordinates"])
    place = {name: i for i, name in enumerate(snapshot.system.topology()["coordinates"])}
    kept = [place[name] for name in names]
    length = snapshot.system.characteristic_length
    tangents = []
    for t in times:
        step, rate = spin.later(state.rate, t)
        with core_errors():
            q = snapshot.system.advance(state.q, step[kept], [*without, *STILL_AIR]) if t else state.q
            r = snapshot.system.linearize(
                q, rate, list(without), state.memory.tolist(), spin.acceleration(rate).tolist(), raw=True
            )
            place_now = snapshot.system.bodies(q, rate)
        twists = r["T"].copy().reshape(-1, 6, len(r["coordinates"]))
        twists[:, :3] /= length
        modal = r.get("modal_map", np.zeros((0, len(r["coordinates"]))))
        rows = np.vstack([twists.reshape(-1, len(r["coordinates"])), modal / _modal_size(snapshot, length)])
        D = np.zeros_like(r["M"]) if r["D"] is None else r["D"]
        tangents.append(
            Tangent(t, r["M"], D, r["S"], r["residual"], rows, place_now["rotation"], q, place_now["position"])
        )
    scale = 1.0 / np.maximum(np.max(np.abs(tangents[0].rows), axis=0, initial=0.0), np.finfo(float).tiny)
    return Turn(snapshot, spin, state, without, names, first["force_scale"], tuple(tangents), scale, omega)


def _modal_size(snapshot: Snapshot, length: float) -> np.ndarray:
    """(n_modal, 1): the modal coordinate whose motion is that of the whole body by a characteristic length."""
    t, out = snapshot.tables, []
    for which, (body, own) in enumerate(modal_places(t)):
        mass = mass_matrix_at(t, which, np.zeros(own.stop - own.start))
        out.append(length * np.sqrt(t["x"][int(t["body_x"][body]) + BODY.block.place("mass")] / np.diag(mass)[6:]))
    return np.concatenate(out)[:, None] if out else np.ones((0, 1))


def _elastic(model: Any, body: int) -> Any:
    """The `ModalBody` of a flexible body."""
    return model.bodies[body].modal


def modal_generator(modal: Any, w: np.ndarray, length: float) -> np.ndarray | None:
    """A (m, m) with q' = A q for a shape that is at rest while its body turns with w (body axes): displacements and rotations of the
    points along it turn back, phi A = -w x phi. None where the shapes do not allow that, or the points are off the axis.
    """
    if not np.any(w):
        return np.zeros((modal.n_modes,) * 2)
    off = np.linalg.norm(np.cross(w, modal.line_position), axis=1)
    if not len(off) or np.max(off) > FITS * length * float(np.linalg.norm(w)):
        return None
    shape = modal.line_shape.reshape(-1, 2, 3, modal.n_modes) / np.array([length, 1.0])[None, :, None, None]
    turned = -np.cross(w, shape, axisa=0, axisb=2, axisc=2)
    size = float(np.linalg.norm(w)) * np.max(np.abs(shape), initial=0.0)
    return fitted(shape.reshape(-1, modal.n_modes), turned.reshape(-1, modal.n_modes), size=size)


def rotation_about(w: np.ndarray, t: float) -> np.ndarray:
    """exp(w~ t)."""
    size = float(np.linalg.norm(w))
    if size == 0.0:
        return np.eye(3)
    a = w / size
    s = skew(a)
    return np.asarray(np.eye(3) + np.sin(size * t) * s + (1.0 - np.cos(size * t)) * s @ s)


def connected(entries: Any) -> np.ndarray:
    """(dof,): the number of the part of each coordinate that entries connect."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    return np.asarray(connected_components(csr_array(entries), directed=False)[1])


def expm(x: np.ndarray) -> np.ndarray:
    from scipy.linalg import expm as exponential

    return np.asarray(exponential(x))


def fitted(a: np.ndarray, b: np.ndarray, fits: float = FITS, size: float | None = None) -> np.ndarray | None:
    """X with a X = b but for a part ``fits`` of ``size``, by default that of b, or None where there is none."""
    if not a.size:
        return np.zeros((a.shape[1], b.shape[1]))
    X = np.linalg.lstsq(a, b, rcond=None)[0]
    miss = np.max(np.abs(a @ X - b), initial=0.0)
    return X if miss <= fits * (np.max(np.abs(b), initial=0.0) if size is None else size) else None
