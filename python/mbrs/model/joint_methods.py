"""The methods of a model that add joints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .joints import Joint, add_joint

if TYPE_CHECKING:
    from .model import Model


class JointMethods:
    """The joints of a model. ``a`` and ``b`` are bodies (handles or names, or ground); rows and coordinates:
    docs/tables.md.

    All of them take ``at``: the joint's point (3,), world coordinates as drawn, or two points ``(P_a, P_b)`` that
    assembly brings together; ``axis``: "x", "-y", ... or a vector (3,), world, the joint frame's z axis; or
    ``orientation``: quaternion (4,), scalar first, or matrix (3, 3), the joint frame in the world. ``k`` (N/m, N
    m/rad), ``c`` (N s/m, N m s/rad) and ``preload`` (N, N m) act on the free coordinates in their order: one number
    where there is one, else one for each. ``law`` adds a nonlinear law. Each returns its `Joint`; a wrong argument
    raises `ModelError` (`NameNotFoundError`, `DuplicateNameError`) that names it. Cost O(1).
    """

    def fixed(self: Model, name: str, a: Any, b: Any, *, at: Any = None, orientation: Any = None) -> Joint:  # type: ignore[misc]
        """All six relative coordinates are zero.

        >>> import mbrs as mb
        >>> m = mb.Model("plate"); p = m.body("plate", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
        >>> m.fixed("weld", m.ground, p, at=(0, 0, 0))
        <joint 'weld' of 'plate'>
        """
        return add_joint(self, "fixed", name, a, b, at=at, orientation=orientation)

    def revolute(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        axis: Any = None,
        orientation: Any = None,
        k: Any = None,
        c: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Joint:
        """A hinge: free is the angle about ``axis`` (rad).

        >>> import mbrs as mb
        >>> m = mb.Model("rod"); r = m.body("rod", mass=1.0, inertia=(1e-3, 0.1, 0.1), at=(0.5, 0, 0))
        >>> m.revolute("hinge", m.ground, r, at=(0, 0, 0), axis="z", k=10.0).name
        'hinge'
        """
        return add_joint(
            self,
            "revolute",
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

    def prismatic(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        axis: Any = None,
        orientation: Any = None,
        k: Any = None,
        c: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Joint:
        """A slider: free is the displacement along ``axis`` (m)."""
        return add_joint(
            self,
            "prismatic",
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

    def cylindrical(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        axis: Any = None,
        orientation: Any = None,
        k: Any = None,
        c: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Joint:
        """Free are the displacement along (m) and the angle about ``axis`` (rad), in this order."""
        return add_joint(
            self,
            "cylindrical",
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

    def universal(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        axis: Any = None,
        axis2: Any = None,
        orientation: Any = None,
        k: Any = None,
        c: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Joint:
        """A cross: free are the angle about ``axis``, fixed in a, and that about ``axis2``, fixed in b and
        perpendicular to it.

        With ``orientation`` the frame's z is the first axis and its x the second.
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

    def spherical(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        axis: Any = None,
        orientation: Any = None,
        k: Any = None,
        c: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Joint:
        """A ball: free is the rotation vector (3) in the joint frame (world axes by default)."""
        return add_joint(
            self,
            "spherical",
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

    def planar(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        axis: Any = None,
        orientation: Any = None,
        k: Any = None,
        c: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Joint:
        """Motion in the plane normal to ``axis``: free are x, y of the joint frame (m) and the angle about its z
        (rad).
        """
        return add_joint(
            self,
            "planar",
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

    def free(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        axis: Any = None,
        orientation: Any = None,
        k: Any = None,
        c: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Joint:
        """No constraint: names the six coordinates of b relative to a (translation, then rotation vector, joint
        frame).
        """
        return add_joint(
            self,
            "free",
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

    def distance(self: Model, name: str, a: Any, b: Any, *, at: Any = None, length: Any = None) -> Joint:  # type: ignore[misc]
        """A massless rod: the distance of ``at=(P_a, P_b)`` stays as drawn, or is ``length`` (m), to which assembly
        goes.
        """
        return add_joint(self, "distance", name, a, b, at=at, length=length)

    def knife_edge(  # type: ignore[misc]
        self: Model, name: str, a: Any, b: Any, *, at: Any = None, axis: Any = None, orientation: Any = None
    ) -> Joint:
        """Nonholonomic: the point of b does not move along ``axis``, which is fixed in b, relative to a."""
        return add_joint(self, "knife_edge", name, a, b, at=at, axis=axis, orientation=orientation)

    def rolling_disc(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        axis: Any = None,
        axis2: Any = None,
        orientation: Any = None,
        radius: Any = None,
    ) -> Joint:
        """Nonholonomic: a disc of ``radius`` (m) about ``axis2`` (fixed in b) rolls on a plane of a with the normal
        ``axis``.

        ``at=(P_a, P_b)``: any point of the plane and the disc's centre.
        """
        return add_joint(
            self, "rolling_disc", name, a, b, at=at, axis=axis, axis2=axis2, orientation=orientation, radius=radius
        )
