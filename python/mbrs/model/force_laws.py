"""Forces given as functions of several motions of a body: the name by which a film, a seal or a magnet enters a model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np

from .._lib.checks import members
from .aliases import Laws
from .book import Book
from .forces import Element, bushing
from .function_law import FunctionLaw
from .names import problem, shown
from .ports import Port, as_port
from .schema import SIX


def force_law(self: Book, name: str, law: Laws, motions: Sequence[Port | str]) -> Element:
    """A force on a body as a function of its motions: Q = F(t, u, v), u the displacements from the drawn place, v their rates.

    The element is a bushing between ground and the body at the point of the motions, along the axes of the world, whose law is -F:
    here a function is the force itself, as ``law=`` it would be the resistance.

    Parameters
    ----------
    name
        Unique in the model.
    law
        A function F(t, u, v) or `mb.FunctionLaw`, which returns as many numbers as there are motions (N, N m).
    motions
        Up to six motions of one body or marker along the axes of the world, such as ["shaft.motion.y", "shaft.motion.rz"]: m, or a
        component of the rotation vector in rad.

    Returns
    -------
    Element
        A bushing, as which it is saved.

    Raises
    ------
    ModelError
        Motions of several points or along other directions, a function that cannot be traced.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("shaft in a film"); s = m.body("shaft", mass=1.0, inertia=(1, 1, 1))
    >>> m.force_law("film", mb.FunctionLaw(lambda t, u, v: -(1.0 + u @ u) * u), ["shaft.motion.y", "shaft.motion.z"]).name
    'film'
    """
    wanted = members(motions)
    if not 1 <= len(wanted) <= len(SIX):
        raise problem(f"{name}.motions", f"must be a list of one to six motions of a body, got {shown(motions)}")
    ports = [as_port(self, motion) for motion in wanted]
    first = ports[0]
    names = tuple(_axis(name, port) for port in ports)
    if any((p.body, p.marker, p.point) != (first.body, first.marker, first.point) for p in ports):
        raise problem(
            f"{name}.motions",
            "are motions of several points; give each pair of bodies a bushing or a joint of its own, with law=",
        )
    if len(set(names)) < len(names):
        raise problem(f"{name}.motions", f"names a motion twice: {', '.join(names)}")
    made = law if isinstance(law, FunctionLaw) else FunctionLaw(cast("Callable[..., Any]", law))
    owner: Any = self[first.marker or first.body]  # type: ignore[index]
    at = owner.entries("at") if first.point is None else first.point
    return bushing(self, name, "ground", first.body, at=at, law={names: _opposite(made, len(names))})


def _axis(name: str, port: Port) -> str:
    axis = [i for i, x in enumerate(port.direction) if x == 1.0]
    if port.kind != "motion" or len(axis) != 1:
        raise problem(
            f"{name}.motions", f"must be motions along x, y, z, rx, ry or rz of a body, got {shown(port.name)}"
        )
    return SIX[axis[0] + 3 * port.is_rotation]


def _opposite(law: FunctionLaw, m: int) -> FunctionLaw:
    """The law that resists with the force of another."""

    def negative(t: Any, u: Any, v: Any) -> Any:
        made = law.function(t, u, v)
        return -made if m == 1 else -np.asarray(made)

    derivatives = law.derivatives

    def slopes(t: Any, u: Any, v: Any) -> Any:
        return () if derivatives is None else tuple(-np.asarray(s) for s in derivatives(t, u, v))

    negative.__qualname__ = getattr(law.function, "__qualname__", "function")
    return FunctionLaw(negative, None if derivatives is None else slopes, w=law.w)
