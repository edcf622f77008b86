"""A three-bladed rotor with flexible blades and shaft; WindPACT data as a stand-in, shaft and air loads invented."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from ..flexible import ModalBody, beam
from ..model.model import Model
from ..model.motions import Ramp
from ._windpact import (
    CHORD,
    CHORD_AT,
    DAMPING,
    HUB_INERTIA,
    HUB_MASS,
    HUB_RADIUS,
    NACELLE_MASS,
    NACELLE_YAW_INERTIA,
    OVERHANG,
    SPEED,
    TILT,
    windpact_blade,
)

BLADES = ("blade1", "blade2", "blade3")
# Invented: the hub on the end of the shaft, N/m and N m/rad in the frame of the shaft (z along it), N s/m and N m s/rad.
_SHAFT_K = (4e8, 4e8, 2e9, 5e8, 5e8, 1.2e8)
_SHAFT_C = (4e5, 4e5, 2e6, 5e5, 5e5, 2e5)
_SHAFT_MASS, _SHAFT_INERTIA = 2000.0, (600.0, 600.0, 300.0)
# Invented: air loads per length at fractions of the blade, N/m: along the wind and with the rotation.
_AIR_AT = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
_AIR_THRUST = (0.0, 350.0, 700.0, 1050.0, 1350.0, 1100.0, 0.0)
_AIR_DRIVE = (0.0, 120.0, 150.0, 160.0, 150.0, 90.0, 0.0)
_SHEAR = 0.2  # share by which a blade's loads rise at the top and fall at the bottom


def wind_rotor(
    speed: float = SPEED, modes: int = 4, gravity: float | None = 9.81, air: float | None = None, drive: bool = True
) -> Model:
    """Three flexible blades "blade1" to "blade3" on a "hub" at the end of a flexible "shaft" in a locked "nacelle".

    Parameters
    ----------
    speed
        rad/s, 17.2 r/min by default: of the drive "turning" on the joint "bearing", and as drawn.
    modes
        Modes of each blade: flapwise and edgewise in turn, damping as WindPACT gives it.
    gravity
        m/s2 downwards (-z), or None.
    air
        Until when (s) tabulated aerodynamic section loads act, one value for each eighth of a turn; None for none, as beside
        `Model.aerodynamics`. Their size is invented: thrust and driving force with a wind that is stronger above.
    drive
        False leaves the joint "bearing" free.

    Returns
    -------
    Model
        6 bodies, axis of rotation tilted by 5 degrees from x; z of blade frames runs down the wind along it, x outwards. Nodes
        "root", "section" (at 85 % of the blade) and "tip", markers "section1" to "section3". Blades, hub, nacelle: WindPACT 1.5
        MW (OpenFAST r-test, public), a stand-in for the unpublished rotor of J. Algorithms Comput. Technol. 2017, doi
        10.1177/1748301817729990. The shaft's data and the air loads are invented.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.examples.wind_rotor(modes=2)
    Model('wind rotor': 6 bodies, 6 joints, 0 elements, 0 loads, 0 parameters)
    """
    m = Model("wind rotor", gravity=None if gravity is None else (0.0, 0.0, -gravity))
    axis = np.array([np.cos(TILT), 0.0, np.sin(TILT)])
    side = np.array([0.0, 1.0, 0.0])
    centre = -OVERHANG * axis
    spin = tuple(speed * axis)
    frame = _rotation(axis, side, 0.0)
    inertia = NACELLE_YAW_INERTIA
    nacelle = m.body("nacelle", mass=NACELLE_MASS, inertia=(inertia, inertia, inertia), at=(0, 0, 0))
    shaft = m.body(
        "shaft",
        mass=_SHAFT_MASS,
        inertia=_SHAFT_INERTIA,
        at=0.5 * centre,
        orientation=frame,
        angular_velocity=spin,
    )
    hub = m.body(
        "hub",
        mass=HUB_MASS,
        inertia=(HUB_INERTIA, HUB_INERTIA, HUB_INERTIA),
        at=centre,
        orientation=frame,
        angular_velocity=spin,
    )
    m.fixed("yaw lock", m.ground, nacelle, at=(0, 0, 0))
    bearing = m.revolute("bearing", nacelle, shaft, at=0.5 * centre, axis=axis)
    if drive:
        m.drive("turning", bearing, Ramp(speed))
    # six elastic coordinates of the hub in axes that turn with the shaft
    m.free("shaft end", shaft, hub, at=centre, k=_SHAFT_K, c=_SHAFT_C, orientation=frame)
    for i, name in enumerate(BLADES):
        _add_blade(m, name, hub, centre, axis, side, 2 * np.pi * i / 3, speed, modes)
        m.marker(f"section{i + 1}", m[name].node("section"))
        if air is not None:
            _add_air(m, name, 2 * np.pi * i / 3, speed, air)
    return m


@lru_cache(maxsize=8)
def wind_blade(modes: int = 4) -> ModalBody:
    """The blade of `wind_rotor`: x outwards, y edgewise (with the rotation), z flapwise; no structural twist.

    >>> import mbrs as mb
    >>> [round(float(f), 3) for f in mb.examples.wind_blade().frequencies()]
    [1.231, 1.878, 3.674, 6.374]
    """
    data = windpact_blade()
    ratio = [DAMPING["flap"], DAMPING["edge"], *[DAMPING["flap"]] * max(0, modes - 2)][:modes]
    return beam(
        data.station,
        mass=data.mass,
        EI_flap=data.EI_flap,
        EI_edge=data.EI_edge,
        modes=modes,
        damping=ratio,
        nodes={"section": 0.85 * data.station[-1]},
    )


def wind_rotor_blades(sections: int = 16) -> list[Any]:
    """The blades of `wind_rotor` as air sees them, for `Model.aerodynamics`: chord and sections invented, of the size of a 1.5 MW blade.

    Parameters
    ----------
    sections
        Strips of each blade.

    Returns
    -------
    list of `mbrs.aero.Blade`
        One on each of "blade1" to "blade3"; stations count from the axis.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.wind_rotor()
    >>> m.aerodynamics("air", mb.examples.wind_rotor_blades(), wind=mb.aero.wind(8.0), inflow="bem")
    <aerodynamics 'air' of 'wind rotor'>
    """
    from ..aero import blade, polar

    a = np.radians(np.arange(-20.0, 20.5, 1.0))
    lift = 2 * np.pi * np.sin(a) * (1.0 - 0.25 * np.abs(a) / a[-1])
    thin = polar(a, lift + 0.3, 0.007 + 0.05 * a**2, 0 * a - 0.05, thickness=0.18, name="thin").extend(
        aspect_ratio=17.0
    )
    thick = polar(a, 0.6 * lift, 0.03 + 0.3 * a**2, thickness=0.45, name="thick").extend(aspect_ratio=17.0)
    data = windpact_blade()
    at = np.array(CHORD_AT)
    twist = np.interp(at - HUB_RADIUS, data.station, data.twist)
    thickness = np.interp(at, [at[0], 9.5, 20.0, at[-1]], [0.45, 0.32, 0.22, 0.18])
    given: dict[str, Any] = {"thickness": thickness, "root": HUB_RADIUS, "sections": sections}
    return [blade(at, CHORD, twist, [thin, thick], body=name, **given) for name in BLADES]


def _rotation(axis: np.ndarray, side: np.ndarray, angle: float) -> np.ndarray:
    """Columns: outwards at this angle, with the rotation, along the axis; angle 0 points up."""
    up = np.cross(axis, side)
    out = np.cos(angle) * up + np.sin(angle) * np.cross(axis, up)
    return np.stack([out, np.cross(axis, out), axis], axis=1)


def _add_blade(
    m: Model,
    name: str,
    hub: Any,
    centre: np.ndarray,
    axis: np.ndarray,
    side: np.ndarray,
    angle: float,
    speed: float,
    modes: int,
) -> None:
    R = _rotation(axis, side, angle)
    blade = m.flexible_body(
        name,
        wind_blade(modes),
        at=centre + HUB_RADIUS * R[:, 0],
        orientation=R,
        velocity=speed * HUB_RADIUS * R[:, 1],
        angular_velocity=speed * axis,
    )
    m.fixed(f"root of {name}", hub, blade.node("root"))


def _add_air(m: Model, name: str, angle: float, speed: float, until: float) -> None:
    """A table over time: the air load of the place where the blade is then."""
    length = windpact_blade().station[-1]
    turn = 2 * np.pi / speed
    times = np.linspace(0.0, until, max(2, int(np.ceil(8 * until / turn)) + 1))
    height = 1.0 + _SHEAR * np.cos(angle + speed * times)
    load = np.stack([np.zeros(len(_AIR_AT)), _AIR_DRIVE, _AIR_THRUST], axis=1)
    m.section_load(name, np.array(_AIR_AT) * length, height[:, None, None] * load, times=times, name=f"{name}-air")
