"""Quantities of a motion at one instant, addressed by name: the state objects that objectives see."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .._lib.checks import real_array
from ..errors import ModelError, NameNotFoundError
from ..model.names import index, nearest, shown
from ..model.schema import JOINTS

# What the core is asked for: kind, index of body or joint, order, start of a drawn point in x, a drawn point.
QuantityKey = tuple[str, int, int, int | None, tuple[float, float, float] | None]

_KINDS = {k.code: k for k in JOINTS.values()}
_FREE = {code: len(k.free) for code, k in _KINDS.items()}
# Name in an address: what it asks of a body, and of a marker.
_BODY = {"position": 0, "velocity": 1, "acceleration": 2}
_TURNING = {"angular_velocity": 1, "angular_acceleration": 2}
_MODAL = {"modal": 0, "modal_rate": 1, "modal_acceleration": 2}
ADDRESSES = (*_BODY, "rotation", *_TURNING, "coordinate", "reaction", *_MODAL)


def _name(handle: Any) -> str:
    name = getattr(handle, "name", handle)
    if not isinstance(name, str):
        raise ModelError(f"expected a name or a handle, got {shown(handle)}")
    return name


class Names:
    """Names of a model's tables as indices."""

    def __init__(self, tables: Mapping[str, Any]) -> None:
        self.tables = tables
        self.bodies: list[str] = list(tables["body_name"])
        self.joints: list[str] = list(tables["joint_name"])
        self.markers: list[str] = list(tables["marker_name"])
        # of each flexible body: how many modal coordinates
        counts = zip(tables.get("flexible_body", ()), tables.get("flexible_modes", ()), strict=True)
        self.flexible = {int(body): int(m) for body, m in counts}

    def body(self, handle: Any) -> int:
        """Index of a body."""
        return index("no body", _name(handle), self.bodies)

    def joint(self, handle: Any) -> int:
        """Index of a joint."""
        return index("no joint", _name(handle), self.joints)

    def point(self, marker: Any, of: Any, order: int) -> QuantityKey:
        """A marker, or a drawn world point fixed in a body."""
        if of is None:
            i = index("no marker", _name(marker), self.markers)
            return ("point", int(self.tables["marker_body"][i]), order, int(self.tables["marker_x"][i]), None)
        drawn = real_array("a point fixed in a body", marker, (3,), "give three coordinates in m")
        x, y, z = (float(v) for v in drawn)
        return ("point", self.body(of), order, None, (x, y, z))

    def free(self, joint: int) -> int:
        """Number of free coordinates of a joint."""
        return _FREE[int(self.tables["joint_type"][joint])]

    def modal(self, body: Any, order: int) -> QuantityKey:
        """The modal coordinates of a flexible body."""
        i = self.body(body)
        if i not in self.flexible:
            raise ModelError(f"{self.bodies[i]!r} has no modal coordinates: it is rigid")
        return ("modal", i, order, None, None)

    def address(self, what: str) -> QuantityKey:
        """ "crank.position", "P2" (a marker), "P2.velocity", "A" (the coordinates of a joint), "A.reaction", "blade.modal"."""
        if not isinstance(what, str):
            raise ModelError(f"a quantity is named like 'crank.position', 'P2' or 'A.reaction', got {shown(what)}")
        name, dot, kind = what.rpartition(".")
        if not dot:
            name, kind = what, ""
        if not dot:
            kind = "position" if name in self.markers else "coordinate"
        if kind in _BODY:
            if name in self.markers:
                return self.point(name, None, _BODY[kind])
            return ("point", self._either(name), _BODY[kind], None, None)
        if kind in _TURNING:
            return ("turning", self.body(name), _TURNING[kind], None, None)
        if kind == "rotation":
            return ("rotation", self.body(name), 0, None, None)
        if kind in _MODAL:
            return self.modal(name, _MODAL[kind])
        if kind == "coordinate":
            return ("joint", index("no joint or marker", name, [*self.joints, *self.markers]), 0, None, None)
        if kind == "reaction":
            return ("reaction", self.joint(name), 0, None, None)
        guess = nearest(kind, ADDRESSES)
        raise NameNotFoundError(
            f"{what!r}: nothing is called {kind!r}"
            + (f"; did you mean {guess!r}?" if guess else "")
            + f"; known: {', '.join(ADDRESSES)}"
        )

    def _either(self, name: str) -> int:
        return index("no body or marker", name, [*self.bodies, *self.markers])

    def unit(self, asked: QuantityKey) -> str:
        """Unit of its numbers; empty where they differ."""
        kind, index, order = asked[:3]
        if kind == "joint":
            kinds = set(_KINDS[int(self.tables["joint_type"][index])].free)
            return {"t": "m", "r": "rad"}[kinds.pop()] if len(kinds) == 1 else ""
        if kind in ("reaction", "modal"):
            return ""
        return ("m" if kind == "point" else "rad") + ("", "/s", "/s^2")[order]

    def components(self, asked: QuantityKey) -> list[str]:
        """Names of its numbers: x y z and rx ry rz, those of a joint by its free coordinates."""
        if asked[0] == "joint":
            return list(_KINDS[int(self.tables["joint_type"][asked[1]])].coordinates)
        if asked[0] == "modal":
            return [f"q{k + 1}" for k in range(self.width(asked))]
        return ["x", "y", "z", "rx", "ry", "rz"][: 3 if asked[0] in ("point", "turning", "rotation") else 6]

    def width(self, asked: QuantityKey) -> int:
        """Number of numbers that the core returns for it."""
        if asked[0] == "modal":
            return self.flexible[asked[1]]
        return {"point": 3, "turning": 3, "rotation": 9, "reaction": 6}.get(asked[0], 0) or self.free(asked[1])


