"""Places of attachment: bodies, ground, and nodes of flexible bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import ModelError
from .book import Attachable, Book, Item
from .names import problem, shown
from .numbers import is_pair, numbers, vector


@dataclass(frozen=True)
class Place:
    """A body (-1 ground) and a node of it (-1 none)."""

    body: int
    node: int = -1


def places(book: Book, where: str, given: Sequence[tuple[str, Any]], at: Any, address: str) -> tuple[list[Place], Any]:
    """Places of one or two attached bodies, and ``at`` filled in from nodes where it was left out.

    A flexible body named without a node is taken at the node where ``at`` is.
    """
    found = [_place(book, body, where, key) for key, body in given]
    if at is None:
        at = _drawn_at(book, found, address)
    if not book.is_flexible:
        return found, at
    return [_at_node(book, place, at[i] if is_pair(at) else at, address) for i, place in enumerate(found)], at


def connect(item: Item, where: str, a: Any, b: Any, at: Any) -> tuple[Place, Place, Any]:
    """The two ends of an item, on two different bodies or nodes, and its point(s)."""
    book = item.model
    (i, j), at = places(book, where, (("a", a), ("b", b)), at, f"{item.name}.at")
    if i == j:
        raise problem(where, f"connects {book.body_name(i.body)!r} with itself; name two different bodies")
    return i, j, at


def load_place(book: Book, where: str, body: Any, at: Any, address: str) -> tuple[Place, Any]:
    """Place and point of a load; the point of a rigid body without one is its origin."""
    if at is None:
        place = _place(book, body, where, "body")
        if place.node < 0:
            owner = book.bodies[place.body] if place.body >= 0 else None
            if owner is not None and owner.modes_and_nodes:
                raise problem(
                    address, f"is missing: {shown(owner.name)} is flexible; name a node, {owner.name}.node(name)"
                )
            return place, owner.entries("at") if owner is not None else (0.0, 0.0, 0.0)
    (place,), at = places(book, where, (("body", body),), at, address)
    return place, at


def _place(book: Book, body: Any, where: str, key: str) -> Place:
    if isinstance(body, Attachable):
        home, index, node = body.place_now()
        if node >= 0:
            if home is book:
                return Place(index, node)
            raise ModelError(f"{where} names {shown(body)}, which belongs to another model; use this model's own")
    if isinstance(body, str) and "." in body and body not in book.body_index:
        owner, _, node_name = body.partition(".")
        if owner in book.body_index and book.bodies[book.body_index[owner]].modes_and_nodes:
            flexible = book.bodies[book.body_index[owner]]
            return Place(flexible.index, flexible.node(node_name).index)
    return Place(book.find_body(body, where, key))


def _drawn_at(book: Book, found: Sequence[Place], address: str) -> Any:
    points = [book.bodies[p.body].node_point(p.node) for p in found if p.node >= 0]
    if not points:
        raise problem(address, "is missing: give the point (3,), world, where it acts")
    if len(points) == 2 and len(found) == 2 and numbers(points[0]) != numbers(points[1]):
        return (points[0], points[1])
    return points[0]


def _at_node(book: Book, place: Place, point: Any, address: str) -> Place:
    body = book.bodies[place.body] if place.body >= 0 else None
    if place.node >= 0 or body is None or not body.modes_and_nodes:
        return place
    return Place(place.body, body.node_at(vector(point, address), address))
