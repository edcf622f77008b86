"""Loads per length along a flexible body, as forces, torques and modal forces of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from .._lib.checks import sized_array
from .._lib.rotations import quaternion_matrix
from .aliases import Matrix, Vector
from .book import Book, Group
from .flexible import FlexibleBody
from .forces import Load, enter_load, split_value
from .motions import MotionItem, MotionLike, Table
from .names import problem, shown
from .schema import LOAD_FRAMES, LOADS

if TYPE_CHECKING:
    from ..flexible import ModalBody

_POINTS = 4  # a cubic shape times a linear load, and to spare
# A component below this share of the largest of its kind is rounding, and makes no load.
_NOTHING = 1e-13
# Part of the length of a body by which stations may lie beyond its ends. Larger: loads beyond the body pass. Smaller: lengths that were
# added up are refused.
_ON_BODY = 1e-9
# Part of that length below which loads have no arm about the line of nodes. Larger: their moment is lost. Smaller: rounding makes loads.
_ON_LINE = 1e-9


class ModalLoad(Load):
    """Handle of a force on one modal coordinate of a flexible body; see `Model.modal_force`."""

    __slots__ = ("mode",)
    mode: int  # from 0

    def fields(self) -> dict[str, Group]:
        value = self.start + LOADS["modal_force"].block.place("value")
        out = {"value": Group(((value,),), (), ("",), checked=False)}
        for motion in self.motions:
            out.update(motion.motion_fields("q_", ""))
        return out


@dataclass(frozen=True)
class SectionLoad:
    """Handle of a section load: the names of its loads, and the resultants that they have together.

    ``force`` and ``moment`` (3,) or (n_t, 3) about the body's origin, N and N m, in the load's axes; ``modal`` (m,) or
    (n_t, m), the generalised forces, None for loads in world axes, which act on the nodes.
    """

    name: str
    loads: tuple[str, ...]
    force: np.ndarray
    moment: np.ndarray
    modal: np.ndarray | None

    def __str__(self) -> str:
        force = np.linalg.norm(self.force, axis=-1).max()
        return f"{self.name}: {len(self.loads)} loads, resultant up to {force:.6g} N"


def _flexible(book: Book, body: Any, where: str) -> FlexibleBody:
    owner = book.items.get(body) if isinstance(body, str) else body
    if not isinstance(owner, FlexibleBody) or owner.model is not book:
        raise problem(where, f"needs a flexible body of this model, got {shown(body)}")
    return owner


def _checked(label: str, stations: Any, table: Any, times: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Stations (n,), values (n_t, n, 6) with one n_t where they are constant, times (n_t,)."""
    at, values = sized_array(label + ".stations", stations), sized_array(label + ".table", table)
    if at.ndim != 1 or len(at) < 2 or not np.all(np.diff(at) > 0):
        raise problem(label + ".stations", f"must increase, at least two, got {shown(stations)}")
    when = None if times is None else sized_array(label + ".times", times)
    need = f"({len(at)}, 3) or ({len(at)}, 6)" if when is None else f"({when.size}, {len(at)}, 3) or (..., 6)"
    lead = (len(at),) if when is None else (when.size, len(at))
    if values.shape not in ((*lead, 3), (*lead, 6)):
        hint = "; give times= for a table that varies" if when is None and values.ndim == 3 else ""
        raise problem(label + ".table", f"must have the shape {need}, it has {values.shape}{hint}")
    if when is not None and (when.ndim != 1 or len(when) < 2 or not np.all(np.diff(when) > 0)):
        raise problem(label + ".times", f"must increase, at least two, got {shown(times)}")
    values = values.reshape(-1, len(at), values.shape[-1])
    return at, np.pad(values, ((0, 0), (0, 0), (0, 6 - values.shape[-1]))), when


