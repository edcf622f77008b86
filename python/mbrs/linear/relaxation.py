"""States of laws and of the air in linear analyses: what answers small motions y with a time of its own.

    M y" + D y' + S y = E z + f,   z' = P y + R y' + A z

`mb.Maxwell` on a direction w: z is the extension of each spring, E = -w k, R = w^T, A = -rate; M, D, S are those of the linearisation,
in which its extension is zero. States of the air come to rest in a linearisation, so that D and S at held states are
D - E A^-1 R and S - E A^-1 P. With p' = z as one more rate this is a second-order system with a regular mass matrix,

    [M 0; 0 w] [y"; p"] + [D  -E; -w R  -w A] [y'; p'] + [S 0; -w P 0] [y; p] = [f; 0],

in which p itself acts on nothing: one root zero for each state, which belongs to no motion. In the axes of a steady motion,
y = exp(W t) y_f and z = exp(V t) z_f, P + R W and A - V stand for P and A.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.rotations import twist_at
from ..errors import ModelError
from ..model.schema import LAW_OF_CODE
from ..model.tables import tables
from .air_states import STANDING, air_matrices, blade_generator, has_air_states
from .spin import spin_of
from .turning_frames import ANGLES, STILL_AIR, expm

# Directions of laws that turn into each other but for this part of their size do. Larger: laws of unequal blades are taken together.
# Smaller: drawn digits part equal ones. Pinned by tests/linear/test_states_in_turning_axes.py.
_TURNS = 1e-6
# Numbers of equal laws differ by this part at most. Larger: unequal dampers count as equal, and their roots are off by as much.
# Smaller: equal dampers of a model that was computed differ by rounding. Pinned by tests/linear/test_states_in_turning_axes.py.
_EQUAL = 1e-9


@dataclass(frozen=True)
class LawPlace:
    """A law at a state: its place in the Tables, its direction (dof,), displacement and rate, the places of its sliders (empty:
    centred), and the object it is on."""

    index: int
    code: int
    numbers: np.ndarray
    direction: np.ndarray
    u: float
    v: float
    memory: np.ndarray
    name: str


@dataclass(frozen=True, eq=False)
class States:
    """E ``effect`` (dof, m), P ``by_place`` and R ``by_rate`` (m, dof), A ``own`` (m, m), the ``weight`` w (m,) of their rows, and the
    objects that they are on. ``damping``, ``stiffness`` (dof, dof): what D and S of the linearisation lack, None of nothing.
    """

    effect: np.ndarray
    by_place: np.ndarray
    by_rate: np.ndarray
    own: np.ndarray
    weight: np.ndarray
    names: tuple[str, ...]
    damping: np.ndarray | None = None
    stiffness: np.ndarray | None = None

    def held(self, D: np.ndarray | None, S: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
        """Damping and gyroscopic, and stiffness matrix at held states."""
        return _total(D, self.damping), S if self.stiffness is None else S + self.stiffness

    def held_system(self, M: np.ndarray, D: np.ndarray | None, S: np.ndarray) -> _core.SecondOrder:
        """The system at held states."""
        damping, stiffness = self.held(D, S)
        C, G = (None, None) if damping is None else _parts(damping)
        with core_errors():
            return _core.SecondOrder(M, C, G, *_parts(stiffness))


def _joined(parts: list[States]) -> States | None:
    """The states of several parts, one after the other."""
    if len(parts) < 2:
        return parts[0] if parts else None
    a, b = parts
    corner = np.zeros((len(a.own), len(b.own)))
    return States(
        np.hstack([a.effect, b.effect]),
        np.vstack([a.by_place, b.by_place]),
        np.vstack([a.by_rate, b.by_rate]),
        np.block([[a.own, corner], [corner.T, b.own]]),
        np.concatenate([a.weight, b.weight]),
        (*a.names, *b.names),
        _total(a.damping, b.damping),
        _total(a.stiffness, b.stiffness),
    )


def law_places(lin: Any) -> Iterator[LawPlace]:
    """Every law that acts in a linearisation."""
    t = tables(lin.model)
    places = lin.snapshot.system.law_places(lin.state.q, lin.state.rate)
    for start, a, b, point, gradient, u, v, first in places:
        i = int(np.flatnonzero(t["law_x"] == start)[0])
        code, n = int(t["law_type"][i]), int(t["law_n"][i])
        if LAW_OF_CODE[code].effect in lin.without:
            continue
        kind = "joint" if t["law_owner_kind"][i] else "element"
        name = t[f"{kind}_name"][int(t["law_owner"][i])]
        w = gradient @ (_twist(lin, b, point) - _twist(lin, a, point))
        # two numbers for each slider
        memory = lin.state.memory[first : first + n // 2] if LAW_OF_CODE[code].state == "map" else lin.state.memory[:0]
        yield LawPlace(i, code, t["x"][start : start + n], w, u, v, memory, f"{kind} {name!r}")


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


def states_of(system: Any) -> States | None:
    """The states of a linearisation that answer with a time of their own, or None: matrices of a user have none."""
    if not hasattr(system, "snapshot"):
        return None
    return _joined([part for part in (_of_laws(system), _of_air(system)) if part is not None])


def _of_laws(system: Any) -> States | None:
    if not any(LAW_OF_CODE[int(code)].state == "rate" for code in system.snapshot.tables["law_type"]):
        return None
    places = list(law_places(system))
    relaxing = [
        (i, *pair)
        for i, place in enumerate(places)
        for pair in _core.law_relaxations(place.code, [float(x) for x in place.numbers], place.u)
    ]
    if not relaxing:
        return None
    law, k, rate = (np.array(column) for column in zip(*relaxing, strict=True))
    law = law.astype(int)
    w = np.array([places[i].direction for i in law])
    turn = system.state.turn
    V = np.zeros((len(w),) * 2) if turn is None else _law_generator(system, places, law, turn)
    by_place = 0.0 * w if turn is None else w @ turn
    names = tuple(f"the law on {places[i].name}" for i in law)
    return States(-w.T * k, by_place, w, -np.diag(rate) - V, k, names)


def _law_generator(system: Any, places: list[LawPlace], law: np.ndarray, W: np.ndarray) -> np.ndarray:
    """V of the states of laws, of which equal ones may turn into each other: w(t) exp(W t) = exp(V t) w(0)."""
    from scipy.linalg import logm

    t, later = _later(system)
    turned = np.array([place.direction for place in law_places(later)]) @ expm(W * t)
    now = np.array([place.direction for place in places])
    V = np.zeros((len(law),) * 2)
    for alike in _equal_laws(places, law):
        back = np.linalg.pinv(now[alike], rcond=_TURNS)
        U = turned[alike] @ back + np.eye(len(alike)) - now[alike] @ back
        if np.max(np.abs(U @ now[alike] - turned[alike])) > _TURNS * np.max(np.abs(now[alike])):
            raise ModelError(
                f"the state of the law on {places[alike[0]].name} is constant in no axes of this steady motion: it turns, and no "
                "equal laws of equal blades turn with it; follow the motion in time (mb.simulate)"
            )
        made = logm(U).real / t
        if np.max(np.abs(made)) * t <= _TURNS:
            continue
        branches = [np.flatnonzero(law == i) for i in alike]
        for own in np.array(branches).T:
            V[np.ix_(own, own)] = made
    return V


def _equal_laws(places: list[LawPlace], law: np.ndarray) -> list[list[int]]:
    """The laws with states in groups of one type whose numbers are the same but for rounding."""
    groups: list[list[int]] = []
    for i in dict.fromkeys(law.tolist()):
        for group in groups:
            one, other = places[group[0]], places[i]
            same_type = one.code == other.code and len(one.numbers) == len(other.numbers)
            if same_type and np.allclose(one.numbers, other.numbers, rtol=_EQUAL, atol=0.0):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def _later(system: Any) -> tuple[float, Any]:
    """A short time (s) on in a steady motion: when, and the linearisation with its directions there."""
    state, snapshot = system.state, system.snapshot
    spin = spin_of(snapshot, state.q, state.rate, state.driven, system.without)
    with core_errors():
        fastest = np.max(np.linalg.norm(snapshot.system.bodies(state.q, state.rate)["angular_velocity"], axis=1))
    t = ANGLES[0] / float(fastest)
    step, rate = spin.later(state.rate, t)
    with core_errors():
        q = snapshot.system.advance(state.q, step, [*system.without, "drives", *STILL_AIR])
        found = snapshot.system.linearize(
            q, rate, list(system.without), state.memory.tolist(), spin.acceleration(rate).tolist(), raw=True
        )
    moved = replace(state, q=q, rate=rate, t=state.t)
    return t, system.replaced(T=found["T"], state=moved)


def _of_air(system: Any) -> States | None:
    airs = system.model.airs
    if system.n == 0 or not has_air_states(system.model, system.without):
        return None
    if system.over_turn is not None:
        lags = system.over_turn.lags
        E, P, R, A = lags.mean
        V, names = lags.turning, lags.names
        A = A + V
    else:
        state = system.state
        found = air_matrices(system.snapshot, state, system.without, turn=state.turn)
        if not found:
            return None
        E, P, R, A = (np.asarray(found[key]) for key in ("effect", "by_place", "by_rate", "own"))
        names = tuple(f"the air {airs[int(i)].name!r}" for i in found["air"])
        standing = state.frame in STANDING
        V = blade_generator(system.snapshot, state, found["section"]) if standing else np.zeros_like(A)
    if np.any(np.diag(A) >= 0.0):
        raise ModelError(
            f"{names[int(np.argmax(np.diag(A)))]} does not flow at a section, so that its states have no time in which they come to rest; "
            "give it wind, or leave out its laws with states"
        )
    answer = np.linalg.solve(A, np.hstack([R, P]))
    n = len(E)
    # such a state moves as much as the coordinates that drive it do
    weight = np.full(len(A), float(np.trace(np.asarray(system.M))) / n)
    return States(E, P, R, A - V, weight, names, -E @ answer[:, :n], -E @ answer[:, n:])


def _twist(lin: Any, body: int, point: np.ndarray) -> np.ndarray:
    if body < 0:
        return np.zeros((6, lin.n))
    return twist_at(lin.T[6 * body : 6 * body + 6], point - lin.poses["position"][body])


def extended(system: Any, states: States) -> _core.SecondOrder:
    """The system of the coordinates and of the integrals p of the states."""
    n, m = states.effect.shape
    damping, stiffness = states.held(_total(system.C, system.G), np.asarray(_total(system.K, system.N)))
    zero, w = np.zeros((n, m)), states.weight[:, None]
    D = np.block(
        [[np.zeros((n, n)) if damping is None else damping, -states.effect], [-w * states.by_rate, -w * states.own]]
    )
    S = np.block([[stiffness, zero], [-w * states.by_place, np.zeros((m, m))]])
    still = not np.any(states.by_place) and np.array_equal(states.own, states.own.T)
    if states.stiffness is None and still:
        C, K = np.zeros_like(D), np.block([[system.K, zero], [zero.T, np.zeros((m, m))]])
        C[:n, :n] = 0.0 if system.C is None else system.C
        C[n:, n:] = D[n:, n:]
    else:
        C, K = 0.5 * (D + D.T), 0.5 * (S + S.T)
    M = np.block([[system.M, zero], [zero.T, np.diag(states.weight)]])
    with core_errors():
        return _core.SecondOrder(M, C, D - C, K, S - K)


def relaxing_modes(core: _core.SecondOrder, states: States) -> dict[str, Any]:
    """Modes of the extended system, without the roots that belong to no motion."""
    n, m = states.effect.shape
    M, D, S = core.M, _total(core.C, core.G), _total(core.K, core.N)
    r = dict(core.modes())
    size = np.linalg.norm(r["shape"], axis=0)
    alone = np.linalg.norm(r["shape"][:n], axis=0) <= np.sqrt(np.finfo(float).eps) * size
    own = np.flatnonzero((np.array(r["kind"]) == "rigid") & alone)
    column = {int(i): c for c, i in enumerate(r["partner_mode"])}
    # states that turn together have pairs of roots; two roots zero then make one mode of none
    surplus = own[np.argsort(np.abs(np.asarray(r["partner"])[own]))][: max(0, m - len(own))]
    own = np.setdiff1d(own, surplus)
    kind = np.array(r["kind"], dtype="U10")
    for i in own:
        c = column[int(i)]
        s, shape, left = complex(r["partner"][i]), r["partner_shape"][:, c], r["partner_left"][:, c]
        r["eigenvalue"][i], r["partner"][i], kind[i] = s, np.nan, "relaxation"
        r["shape"][:, i], r["left"][:, i] = shape, left
        r["backward_error"][i], r["condition"][i] = _accuracy(s, shape, left, M, D, S)
        r["error"][i] = r["condition"][i] * max(r["backward_error"][i], np.finfo(float).eps)
    order = np.argsort(np.abs(r["eigenvalue"]), kind="stable")
    order = order[~np.isin(order, surplus)]
    place = np.full(len(kind), -1)
    place[order] = np.arange(len(order))
    for key in ("eigenvalue", "partner", "backward_error", "condition", "error", "near_defective"):
        r[key] = np.asarray(r[key])[order]
    r["kind"] = kind[order].tolist()
    r["shape"], r["left"] = r["shape"][:n, order], r["left"][:n, order]
    gone = np.concatenate([own, surplus])
    others = [c for c, i in enumerate(r["partner_mode"]) if i not in gone]
    r["partner_mode"] = place[np.asarray(r["partner_mode"], dtype=int)[others]]
    r["partner_shape"], r["partner_left"] = r["partner_shape"][:n, others], r["partner_left"][:n, others]
    members = [[int(place[i]) for i in range(a, a + count) if i not in gone] for a, count in r["groups"]]
    r["groups"] = [(min(g), len(g)) for g in members if len(g) > 1 and max(g) - min(g) == len(g) - 1]
    return r


def _parts(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The symmetric and the skew part."""
    return 0.5 * (a + a.T), 0.5 * (a - a.T)


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
