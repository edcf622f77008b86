"""The compiled model as a user sees it: topology, loops, degrees of freedom and redundant constraints by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ._border import core_errors
from .linearize import Snapshot
from .state import doubt, state_of

if TYPE_CHECKING:
    from .model.model import Model


@dataclass(frozen=True)
class Loop:
    """A closed loop: the joint where it was cut, and the bodies around it."""

    joint: str
    bodies: tuple[str, ...]
    redundant: int


class System:
    """Compile a model and say what it is made of; ``print(mb.System(m))``.

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
        Number of superfluous constraint equations by joint; others in the loop enforce them already. Which of a set of
        equivalent equations is called superfluous is a matter of choice.

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

    def __init__(self, model: Model) -> None:
        snapshot = Snapshot.of(model)
        state = state_of(model, snapshot.system, None)
        with core_errors():
            found = snapshot.system.mobility(state.relative)
            self.doubts = tuple(doubt(*d) for d in snapshot.system.doubts())
        topology = snapshot.system.topology()
        self.name = model.name
        self.n_bodies = len(model.bodies)
        self.n_joints = len(model.joints)
        self.n_elements = len(model.elements)
        self.coordinates = tuple(found["coordinates"])
        self.dof = len(self.coordinates)
        self.n_tree = snapshot.system.n_tree
        self.n_rows = len(topology["row_joint"])
        self.rank = found.get("rank", 0)
        self.characteristic_length: float = snapshot.system.characteristic_length
        self.tree = tuple((b, p or "ground", j, kind) for b, p, j, kind in topology["tree"])
        self.redundant: Mapping[str, int] = dict(found.get("redundant", ()))
        self.loops = tuple(self._loop(model, name) for name in topology["cut"])
        self.joint_types = {joint.name: joint.type for joint in model.joints}

    def _loop(self, model: Any, name: str) -> Loop:
        joint = model[name]
        inner = {body: parent for body, parent, _, _ in self.tree}
        a, b = self._to_ground(inner, model.body_name(joint.a)), self._to_ground(inner, model.body_name(joint.b))
        shared = next(body for body in a if body in b)
        around = (*a[: a.index(shared)], shared, *reversed(b[: b.index(shared)]))
        return Loop(name, around, self.redundant.get(name, 0))

    @staticmethod
    def _to_ground(inner: Mapping[str, str], body: str) -> list[str]:
        path = [body]
        while path[-1] != "ground":
            path.append(inner[path[-1]])
        return path

    def __str__(self) -> str:
        from .report import table

        open_dof = f"{self.n_tree} tree coordinates - {self.rank} independent loop constraints"
        lines = [
            f"system {self.name!r}: {self.n_bodies} bodies, {self.n_joints} joints, {self.n_elements} elements",
            f"degrees of freedom: {self.dof}" + (f" ({open_dof})" if self.loops else ""),
        ]
        rows = [(body, joint or "-", kind, parent) for body, parent, joint, kind in self.tree[:30]]
        lines.append(table(["body", "carried by", "type", "on"], rows))
        if len(self.tree) > 30:
            lines.append(f"... and {len(self.tree) - 30} more bodies")
        for loop in self.loops[:20]:
            lines.append(f"loop closed by {loop.joint!r} ({self.joint_types[loop.joint]}): {' - '.join(loop.bodies)}")
        if len(self.loops) > 20:
            lines.append(f"... and {len(self.loops) - 20} more loops")
        if self.redundant:
            named = ", ".join(f"{n} at {joint!r}" for joint, n in self.redundant.items())
            total = sum(self.redundant.values())
            lines.append(
                f"redundant constraints: {total} of {self.n_rows} ({named}); reactions there are the minimum-norm ones"
            )
        elif self.loops:
            lines.append("redundant constraints: none")
        lines.extend(f"doubtful: {sentence}" for sentence in dict.fromkeys(self.doubts))
        lines.append("minimal coordinates: " + ", ".join(self.coordinates[:12]) + (", ..." if self.dof > 12 else ""))
        return "\n".join(lines)

    __repr__ = __str__
