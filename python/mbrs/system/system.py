"""The compiled model as a user sees it: topology, loops, degrees of freedom and redundant constraints by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.border import core_errors
from .._lib.text import counted
from ..results import Result, Stats, derived
from ..system.snapshot import Snapshot
from .state import doubts_of, state_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..model.model import Model


@dataclass(frozen=True)
class Loop:
    """A closed loop: the joint where it was cut, and the bodies around it."""

    joint: str
    bodies: tuple[str, ...]
    redundant: int


@dataclass(frozen=True, eq=False, repr=False, init=False)
class System(Result):
    """Compile a model; ``print(mb.System(m))`` shows bodies, joints, loops and degrees of freedom.

    Parameters
    ----------
    model
        The model, with its present values.

    Attributes
    ----------
    dof
        Degrees of freedom at the drawn state.
    coordinates
        Names of the minimal coordinates.
    tree
        (body, inner body or "ground", joint name or None, joint type) in the order of the spanning tree.
    loops
        One `Loop` per cut joint.
    redundant
        Number of redundant constraint equations by joint; others in the loop enforce them already. The choice among
        equivalent redundant equations is arbitrary.

    n_open
        p, constraints of the open tree: 6 n_bodies (and modal coordinates) - n_tree.
    n_constraints
        q, constraints of the whole system, redundant ones too: p + n_rows; p + rank of them are independent, as many as the
        degrees of freedom leave.
    doubts
        A sentence for each constraint whose independence the drawing decides only just, with its joints.

    Raises
    ------
    AssemblyError
        Loops that cannot close, with the gap.
    SingularError
        A pose in which the mobility is not decided.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.four_bar()).dof
    1
    """

    name: str
    n_bodies: int
    n_joints: int
    n_elements: int
    coordinates: tuple[str, ...]
    n_tree: int
    n_rows: int
    rank: int
    n_open: int
    n_constraints: int
    characteristic_length: float
    tree: tuple[tuple[str, str, str | None, str], ...]
    redundant: Mapping[str, int]
    loops: tuple[Loop, ...]
    joint_types: Mapping[str, str]
    constraints: Mapping[str, str]
    doubts: tuple[str, ...]

    row: ClassVar[str] = "body"
    axes: ClassVar[Mapping[str, str]] = {"body": "bodies"}

    def __init__(self, model: Model) -> None:
        snapshot = Snapshot.of(model)
        state = state_of(model, snapshot.system, None)
        with core_errors():
            found = snapshot.system.mobility(state.q)
        doubts = doubts_of(snapshot.system)
        topology = snapshot.system.topology()
        tree = tuple((b, p or "ground", j, kind) for b, p, j, kind in topology["tree"])
        n_open = (
            6 * len(model.bodies) + sum(map(int, snapshot.tables.get("flexible_modes", ()))) - snapshot.system.n_tree
        )
        redundant: Mapping[str, int] = dict(found.get("redundant", ()))
        inner = {body: parent for body, parent, _, _ in tree}
        depth = {"ground": 0}
        for body, parent in inner.items():  # inner bodies come first
            depth[body] = depth[parent] + 1
        self.__dict__.update(
            name=model.name,
            n_bodies=len(model.bodies),
            n_joints=len(model.joints),
            n_elements=len(model.elements),
            coordinates=tuple(found["coordinates"]),
            n_tree=snapshot.system.n_tree,
            n_rows=len(topology["row_joint"]),
            rank=found.get("rank", 0),
            n_open=n_open,
            n_constraints=n_open + len(topology["row_joint"]),
            characteristic_length=snapshot.system.characteristic_length,
            tree=tree,
            redundant=redundant,
            loops=tuple(_loop(model, name, inner, depth, redundant.get(name, 0)) for name in topology["cut"]),
            joint_types={joint.name: joint.type for joint in model.joints},
            constraints={c.name: _described(c) for c in model.constraints},
            doubts=doubts,
            stats=Stats(),
            error=None,
            status="computed",
        )

    @property
    def dof(self) -> int:
        """Degrees of freedom at the drawn state."""
        return len(self.coordinates)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies in the order of the spanning tree."""
        return tuple(body for body, *_ in self.tree)

    @property
    @derived(dims=("body",), name="carried_by")
    def _carried_by(self) -> np.ndarray:
        return np.array([joint or "" for _, _, joint, _ in self.tree])

    @property
    @derived(dims=("body",), name="type")
    def _types(self) -> np.ndarray:
        return np.array([kind for *_, kind in self.tree])

    @property
    @derived(dims=("body",), name="on")
    def _inner(self) -> np.ndarray:
        return np.array([inner for _, inner, _, _ in self.tree])

    def attributes(self) -> dict[str, Any]:
        numbers = {"dof": self.dof, "rank": self.rank, "redundant": sum(self.redundant.values())}
        return {**super().attributes(), "model": self.name, **numbers}

    def heading(self) -> str:
        what = "constraints" if self.constraints else "loop constraints"
        parts = ((self.n_bodies, "body"), (self.n_joints, "joint"), (self.n_elements, "spring or damper"))
        open_dof = f"{self.n_tree} tree coordinates - {self.rank} independent {what}"
        return (
            f"system {self.name!r}: {', '.join(counted(*part) for part in parts)}\n"
            f"degrees of freedom: {self.dof}" + (f" ({open_dof})" if self.loops or self.constraints else "")
        )

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: the spanning tree."""
        rows = [[body, joint or "-", kind, inner] for body, inner, joint, kind in self.tree]
        return ["body", "carried by", "type", "on"], rows

    def notes(self) -> list[str]:
        lines = [
            f"loop closed by {loop.joint!r} ({self.joint_types[loop.joint]}): {' - '.join(loop.bodies)}"
            for loop in self.loops[:20]
        ]
        if len(self.loops) > 20:
            lines.append(f"... and {len(self.loops) - 20} more loops")
        lines += [f"constraint {name!r}: {text}" for name, text in list(self.constraints.items())[:20]]
        if len(self.constraints) > 20:
            lines.append(f"... and {len(self.constraints) - 20} more constraints")
        if self.redundant:
            some = [f"{n} at {joint!r}" for joint, n in self.redundant.items()][:20]
            more = len(self.redundant) - len(some)
            named = ", ".join([*some, f"... at {more} more joints"] if more else some)
            total = sum(self.redundant.values())
            lines.append(
                f"redundant constraints: {total} of {self.n_rows} ({named}); reactions there are the minimum-norm ones"
            )
        elif self.loops or self.constraints:
            lines.append("redundant constraints: none")
        lines.extend(f"doubtful: {sentence}" for sentence in self.doubts)
        size = self.n_open + self.n_tree
        lines.append(
            f"coordinates {size}, constraints p = {self.n_open} of the open tree, q = {self.n_constraints} of all; "
            f"loops solve for {size} - p - m = {self.rank}"
        )
        named = ", ".join(self.coordinates[:12]) + (", ..." if self.dof > 12 else "")
        return [*lines, "minimal coordinates: " + named]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """The spanning tree, bodies by their distance from ground, joints that close loops dashed; returns the figure."""
        from ..plot.models import system as draw

        return draw(self, ax=ax)


def _described(constraint: Any) -> str:
    """Rows, level and motions of a constraint that is a function."""
    rows, level = constraint.n_rows, "velocities" if constraint.of_velocities else "positions"
    return f"{rows} row{'s' * (rows > 1)} of {level} on {', '.join(constraint.described()['motions'])}"


def _loop(model: Any, name: str, inner: Mapping[str, str], depth: Mapping[str, int], redundant: int) -> Loop:
    """A cut joint with the bodies around its loop: both sides climb until they meet. O(length of the loop)."""
    joint = model[name]
    a, b = model.body_name(joint.a), model.body_name(joint.b)
    up, down = [a], [b]
    while up[-1] != down[-1]:
        side = up if depth[up[-1]] >= depth[down[-1]] else down
        side.append(inner[side[-1]])
    return Loop(name, (*up, *reversed(down[:-1])), redundant)
