"""The same model in the core and in the NumPy reference: states carried from one to the other, differences measured."""

from __future__ import annotations

import mbrs as mb
import numpy as np
from mbrs import reference as ref
from mbrs.linear.linearize import linearize
from mbrs.model.tables import modal_part, tables
from mbrs.reference.assembly import close_loops, jacobian, partition, twist_map
from mbrs.reference.kinematics import motion, place_outer, relative_pose, split
from mbrs.system.compiled import compiled
from mbrs.system.snapshot import Snapshot
from mbrs.system.state import AT_REST, State, state_of


def drawn(m):
    """The core's drawn state."""
    return state_of(m, compiled(m), None)


def reference_state(m, state, sys=None):
    """The core's state in the reference: poses and velocities of the centres of mass, modal coordinates as places of carriers."""
    sys = ref.System(tables(m)) if sys is None else sys
    b = compiled(m).bodies(state.q, state.rate)
    arm = np.einsum("nij,nj->ni", b["rotation"], [body.com for body in sys.bodies[: len(b["rotation"])]])
    r, v = b["position"] + arm, b["velocity"] + np.cross(b["angular_velocity"], arm)
    q, rate = (
        in_threes(sys, modal_part(tables(m), x)) for x in (state.q, state.rate if len(state.rate) else 0 * state.q)
    )
    still, ones = np.zeros(q.shape), np.broadcast_to(np.eye(3), (len(q), 3, 3))
    parts = ((r, q), (b["rotation"], ones), (v, rate), (b["angular_velocity"], still))
    return ref.State(*(np.concatenate(part) for part in parts))


def in_threes(sys, modal):
    """(carriers, 3) modal coordinates of all flexible bodies as the places of their carriers."""
    cuts = np.cumsum([f.m for f in sys.flexible])[:-1]
    own = [np.pad(q, (0, -len(q) % 3)).reshape(-1, 3) for q in np.split(modal, cuts)] if sys.flexible else []
    return np.concatenate([np.zeros((0, 3)), *own])


def advanced(m, rng, size):
    """A core state away from the drawn one, loops closed."""
    start = drawn(m)
    n = len(compiled(m).linearize(start.q, AT_REST, [])["coordinates"])
    return State(compiled(m).advance(start.q, size * rng.normal(size=n)), AT_REST)


def spinning(m, state, rng, size):
    """Rates that the cut joints allow, at a core state."""
    sys = ref.System(tables(m))
    J = jacobian(sys, reference_state(m, state, sys))
    rate = size * rng.normal(size=sys.ny)
    if J.size:
        for _ in range(2):
            rate = rate - np.linalg.lstsq(J, J @ rate, rcond=1e-10)[0]
    return State(state.q, rate)


def relative_difference(a, b, scale=None):
    """max |a - b| over the size of b (or of what b is a part of)."""
    size = np.max(np.abs(b if scale is None else scale), initial=0.0)
    worst = float(np.max(np.abs(a - b), initial=0.0))
    return worst / size if size > 0 else worst


def difference(m, state, without=()):
    """Relative differences of M, D, S, T, the residual and the split parts between core and reference at a core state."""
    sys = ref.System(tables(m))
    lin = linearize(m, at=state, without=without)
    raw = Snapshot.of(m).system.linearize(state.q, state.rate, list(without), raw=True)
    keep = [sys.coordinates.index(name) for name in lin.coordinates]
    other = ref.linearize(sys, reference_state(m, state, sys), keep, without)
    zero = np.zeros_like(lin.M)
    # without any force the residual is the rounding of strains times stiffness
    forces = max(raw["force_scale"], np.max(np.abs(other.S), initial=1e-300))
    out = {
        "M": relative_difference(raw["M"], other.M),
        "D": relative_difference(zero if raw["D"] is None else raw["D"], other.D),
        "S": relative_difference(raw["S"], other.S),
        "T": relative_difference(raw["T"], other.T[: len(raw["T"])]),
        "residual": float(np.max(np.abs(raw["residual"] - other.residual), initial=0.0)) / forces,
        "C": relative_difference(zero if lin.C is None else lin.C, other.C, other.D),
        "G": relative_difference(zero if lin.G is None else lin.G, other.G, other.D),
        "K": relative_difference(lin.K, other.K, other.S),
    }
    if lin.N is not None:
        out["N"] = relative_difference(lin.N, other.N, other.S)
    return out


def worst_of(differences):
    """The largest of each matrix over many comparisons."""
    out: dict[str, float] = {}
    for one in differences:
        for key, value in one.items():
            out[key] = max(out.get(key, 0.0), value)
    return out


def show(title, numbers):
    """Print measured errors: tests say how good they were, not only that they passed."""
    print(f"{title}: " + ", ".join(f"{k} {v:.1e}" for k, v in numbers.items()))


def held(m, state, keep=None):
    """For the reference's derivatives: the state that a core state becomes when numbers change and the configuration is held.

    Relative poses of the tree joints stay, but for the drawn offsets of two-point joints, which follow the drawing; loops are
    closed by the smallest change. Of a moving state the rates of the coordinates in ``keep`` stay, and loops decide the others.
    """
    real = ref.System(tables(m))
    base = reference_state(m, state, real)
    before = [relative_pose(t, *drawn_pose(real)) for t in real.tree]
    now = [relative_pose(t, base.r, base.R) for t in real.tree]

    def state_of(sys):
        r, R = np.zeros((sys.nb, 3), sys.x.dtype), np.zeros((sys.nb, 3, 3), sys.x.dtype)
        for t, (u0, _), (u, turn) in zip(sys.tree, before, now, strict=True):
            moved = relative_pose(t, *drawn_pose(sys))[0] - u0
            place_outer(t, r, R, u + np.where(np.isin(np.arange(3), t.translations), moved, 0.0), turn)
        zero = np.zeros((sys.nb, 3))
        still = close_loops(sys, ref.State(r, R, zero, zero))
        if not state.moving:
            return still
        twists = twist_map(sys, motion(still), partition(sys, still, keep)).value
        v, w = split(twists @ state.rate[keep])
        return ref.State(still.r, still.R, v, w)

    return state_of


def drawn_pose(sys):
    """Centres of mass and rotations as drawn."""
    return np.array([b.centre for b in sys.bodies]), np.array([b.R for b in sys.bodies])


def all_addresses(m):
    """Every address of a model, one for each field of each object, and the parameters."""
    out = [f"{item.name}.{name}" for item in m.items.values() for name in item.fields()]
    return out + list(m.parameters) + (["gravity"] if m.gravity is not None else [])


# results that `mb.compare` takes, of a model with a body to push and a marker "tip"
ANALYSES = {
    "linearize": lambda m, pushed: mb.linearize(m, at=mb.equilibrium(m)),
    "modes": lambda m, pushed: mb.modes(m, at=mb.equilibrium(m)),
    "equilibrium": lambda m, pushed: mb.equilibrium(m),
    "frf": lambda m, pushed: mb.frf(
        m, f"{pushed}.force.x", "tip.motion.y", frequency=np.linspace(0.1, 3.0, 7), at=mb.equilibrium(m)
    ),
    "simulate": lambda m, pushed: mb.simulate(m, t=0.7, rtol=1e-9),
}
