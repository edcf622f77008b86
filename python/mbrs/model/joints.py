"""The joints of `Model` that leave coordinates, one constructor each; docs/tables.md has their rows and coordinates."""

from __future__ import annotations

from .aliases import Axis, BodyLike, Coefficients, Laws, Points, Rotation, Scalar
from .book import Book
from .joint import Joint, add_joint


def fixed(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Points | None = None,
    orientation: Rotation | None = None,
) -> Joint:
    """All six relative coordinates are zero.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    orientation
        Of the joint frame as drawn: quaternion (4,), scalar first, or matrix (3, 3).

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
    >>> m = mb.Model("plate"); p = m.body("plate", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    >>> m.fixed("weld", m.ground, p, at=(0, 0, 0))
    <joint 'weld' of 'plate'>
    """
    return add_joint(self, "fixed", name, a, b, at=at, orientation=orientation)


def revolute(
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
    """A hinge: free is the angle about ``axis`` (rad).

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: the hinge's axis.
    orientation
        Of the joint frame as drawn, instead of ``axis``: quaternion (4,), scalar first, or matrix (3, 3).
    k, c, preload
        Stiffness (N m/rad), damping (N m s/rad) and force (N m) of the free angle: one number each.
    law
        Nonlinear law or list of laws of the free angle, added to these.

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
    >>> m = mb.Model("rod"); r = m.body("rod", mass=1.0, inertia=(1e-3, 0.1, 0.1), at=(0.5, 0, 0))
    >>> m.revolute("hinge", m.ground, r, at=(0, 0, 0), axis="z", k=10.0).name
    'hinge'
    """
    return add_joint(
        self, "revolute", name, a, b, at=at, axis=axis, orientation=orientation, k=k, c=c, preload=preload, law=law
    )


def prismatic(
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
    """A slider: free is the displacement along ``axis`` (m).

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: the direction of sliding.
    orientation
        Of the joint frame as drawn, instead of ``axis``: quaternion (4,), scalar first, or matrix (3, 3).
    k, c, preload
        Stiffness (N/m), damping (N s/m) and force (N) of the free displacement: one number each.
    law
        Nonlinear law or list of laws of the free displacement, added to these.

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
    >>> m = mb.Model("table"); t = m.body("table", mass=1.0, inertia=(1, 1, 1))
    >>> m.prismatic("rail", m.ground, t, at=(0, 0, 0), axis="x", k=1e4, c=20.0)
    <joint 'rail' of 'table'>
    """
    return add_joint(
        self, "prismatic", name, a, b, at=at, axis=axis, orientation=orientation, k=k, c=c, preload=preload, law=law
    )


def cylindrical(
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
    """Free are the displacement along (m) and the angle about ``axis`` (rad), in this order.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: the common axis.
    orientation
        Of the joint frame as drawn, instead of ``axis``: quaternion (4,), scalar first, or matrix (3, 3).
    k, c, preload
        Stiffness (N/m or N m/rad), damping (N s/m or N m s/rad) and force (N or N m) of the free coordinates: (2,) each, or a law each.
    law
        Nonlinear law or None for each, or {name: law}, of the free coordinates, added to these.

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
    >>> m = mb.Model("sleeve"); s = m.body("sleeve", mass=1.0, inertia=(1, 1, 1))
    >>> m.cylindrical("guide", m.ground, s, at=(0, 0, 0), axis="z", k=(1e4, 5.0))
    <joint 'guide' of 'sleeve'>
    """
    return add_joint(
        self, "cylindrical", name, a, b, at=at, axis=axis, orientation=orientation, k=k, c=c, preload=preload, law=law
    )


def universal(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Points | None = None,
    axis: Axis | None = None,
    axis2: Axis | None = None,
    orientation: Rotation | None = None,
    k: Coefficients | None = None,
    c: Coefficients | None = None,
    preload: Coefficients | None = None,
    law: Laws | None = None,
) -> Joint:
    """A cross: free are the angle about ``axis``, fixed in a, and that about ``axis2``, fixed in b and perpendicular to it.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: the first axis.
    axis2
        The second axis, in the same way.
    orientation
        Of the joint frame as drawn, instead of the axes: quaternion (4,), scalar first, or matrix (3, 3); its z is the
        first axis, its x the second.
    k, c, preload
        Stiffness (N m/rad), damping (N m s/rad) and force (N m) of the free angles: (2,) each.
    law
        Nonlinear law or None for each, or {name: law}, of the free angles, added to these.

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
    >>> m = mb.Model("shaft"); s = m.body("shaft", mass=1.0, inertia=(1, 1, 1))
    >>> m.universal("cross", m.ground, s, at=(0, 0, 0), axis="z", axis2="x")
    <joint 'cross' of 'shaft'>
    """
    return add_joint(
        self,
        "universal",
        name,
        a,
        b,
        at=at,
        axis=axis,
        axis2=axis2,
        orientation=orientation,
        k=k,
        c=c,
        preload=preload,
        law=law,
    )


def spherical(
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
    """A ball: free is the rotation vector (3) in the joint frame (world axes by default).

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: z of the joint frame.
    orientation
        Of the joint frame as drawn, instead of ``axis``: quaternion (4,), scalar first, or matrix (3, 3).
    k, c, preload
        Stiffness (N m/rad), damping (N m s/rad) and force (N m) of the free rotation vector: (3,) each.
    law
        Nonlinear law or None for each component, or {name: law}, of the free rotation vector, added to these.

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
    >>> m = mb.Model("top"); t = m.body("top", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0.1))
    >>> m.spherical("ball", m.ground, t, at=(0, 0, 0))
    <joint 'ball' of 'top'>
    """
    return add_joint(
        self, "spherical", name, a, b, at=at, axis=axis, orientation=orientation, k=k, c=c, preload=preload, law=law
    )


def planar(
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
    """Motion in the plane normal to ``axis``: free are x, y of the joint frame (m) and the angle about its z (rad).

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: the normal.
    orientation
        Of the joint frame as drawn, instead of ``axis``: quaternion (4,), scalar first, or matrix (3, 3).
    k, c, preload
        Stiffness (N/m or N m/rad), damping (N s/m or N m s/rad) and force (N or N m) of the free coordinates: (3,) each.
    law
        Nonlinear law or None for each, or {name: law}, of the free coordinates, added to these.

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
    >>> m = mb.Model("puck"); p = m.body("puck", mass=1.0, inertia=(1, 1, 1))
    >>> m.planar("table", m.ground, p, at=(0, 0, 0), axis="z", c=(1.0, 1.0, 0.1))
    <joint 'table' of 'puck'>
    """
    return add_joint(
        self, "planar", name, a, b, at=at, axis=axis, orientation=orientation, k=k, c=c, preload=preload, law=law
    )


def free(
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
    """No constraint: names the six coordinates of b relative to a (translation, then rotation vector, joint frame).

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: z of the joint frame.
    orientation
        Of the joint frame as drawn, instead of ``axis``: quaternion (4,), scalar first, or matrix (3, 3).
    k, c, preload
        Stiffness (N/m or N m/rad), damping (N s/m or N m s/rad) and force (N or N m) of the free coordinates: (6,) each.
    law
        Nonlinear law or None for each, or {name: law}, of the free coordinates, added to these.

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
    >>> m = mb.Model("drone"); d = m.body("drone", mass=1.0, inertia=(1, 1, 1))
    >>> m.free("air", m.ground, d, at=(0, 0, 0))
    <joint 'air' of 'drone'>
    """
    return add_joint(
        self, "free", name, a, b, at=at, axis=axis, orientation=orientation, k=k, c=c, preload=preload, law=law
    )


def screw(
    self: Book,
    name: str,
    a: BodyLike,
    b: BodyLike,
    *,
    at: Points | None = None,
    axis: Axis | None = None,
    orientation: Rotation | None = None,
    pitch: Scalar | None = None,
    k: Coefficients | None = None,
    c: Coefficients | None = None,
    preload: Coefficients | None = None,
    law: Laws | None = None,
) -> Joint:
    """Free is the angle about ``axis`` (rad), with which b moves along it: u_z = ``pitch`` angle.

    Parameters
    ----------
    name
        Unique in the model.
    a, b
        Bodies (handles or names), ground, or nodes of flexible bodies.
    at
        (3,), m, world, as drawn, or two points ``(P_a, P_b)`` that assembly brings together; of a node its own point.
    axis
        "x", "-y", ... or a vector (3,), world: the common axis.
    orientation
        Of the joint frame as drawn, instead of ``axis``: quaternion (4,), scalar first, or matrix (3, 3).
    pitch
        m per radian: the lead over 2 pi; negative of a left-handed thread.
    k, c, preload
        Stiffness (N m/rad), damping (N m s/rad) and moment (N m) of the angle, or a law of it.
    law
        Nonlinear law of the angle, added to these.

    Returns
    -------
    Joint

    Raises
    ------
    ModelError
        A body joined to itself, a missing or doubled direction, wrong shapes, numbers that are not finite.

    Examples
    --------
    A nut on a thread of 5 mm lead falls with the acceleration m g p^2 / (J + m p^2).

    >>> import mbrs as mb, numpy as np
    >>> m = mb.Model("vice", gravity=(0, 0, -9.81))
    >>> nut = m.body("nut", mass=0.2, inertia=(1e-5, 1e-5, 2e-5), at=(0, 0, 0))
    >>> m.screw("thread", m.ground, nut, at=(0, 0, 0), axis="z", pitch=0.005 / (2 * np.pi))
    <joint 'thread' of 'vice'>
    """
    return add_joint(
        self,
        "screw",
        name,
        a,
        b,
        at=at,
        axis=axis,
        orientation=orientation,
        pitch=pitch,
        k=k,
        c=c,
        preload=preload,
        law=law,
    )
