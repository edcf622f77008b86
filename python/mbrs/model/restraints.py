"""The joints of `Model` that restrict motion by their rows alone and carry no body; docs/tables.md has their rows."""

from __future__ import annotations

from .aliases import Axis, BodyLike, Coefficients, Laws, Points, Rotation, Scalar
from .book import Book
from .joint import Joint, add_joint


def distance(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Points | None = None,
    length: Scalar | None = None,
) -> Joint:
    """A massless rod: |P_b - P_a| = length.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        ``(P_a, P_b)``, m, world, as drawn, the first fixed in a, the second in b.
    length
        m, to which assembly goes; the drawn distance by default, also when the points are moved.

    Returns
    -------
    Joint

    Raises
    ------
    ModelError
        A body joined to itself, a missing or doubled direction, wrong shapes, numbers that are not finite.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("rod"); b = m.body("bob", mass=1.0, inertia=(1, 1, 1), at=(0, 0, -1))
    >>> m.distance("string", m.ground, b, at=((0, 0, 0), (0, 0, -1)))
    <joint 'string' of 'rod'>
    """
    return add_joint(self, "distance", name, a, b, at=at, length=length)


def knife_edge(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Points | None = None,
    axis: Axis | None = None,
    orientation: Rotation | None = None,
) -> Joint:
    """Nonholonomic: the point of b does not move along ``axis``, which is fixed in b, relative to a.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: the direction without motion.
    orientation
        Of the joint frame as drawn, instead of ``axis``: quaternion (4,), scalar first, or matrix (3, 3).

    Returns
    -------
    Joint

    Raises
    ------
    ModelError
        A body joined to itself, a missing or doubled direction, wrong shapes, numbers that are not finite.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("skate"); s = m.body("skate", mass=1.0, inertia=(1, 1, 1))
    >>> m.knife_edge("blade", m.ground, s, at=(0, 0, 0), axis="y")
    <joint 'blade' of 'skate'>
    """
    return add_joint(self, "knife_edge", name, a, b, at=at, axis=axis, orientation=orientation)


def rolling_disc(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Points | None = None,
    axis: Axis | None = None,
    axis2: Axis | None = None,
    orientation: Rotation | None = None,
    radius: Scalar | None = None,
) -> Joint:
    """Nonholonomic: a disc of ``radius`` about ``axis2`` (fixed in b) rolls on a plane of a with the normal ``axis``.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        ``(P_a, P_b)``, m, world: any point of the plane and the disc's centre.
    axis
        "x", "-y", ... or a vector (3,), world: the normal of the plane.
    axis2
        The disc's axis, in the same way.
    orientation
        Of the joint frame as drawn, instead of the axes: quaternion (4,), scalar first, or matrix (3, 3).
    radius
        m, positive.

    Returns
    -------
    Joint

    Raises
    ------
    ModelError
        A body joined to itself, a missing or doubled direction, wrong shapes, numbers that are not finite.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("coin"); c = m.body("coin", mass=1.0, inertia=(1, 1, 2), at=(0, 0, 0.1))
    >>> m.rolling_disc("rolls", m.ground, c, at=((0, 0, 0), (0, 0, 0.1)), axis="z", axis2="x", radius=0.1)
    <joint 'rolls' of 'coin'>
    """
    return add_joint(
        self, "rolling_disc", name, a, b, at=at, axis=axis, axis2=axis2, orientation=orientation, radius=radius
    )


def point_on_line(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Points | None = None,
    axis: Axis | None = None,
    orientation: Rotation | None = None,
    k: Coefficients | None = None,
    c: Coefficients | None = None,
    preload: Coefficients | None = None,
    law: Laws | None = None,
) -> Joint:
    """A point of b stays on a line fixed in a: a pin in a slot, a bead on a wire. Free are the way along it (m) and all rotations.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies: the line is fixed in a, the point in b.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings onto one line; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: the direction of the line.
    orientation
        Of the joint frame as drawn, instead of ``axis``: quaternion (4,), scalar first, or matrix (3, 3).
    k, c, preload
        Stiffness (N/m), damping (N s/m) and tension (N) along the line, or a law of the way.
    law
        Nonlinear law of the way, added to these.

    Returns
    -------
    Joint

    Raises
    ------
    ModelError
        A body joined to itself, a missing or doubled direction, wrong shapes, numbers that are not finite.

    Examples
    --------
    A bead on a wire keeps one translation and three rotations.

    >>> import mbrs as mb
    >>> m = mb.Model("wire", gravity=(0, 0, -9.81))
    >>> bead = m.body("bead", mass=0.1, inertia=(1e-5, 1e-5, 1e-5), at=(0, 0, 0))
    >>> m.point_on_line("wire", m.ground, bead, at=(0, 0, 0), axis=(0.6, 0, 0.8))
    <joint 'wire' of 'wire'>
    >>> mb.System(m).dof
    4
    """
    return add_joint(
        self,
        "point_on_line",
        name,
        a,
        b,
        at=at,
        axis=axis,
        orientation=orientation,
        k=k,
        c=c,
        preload=preload,
        law=law,
    )
