"""Measured points and those of a model: by name, by position, or as the user says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypedDict

import numpy as np

from .._lib.checks import real_array, real_number, shown
from .._lib.rotations import quaternion_matrix
from .._lib.text import counted
from ..errors import ModelError, NameNotFoundError
from ..model.ports import Port, as_port
from ..results import Result, quantity, result
from .frf import FrfResult
from .measurement import Measurement

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from ..model.aliases import BodyLike
    from ..model.model import Model

# Measured points this near to a marker or an origin, over the largest distance between those of the model, are that point. Too small:
# points measured with a tape miss. Too large: neighbours are taken for each other. Pinned by tests/linear/test_pairing.py.
_NEAR = 2e-3
# Distance of R R^T from the unit matrix up to which R is a rotation. Larger: frames that stretch pass; smaller: matrices typed with
# seven digits are refused.
_ROTATION = 1e-6
_AXES = {"x": 0, "y": 1, "z": 2}


@dataclass(frozen=True)
class Place:
    """The place of a measured node on the model: a body, or a marker of it, and its point in the drawn configuration."""

    body: str
    marker: str | None
    point: tuple[float, float, float] | None
    how: str
    distance: float


@result
class Pairing(Result):
    """Measured nodes and their points on a model.

    Attributes
    ----------
    node, target, how
        (n,) names of the nodes, of the body or marker of each, and "given", "name", "position" or "only body".
    distance
        (n,) m from the node to the drawn marker or origin that it was paired with; nan where its position is not known.
    unpaired
        Names of the nodes that no point of the model belongs to.
    places, turn, model
        `Place` of each node; rotation from the axes of the test to those of the world; the model.
    """

    node: tuple[str, ...]
    target: np.ndarray = quantity(dims=("node",))
    how: np.ndarray = quantity(dims=("node",))
    distance: np.ndarray = quantity(dims=("node",), unit="m")
    unpaired: tuple[str, ...]
    places: Mapping[str, Place]
    turn: np.ndarray
    model: Any

    row: ClassVar[str] = "node"
    axes: ClassVar[Mapping[str, str]] = {"node": "node"}

    def heading(self) -> str:
        return f"{counted(len(self.node), 'node')} paired, {len(self.unpaired)} not"

    def notes(self) -> list[str]:
        return [f"without a point of the model: {', '.join(self.unpaired)}"] if self.unpaired else []

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Distances between nodes and their points, as bars; returns the figure."""
        from ..plot.measurement import pairing

        return pairing(self, ax=ax)

    def port(self, text: str, kind: str) -> Port:
        """The port of the model for "12:+z" (node and direction) or for a name that mbrs gave, "payload.motion.z".

        Parameters
        ----------
        text
            As `MeasuredFunction.response` and ``reference`` have it.
        kind
            "motion", "force" or "base": what the node does. A force about an axis is a torque.

        Raises
        ------
        ModelError
            A node that is not paired, or a text without a direction.
        """
        node, colon, direction = text.rpartition(":")
        if not colon:
            return as_port(self.model, text)
        sign, axis = (-1.0 if direction.startswith("-") else 1.0), direction.lstrip("+-")
        bare = axis.removeprefix("r")
        if bare not in _AXES:
            raise ModelError(f"{text!r} names no direction of a node, such as '12:+z'")
        vector = sign * self.turn[:, _AXES[bare]]
        turns = bare != axis
        if kind == "base":
            x, y, z = vector.tolist()
            return Port(f"base.{text}", "base", "ground", None, None, (x, y, z), turns)
        place = self.places.get(node)
        if place is None:
            raise ModelError(
                f'node {node!r} of the measurement is not paired with a point of {self.model.name!r}; give points={{{node!r}: "..."}}, '
                "a body or a marker"
            )
        what: Any = "torque" if kind == "force" and turns else kind
        x, y, z = vector.tolist()
        return Port(text, what, place.body, place.marker, place.point, (x, y, z), turns)


class PairOptions(TypedDict, total=False):
    """Options of `pair` for those who pair on the way."""

    points: Mapping[int | str, BodyLike] | None
    frame: tuple[ArrayLike, ArrayLike] | None
    tolerance: float | None


