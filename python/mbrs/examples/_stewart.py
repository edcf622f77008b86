"""A Stewart isolation platform with flexure joints: topology of Jiang, Chen and Luo (2011), all data invented."""

from __future__ import annotations

import numpy as np

from ..model.bodies import Body, Ground
from ..model.expressions import Expression
from ..model.laws import Jenkins
from ..model.model import Model

# Invented: kg, kg m2; flexures N m/rad, N m s/rad; struts N/m, N s/m.
_BASE, _PLATFORM = (50.0, (2.0, 2.0, 4.0)), (15.0, (0.12, 0.12, 0.22))
_ROD, _ROD_INERTIA = 0.4, (4e-4, 4e-4, 5e-5)
_FLEXURE_K, _FLEXURE_C = (6.0, 6.0, 9.0), (2e-3, 2e-3, 2e-3)
_STRUT_K, _STRUT_C = 6e4, 80.0


def stewart_platform(
    radius: float = 0.25, height: float = 0.2, spread: float = 0.35, friction: float = 0.0, sticking: float = 1.5e5
) -> Model:
    """A platform on six struts: 14 bodies (with the fixed base), 12 degrees of freedom, five loops.

    Each strut is two bodies, a prismatic joint and a spring-damper along it; its ends are flexures: spherical joints
    with torsional stiffness (docs/theory.md (23.4)). Six degrees of freedom are the platform's, six the spins of the
    struts.

    Parameters
    ----------
    radius, height
        m: of both circles of joints, and of the upper above the lower.
    spread
        rad: half the angle between the two joints of a pair, at the base; the platform's pairs lie between the base's.

    friction, sticking
        N: what the slides of the struts hold before they slip, none by default; N/m: their stiffness until then.

    Returns
    -------
    Model
        Bodies "base", "platform", "lower0", "upper0", ...; parameters "k_strut" and "c_strut". All data are invented.
    """
    m = Model("stewart platform")
    k, c = m.parameter("k_strut", _STRUT_K, unit="N/m"), m.parameter("c_strut", _STRUT_C, unit="N s/m")
    base = m.body("base", mass=_BASE[0], inertia=_BASE[1], at=(0, 0, 0))
    platform = m.body("platform", mass=_PLATFORM[0], inertia=_PLATFORM[1], at=(0, 0, height + 0.02))
    m.fixed("floor", m.ground, base, at=(0, 0, 0))
    for i in range(6):
        side = 1 if i % 2 else -1
        pair = (i // 2) * 2 * np.pi / 3
        foot = _on_circle(radius, pair + side * spread, 0.0)
        head = _on_circle(radius, pair + side * (np.pi / 3 - spread), height)
        law = Jenkins(sticking, friction) if friction else None
        _strut(m, i, base, platform, foot, head, k, c, law)
    return m


def _on_circle(radius: float, angle: float, z: float) -> np.ndarray:
    return np.array([radius * np.cos(angle), radius * np.sin(angle), z])


def _strut(
    m: Model,
    i: int,
    base: Body | Ground,
    platform: Body | Ground,
    foot: np.ndarray,
    head: np.ndarray,
    k: Expression,
    c: Expression,
    law: Jenkins | None,
) -> None:
    along = head - foot
    turned = _frame_along(along)
    points = {part: tuple(foot + share * along) for part, share in (("lower", 0.3), ("middle", 0.5), ("upper", 0.7))}
    lower = m.body(f"lower{i}", mass=_ROD, inertia=_ROD_INERTIA, at=points["lower"], orientation=turned)
    upper = m.body(f"upper{i}", mass=_ROD, inertia=_ROD_INERTIA, at=points["upper"], orientation=turned)
    m.spherical(f"foot{i}", base, lower, at=tuple(foot), orientation=turned, k=_FLEXURE_K, c=_FLEXURE_C)
    m.prismatic(f"strut{i}", lower, upper, at=points["middle"], axis=tuple(along), law=law)
    m.spherical(f"head{i}", upper, platform, at=tuple(head), orientation=turned, k=_FLEXURE_K, c=_FLEXURE_C)
    m.spring_damper(f"spring{i}", lower, upper, at=(points["lower"], points["upper"]), k=k, c=c)


def _frame_along(direction: np.ndarray) -> np.ndarray:
    """A rotation matrix whose z axis is the direction."""
    z = direction / np.linalg.norm(direction)
    x = np.cross((0.0, 0.0, 1.0), z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
