"""The fast heavy top of Geradin and Cardona, as Bruls and Cardona took it for Lie group integrators."""

from __future__ import annotations

import numpy as np

from ..model.model import Model


def heavy_top(spin: float = 150.0, precession: float = -4.61538, gravity: float = 9.81) -> Model:
    """A symmetric top of 15 kg whose centre of mass lies 1 m from the ball joint "pivot", drawn level along y.

    ``spin`` and ``precession`` rad/s: the angular velocity at the start is (0, spin, precession). Inertia about the
    centre of mass diag(0.234375, 0.46875, 0.234375) kg m2. Source: Bruls and Cardona, J. Comput. Nonlinear Dyn. 5
    (2010) 031002.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.System(mb.examples.heavy_top()).dof
    3
    """
    m = Model("heavy top", gravity=(0.0, 0.0, -gravity))
    w = np.array([0.0, spin, precession])
    arm = np.array([0.0, 1.0, 0.0])
    top = m.body(
        "top",
        mass=15.0,
        inertia=(0.234375, 0.46875, 0.234375),
        at=arm,
        velocity=np.cross(w, arm),
        angular_velocity=w,
    )
    m.spherical("pivot", m.ground, top, at=(0, 0, 0))
    return m