class _Line:
    """Quadrature points along a flexible body: places (n, 3), shapes (n, 6, m), weights, and what stations share."""

    def __init__(self, label: str, modal: ModalBody, stations: np.ndarray) -> None:
        along, points = line_of(label, modal)
        if stations[0] < -_ON_BODY * along[-1] or stations[-1] > (1 + _ON_BODY) * along[-1]:
            raise problem(
                label + ".stations",
                f"must lie on the body, 0 to {along[-1]:g} m, got {stations[0]:g} to {stations[-1]:g}",
            )
        breaks = np.unique(np.concatenate([along[(along > stations[0]) & (along < stations[-1])], stations]))
        spots, weights = np.polynomial.legendre.leggauss(_POINTS)
        h = np.diff(breaks)
        self.at = (breaks[:-1, None] + 0.5 * h[:, None] * (spots + 1)).ravel()
        self.weight = (0.5 * h[:, None] * weights).ravel()
        self.r = interpolated(along, points, self.at)
        self.shape = interpolated(along, modal.line_shape, self.at)
        self.share = np.array([np.interp(self.at, stations, unit) for unit in np.eye(len(stations))])  # (n_s, n)
        self.along, self.points = along, points

    def loads(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces and moments of the quadrature points, (n_t, n, 3) each, weights included."""
        spread = np.einsum("tsc,sn,n->tnc", values, self.share, self.weight)
        return spread[..., :3], spread[..., 3:]

    def resultants(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment about the origin of the undeformed body, (n_t, 3)."""
        f, moment = self.loads(values)
        return f.sum(axis=1), (np.cross(self.r, f) + moment).sum(axis=1)


def line_of(label: str, modal: ModalBody) -> tuple[np.ndarray, np.ndarray]:
    """Distances (n,) along the line of a flexible body and its points (n, 3), m."""
    points = modal.line_position
    if "node_position" in modal.driven:
        raise problem(
            label, "does not follow the length of its body, which is a parameter; load its nodes, or give a number"
        )
    if len(points) < 2:
        raise problem(label, "needs points along the body: a ModalBody with line_position= and line_shape=, or nodes")
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    if not np.all(np.diff(along) > 0):
        raise problem(label, "needs points along the body that differ from each other, in order")
    return along, points


def interpolated(along: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values (n, ...) along a line, by cubic splines, at places (m,) m."""
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(along, values, k=min(3, len(along) - 1))(at))


def _follower(
    book: Book, owner: FlexibleBody, label: str, line: _Line, values: np.ndarray, when: Any, kind: Any
) -> SectionLoad:
    f, moment = line.loads(values)
    force, torque = line.resultants(values)
    modal = np.einsum("tna,nak->tk", np.concatenate([f, moment], axis=2), line.shape)
    drawn = _rotation(owner)
    origin = owner.entries("at")
    made = _Maker(book, owner, label, when, kind)
    made.add("force", "force", origin, force @ drawn.T, force)
    made.add("torque", "torque", (0.0, 0.0, 0.0), torque @ drawn.T, torque)
    largest = np.abs(modal).max(initial=0.0)
    for k in range(owner.n_modes):
        if np.abs(modal[:, k]).max() > _NOTHING * largest:
            made.add_modal(f"q{k + 1}", k, modal[:, k])
    made.commit()
    one = 0 if when is None else slice(None)
    return SectionLoad(label, tuple(made.names), force[one], torque[one], modal[one])


def _on_nodes(
    book: Book, owner: FlexibleBody, label: str, line: _Line, values: np.ndarray, when: Any, kind: Any
) -> SectionLoad:
    """Straight hats between neighbouring nodes share the loads."""
    nodes = sorted((_foot(line, p), i) for i, p in enumerate(owner.modal.node_position))
    places = np.array([s for s, _ in nodes])
    if len(nodes) < 2 or np.any(np.diff(places) <= 0) or places[0] > line.at[0] or places[-1] < line.at[-1]:
        raise problem(
            label,
            f"in world axes needs distinct nodes of {shown(owner.name)} that span all stations; the nodes are "
            f"at {', '.join(f'{s:g}' for s in places) or 'none'}. Give the body more nodes=, or use frame='body'",
        )
    share = np.array([np.interp(line.at, places, unit) for unit in np.eye(len(places))])
    f, moment = line.loads(values)
    made = _Maker(book, owner, label, when, kind)
    arm = line.r[None] - np.einsum("jn,ja->na", share, owner.modal.node_position[[i for _, i in nodes]])[None]
    extra = moment if np.abs(arm).max() < _ON_LINE * line.along[-1] else moment + np.cross(arm @ _rotation(owner).T, f)
    for (_, i), hat in zip(nodes, share, strict=True):
        name = owner.nodes[i]
        made.add_on(name, "force", np.einsum("n,tna->ta", hat, f), i)
        made.add_on(f"{name}-moment", "torque", np.einsum("n,tna->ta", hat, extra), i)
    made.commit()
    turned = line.r @ _rotation(owner).T
    force, torque = f.sum(axis=1), (np.cross(turned, f) + moment).sum(axis=1)
    one = 0 if when is None else slice(None)
    return SectionLoad(label, tuple(made.names), force[one], torque[one], None)


def _foot(line: _Line, point: np.ndarray) -> float:
    """Distance along the line of the point on it that is nearest to a node."""
    a, b = line.points[:-1], line.points[1:]
    t = np.clip(np.einsum("na,na->n", point - a, b - a) / np.einsum("na,na->n", b - a, b - a), 0, 1)
    best = int(np.argmin(np.linalg.norm(a + t[:, None] * (b - a) - point, axis=1)))
    return float(line.along[best] + t[best] * (line.along[best + 1] - line.along[best]))


def _rotation(owner: FlexibleBody) -> np.ndarray:
    """Body to world, as drawn."""
    return quaternion_matrix(np.array(owner.values("orientation")))


class _Maker:
    """Loads of one section load: all of them are made, or none."""

    def __init__(self, book: Book, owner: FlexibleBody, label: str, when: np.ndarray | None, kind: Any) -> None:
        self.book, self.owner, self.label, self.when, self.kind = book, owner, label, when, kind
        self.ready: list[tuple[Load, Any, np.ndarray]] = []
        self.names: list[str] = []

    def add(self, ending: str, type_: str, at: Any, values: np.ndarray, seen: np.ndarray, node: int = -1) -> None:
        """A force or a torque (n_t, 3) that follows the frame, or keeps its direction on a node."""
        if np.any(seen):
            load = Load(self.book, self.book.new_name("load", f"{self.label}-{ending}"))
            load.type, load.node, load.frame = type_, node, "body" if node < 0 else "world"
            self._take(load, at, values)

    def add_on(self, ending: str, type_: str, values: np.ndarray, node: int) -> None:
        """A force or a torque on a node."""
        at = self.owner.node_point(node) if type_ == "force" else (0.0, 0.0, 0.0)
        self.add(ending, type_, at, values, values, node)

    def add_modal(self, ending: str, mode: int, values: np.ndarray) -> None:
        """A modal force (n_t,)."""
        load = ModalLoad(self.book, self.book.new_name("load", f"{self.label}-{ending}"))
        load.type, load.node, load.frame, load.mode = "modal_force", -1, "world", mode
        self._take(load, (0.0, 0.0, 0.0), np.stack([values, 0 * values, 0 * values], axis=1))

    def _take(self, load: Load, at: Any, values: np.ndarray) -> None:
        load.body, load.motions = self.owner.index, []
        if self.when is not None:
            Table(self.when, values[:, 0], self.kind)  # raises for a wrong kind before anything is made
        self.ready.append((load, at, values))

    def commit(self) -> None:
        """Put the loads into the model."""
        for load, at, values in self.ready:
            varying: Sequence[int] = [] if self.when is None else [c for c in range(3) if np.any(values[:, c])]
            constant = [0.0 if self.when is not None else float(v) for v in values[0]]
            if load.node >= 0:
                self.owner.use(load.node)
            load.put([*at, *constant])
            for component in varying:
                self._move(load, component, values[:, component])
            self.book.register(load, self.book.loads)
            self.names.append(load.name)

    def _move(self, load: Load, component: int, values: np.ndarray) -> None:
        item = MotionItem(self.book, load.name)
        item.owner, item.component = load, component
        entries = item.take(
            Table(cast("np.ndarray", self.when), values, self.kind), f"{load.name}.{'xyz'[component]}", 1
        )
        item.place = len(self.book.motions)
        item.put(entries)
        self.book.motions.append(item)
        load.motions.append(item)


# --- methods of `Model` -----


def modal_force(self: Book, name: str, body: FlexibleBody | str, *, mode: int, value: MotionLike) -> ModalLoad:
    """A force on one modal coordinate of a flexible body.

    Parameters
    ----------
    name
        Unique in the model.
    body
        A flexible body, its handle or name.
    mode
        The coordinate, from 1.
    value
        A number, a motion or a function of t (s). Its power is value times the rate of ``body.q<mode>``: N for coordinates in
        metres.

    Returns
    -------
    ModalLoad

    Raises
    ------
    ModelError
        No flexible body, or a mode that it does not have.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("one"); rod = m.flexible_body("rod", mb.flexible.beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=4.0))
    >>> m.modal_force("push", rod, mode=1, value=mb.Sine(0.1, frequency=0.5))
    <load 'push' of 'one'>
    """
    load = ModalLoad(self, self.new_name("load", name))
    owner = _flexible(self, body, f"modal force {shown(name)}")
    if isinstance(mode, bool) or not isinstance(mode, (int, np.integer)) or not 1 <= mode <= owner.n_modes:
        raise problem(
            name + ".mode", f"must be 1 to {owner.n_modes}, the modes of {shown(owner.name)}, got {shown(mode)}"
        )
    load.type, load.body, load.node, load.frame, load.mode = "modal_force", owner.index, -1, "world", int(mode) - 1
    constant, varying = split_value(load, [value, 0.0, 0.0])
    return enter_load(load, [0.0, 0.0, 0.0, *constant], varying)


def section_load(
    self: Book,
    body: FlexibleBody | str,
    stations: Vector,
    table: Matrix,
    *,
    times: Vector | None = None,
    frame: Literal["body", "world"] = "body",
    name: str | None = None,
    kind: Literal["cubic", "linear"] = "cubic",
) -> SectionLoad:
    """A load per length along a flexible body, such as tabulated aerodynamic forces of the sections of a blade.

        F = int f dx,   M = int r x f + m dx,   Q_k = int f . phi_k + m . theta_k dx

    Parameters
    ----------
    body
        A flexible body.
    stations
        (n_s,) m, increasing: distance along the body's line (a beam's x). The load is linear between them, zero beyond.
    table
        (n_s, 3) force per length, N/m, or (n_s, 6) with moment per length, N m/m; with ``times`` one axis (n_t) more
        in front.
    times
        (n_t,) s, increasing; between them a curve of the given ``kind`` ("cubic" or "linear"), the end values outside.
    frame
        "body": components along the axes of the body's frame, in which they turn: a follower force and torque on the
        frame and one force on each modal coordinate. "world": the load keeps its direction, and is shared between
        neighbouring nodes.
    name
        Heads the names of the loads that are made, ``name-force`` and so on; "body-load" by default.

    Returns
    -------
    SectionLoad
        The names of its loads and their resultants.

    Raises
    ------
    ModelError
        No flexible body, wrong shapes, stations beyond the body, nodes that do not reach over a load in world axes.

    Notes
    -----
    Neglected with ``frame="body"``: that the line of action moves with the deflection (f acts at r, not at r + phi q) and
    that f turns with its section. With ``frame="world"`` nodes carry the load along; forces between nodes bend
    the body as their shares would, an error O(spacing^2). Cost O((n_s + n_line) m n_t).

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> m = mb.Model("wing"); beam = mb.flexible.beam(2.0, mass=1.0, EI_flap=10.0, EI_edge=40.0, modes=3)
    >>> wing = m.flexible_body("wing", beam)
    >>> lift = m.section_load(wing, [0.0, 2.0], [[0, 0, 5.0], [0, 0, 1.0]])
    >>> lift.force, lift.moment
    (array([0., 0., 6.]), array([ 0.        , -4.66666667,  0.        ]))
    """
    owner = _flexible(self, body, "section load")
    label = f"{owner.name}-load" if name is None else name
    if not isinstance(label, str):
        raise problem("section load", f"needs a name, got {shown(name)}")
    if not isinstance(frame, str) or frame not in LOAD_FRAMES:
        raise problem(label + ".frame", f"must be 'body' or 'world', got {shown(frame)}")
    if not isinstance(kind, str):
        raise problem(label + ".kind", f"must be 'cubic' or 'linear', got {shown(kind)}")
    at, values, when = _checked(label, stations, table, times)
    line = _Line(label, owner.modal, at)
    if frame == "body":
        return _follower(self, owner, label, line, values, when, kind)
    return _on_nodes(self, owner, label, line, values, when, kind)