def pair(
    m: Model,
    test: Measurement | FrfResult,
    *,
    points: Mapping[int | str, BodyLike] | None = None,
    frame: tuple[ArrayLike, ArrayLike] | None = None,
    tolerance: float | None = None,
) -> Pairing:
    """Pair the nodes of a measurement with points of a model.

    In this order: what ``points`` says, a body or marker of the same name, the nearest marker or origin of a body, the only body that
    moves. A node with a position keeps it, as a point of its body.

    Parameters
    ----------
    m
        The model.
    test
        A `Measurement`, or an `FrfResult` whose ports are the model's own.
    points
        {node number or name: body or marker, handle or name}.
    frame
        (origin (3,) m, orientation): where the axes of the test are in the world, a quaternion or a matrix; the world's own by default.
    tolerance
        m; within which positions are the same. 0.2 per cent of the largest distance between points of the model by default.

    Returns
    -------
    Pairing

    Raises
    ------
    ModelError
        Names that the model or the test does not have.

    Notes
    -----
    Cost O(nodes x points). D. J. Ewins, Modal Testing, 2nd ed., Research Studies Press 2000, chapter 5.

    Examples
    --------
    >>> import tempfile, pathlib, mbrs as mb
    >>> m = mb.examples.cubic_hexapod()
    >>> h = mb.frf(m, inputs="payload.force.z", outputs="payload.motion.z", frequency=[10.0, 20.0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     test = mb.load(h.save(pathlib.Path(folder) / "h.uff"))
    >>> mb.pair(m, test).target.tolist()
    ['payload']
    """
    if isinstance(test, FrfResult):
        nodes = _nodes_of([*test.inputs, *test.outputs])
        position: dict[str, np.ndarray] = {}
    elif isinstance(test, Measurement):
        nodes, position = _measured_nodes(test)
    else:
        raise ModelError(f"test= takes what mb.load returns of measured functions or modes, got {shown(test)}")
    origin, turn = _frame(frame)
    position = {name: origin + turn @ at for name, at in position.items()}
    given = _given(m, points, nodes, test)
    targets = {
        item.name: np.array(item.values("at"), dtype=float)
        for item in m.items.values()
        if item.kind in ("body", "marker")
    }
    moving = [body.name for body in m.bodies]
    near = _tolerance(tolerance, targets)
    places = {
        node: place
        for node in nodes
        if (place := _place(m, node, given.get(node), position.get(node), targets, moving, near)) is not None
    }
    return Pairing(
        node=tuple(places),
        target=np.array([p.marker or p.body for p in places.values()], dtype=str),
        how=np.array([p.how for p in places.values()], dtype=str),
        distance=np.array([p.distance for p in places.values()], dtype=float),
        unpaired=tuple(n for n in nodes if n not in places),
        places=places,
        turn=turn,
        model=m,
        error=0.0,
        status="paired" if len(places) == len(nodes) else "partly paired",
    )


def _place(
    m: Model, node: str, given: str | None, at: Any, targets: Mapping[str, np.ndarray], moving: list[str], near: float
) -> Place | None:
    """The place of one node, or None."""
    how, target = ("given", given) if given is not None else ("name", node if node in targets else None)
    if target is None and at is not None and targets:
        distances = {name: float(np.linalg.norm(at - p)) for name, p in targets.items()}
        nearest = min(distances, key=distances.__getitem__)
        if distances[nearest] <= near:
            how, target = "position", nearest
    if target is None and len(moving) == 1:
        how, target = "only body", moving[0]
    if target is None:
        return None
    distance = float("nan") if at is None else float(np.linalg.norm(at - targets[target]))
    item = m[target]
    marker = target if item.kind == "marker" else None
    body = item._home()[0]
    # a point that was measured beside the origin or the marker is its own point of the body
    point = None if at is None or distance <= near else tuple(np.asarray(at).tolist())
    return Place(body, marker, point, how, distance)


def _nodes_of(ports: list[str]) -> list[str]:
    return list(dict.fromkeys(text.rpartition(":")[0] for text in ports if ":" in text))


def _measured_nodes(test: Measurement) -> tuple[list[str], dict[str, np.ndarray]]:
    """Names of all nodes, and positions of those that have one; functions name nodes by number."""
    names = dict(zip((str(n) for n in test.node.tolist()), test.node_name, strict=True))
    used = [t for f in test.functions for t in (f.response, f.reference)]
    nodes = list(dict.fromkeys([*test.node_name, *(n for n in _nodes_of(used) if n not in names)]))
    known = {n: p for n, p in zip(test.node_name, test.position, strict=True) if np.all(np.isfinite(p))}
    # functions name nodes by their numbers
    aliases = [number for number in _nodes_of(used) if number in names and names[number] != number]
    return [*nodes, *aliases], known | {n: known[names[n]] for n in aliases if names[n] in known}


def _given(m: Model, points: Any, nodes: list[str], test: Any) -> dict[str, str]:
    out = {}
    numbers = (
        {} if isinstance(test, FrfResult) else dict(zip(map(str, test.node.tolist()), test.node_name, strict=True))
    )
    for given, target in (points or {}).items():
        name = str(getattr(target, "name", target))
        node = numbers.get(str(given), str(given)) if str(given) not in nodes else str(given)
        if node not in nodes:
            raise NameNotFoundError(
                f"points= names the node {shown(given)}, and the measurement has {', '.join(nodes) or 'none'}"
            )
        if name not in m.items or m[name].kind not in ("body", "marker"):
            raise NameNotFoundError(
                f"points= pairs node {shown(given)} with {shown(target)}, which is not a body or marker of {m.name!r}"
            )
        out[node] = name
    return out


def _frame(frame: Any) -> tuple[np.ndarray, np.ndarray]:
    if frame is None:
        return np.zeros(3), np.eye(3)
    if not isinstance(frame, tuple | list) or len(frame) != 2:
        raise ModelError(f"frame= takes (origin, orientation), got {shown(frame)}")
    origin, turn = real_array("the origin of frame=", frame[0]), real_array("the orientation of frame=", frame[1])
    if turn.shape == (4,) and np.any(turn):
        turn = quaternion_matrix(turn / np.linalg.norm(turn))
    if (
        origin.shape != (3,)
        or turn.shape != (3, 3)
        or np.abs(turn @ turn.T - np.eye(3)).max() > _ROTATION
        or np.linalg.det(turn) < 0
    ):
        raise ModelError("frame= takes a point (3,) and a quaternion (4,) or a rotation matrix (3, 3)")
    return origin, turn


def _tolerance(given: Any, targets: Mapping[str, np.ndarray]) -> float:
    if given is not None:
        return real_number("tolerance=, a length in m,", given, 0.0)
    points = np.array([*targets.values(), np.zeros(3)])
    return _NEAR * float(np.linalg.norm(points[:, None] - points[None], axis=2).max())