class Instant:
    """One instant of a motion, as objectives see it; what they do not read is not computed.

    Attributes
    ----------
    t, index
        s; place among the instants that the objective is evaluated at.
    """

    def __init__(
        self, names: Names, t: float, index: int, read: Callable[[QuantityKey], np.ndarray], value: Callable[[str], Any]
    ) -> None:
        self.t, self.index = t, index
        self._names, self._read, self._value = names, read, value

    def position(self, body: Any) -> np.ndarray:
        """(3,) world position of a body's origin, m."""
        return self._read(("point", self._names.body(body), 0, None, None))

    def velocity(self, body: Any) -> np.ndarray:
        """(3,) world velocity of a body's origin, m/s."""
        return self._read(("point", self._names.body(body), 1, None, None))

    def acceleration(self, body: Any) -> np.ndarray:
        """(3,) world acceleration of a body's origin, m/s^2."""
        return self._read(("point", self._names.body(body), 2, None, None))

    def rotation(self, body: Any) -> np.ndarray:
        """(3, 3) rotation matrix of a body, body to world."""
        return self._read(("rotation", self._names.body(body), 0, None, None)).reshape(3, 3)

    def angular_velocity(self, body: Any) -> np.ndarray:
        """(3,) world, rad/s."""
        return self._read(("turning", self._names.body(body), 1, None, None))

    def angular_acceleration(self, body: Any) -> np.ndarray:
        """(3,) world, rad/s^2."""
        return self._read(("turning", self._names.body(body), 2, None, None))

    def point(self, marker: Any, *, of: Any = None) -> np.ndarray:
        """(3,) world position of a marker, or of a drawn world point fixed in body ``of``."""
        return self._read(self._names.point(marker, of, 0))

    def point_velocity(self, marker: Any, *, of: Any = None) -> np.ndarray:
        """(3,) its velocity."""
        return self._read(self._names.point(marker, of, 1))

    def point_acceleration(self, marker: Any, *, of: Any = None) -> np.ndarray:
        """(3,) its acceleration."""
        return self._read(self._names.point(marker, of, 2))

    def joint(self, name: Any) -> Any:
        """Free coordinates of a joint: a number where it has one, else an array; angles within half a turn."""
        found = self._read(("joint", self._names.joint(name), 0, None, None))
        return found[0] if len(found) == 1 else found

    def reaction(self, name: Any) -> np.ndarray:
        """(6,) wrench of a joint on its second body at the joint's point, world axes, N and N m."""
        return self._read(("reaction", self._names.joint(name), 0, None, None))

    def modal(self, body: Any) -> np.ndarray:
        """(m,) modal coordinates of a flexible body."""
        return self._read(self._names.modal(body, 0))

    def modal_rate(self, body: Any) -> np.ndarray:
        """(m,) their rates."""
        return self._read(self._names.modal(body, 1))

    def modal_acceleration(self, body: Any) -> np.ndarray:
        """(m,) their accelerations."""
        return self._read(self._names.modal(body, 2))

    def value(self, address: str) -> Any:
        """A number of the model, for objectives that depend on the parameters themselves."""
        return self._value(address)
