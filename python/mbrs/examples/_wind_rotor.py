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
    HUB_HEIGHT,
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
AROUND = tuple(2 * np.pi * i / 3 for i in range(3))
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
    speed: float = SPEED,
    modes: int = 4,
    gravity: float | None = 9.81,
    air: float | None = None,
    drive: bool = True,
    scale: float = 1.0,
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
    scale
        Of all lengths, by similarity of the same material in the same wind: masses grow with its cube, bending stiffness with
        its fourth power, air loads per length with itself.

    Returns
    -------
    Model
        6 bodies, 84 m above the ground, axis of rotation tilted by 5 degrees from x; z of blade frames runs down the wind along it,
        x outwards. Nodes "root", "section" (at 85 % of the blade) and "tip", markers "section1" to "section3". Blades, hub, nacelle:
        WindPACT 1.5 MW (OpenFAST r-test, public), a stand-in for the unpublished rotor of J. Algorithms Comput. Technol. 2017, doi
        10.1177/1748301817729990. The shaft's data and the air loads are invented.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.examples.wind_rotor(modes=2)
    Model('wind rotor': 6 bodies, 6 joints, 0 springs or dampers, 0 loads, 0 parameters)
    """
    m = Model("wind rotor", gravity=None if gravity is None else (0.0, 0.0, -gravity))
    shaft, bearing, centre, frame = add_nacelle(m, speed, scale)
    hub = m.body(
        "hub",
        mass=HUB_MASS * scale**3,
        inertia=(HUB_INERTIA * scale**5,) * 3,
        at=centre,
        orientation=frame,
        angular_velocity=tuple(speed * frame[:, 2]),
    )
    if drive:
        m.drive("turning", bearing, Ramp(speed))
    # six elastic coordinates of the hub in axes that turn with the shaft
    k, c = shaft_end(scale)
    m.free("shaft end", shaft, hub, at=centre, k=k, c=c, orientation=frame)
    for i, (name, angle) in enumerate(zip(BLADES, AROUND, strict=True)):
        _add_blade(m, name, hub, centre, frame, angle, speed, modes, scale)
        m.marker(f"section{i + 1}", m[name].node("section"))
        if air is not None:
            m.section_load(name, **air_loads(angle, speed, air, scale), name=f"{name}-air")
    return m


def add_nacelle(m: Model, speed: float, scale: float) -> tuple[Any, Any, np.ndarray, np.ndarray]:
    """Nacelle, shaft and the bearing between; the shaft, the bearing, the rotor's centre and its axes: up, with the rotation, the axis."""
    axis = np.array([np.cos(TILT), 0.0, np.sin(TILT)])
    top = np.array([0.0, 0.0, HUB_HEIGHT * scale])
    middle, centre = (top - part * OVERHANG * scale * axis for part in (0.5, 1.0))
    up = np.cross(axis, (0.0, 1.0, 0.0))
    frame = np.stack([up, np.cross(axis, up), axis], axis=1)
    inertia = NACELLE_YAW_INERTIA * scale**5
    nacelle = m.body("nacelle", mass=NACELLE_MASS * scale**3, inertia=(inertia, inertia, inertia), at=top)
    shaft = m.body(
        "shaft",
        mass=_SHAFT_MASS * scale**3,
        inertia=tuple(scale**5 * value for value in _SHAFT_INERTIA),
        at=middle,
        orientation=frame,
        angular_velocity=tuple(speed * axis),
    )
    m.fixed("yaw lock", m.ground, nacelle, at=top)
    return shaft, m.revolute("bearing", nacelle, shaft, at=middle, axis=axis), centre, frame


def shaft_end(scale: float = 1.0) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Stiffness and damping (6,) of the hub on the shaft: forces over lengths grow with the scale, moments with its cube, times as it."""
    share = np.repeat([1.0, scale**2], 3)
    return tuple(scale * share * _SHAFT_K), tuple(scale**2 * share * _SHAFT_C)


@lru_cache(maxsize=8)
def wind_blade(modes: int = 4, scale: float = 1.0) -> ModalBody:
    """The blade of `wind_rotor`: x outwards, y edgewise (with the rotation), z flapwise; no structural twist.

    Modes of the clamped blade, and the scale of all lengths.

    >>> import mbrs as mb
    >>> [round(float(f), 3) for f in mb.examples.wind_blade().frequencies()]
    [1.231, 1.878, 3.674, 6.374]
    """
    data = windpact_blade()
    ratio = [DAMPING["flap"], DAMPING["edge"], *[DAMPING["flap"]] * max(0, modes - 2)][:modes]
    return beam(
        scale * data.station,
        mass=scale**2 * data.mass,
        EI_flap=scale**4 * data.EI_flap,
        EI_edge=scale**4 * data.EI_edge,
        modes=modes,
        damping=ratio,
        nodes={"section": 0.85 * scale * data.station[-1]},
    )


def wind_rotor_blades(sections: int = 16, scale: float = 1.0) -> list[Any]:
    """The blades of `wind_rotor` as air sees them, for `Model.aerodynamics`: chord and sections invented, of the size of a 1.5 MW blade.

    Parameters
    ----------
    sections
        Strips of each blade.
    scale
        Of all lengths, as that of `wind_rotor`.

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
    given: dict[str, Any] = {"thickness": thickness, "root": scale * HUB_RADIUS, "sections": sections}
    return [blade(scale * at, scale * np.array(CHORD), twist, [thin, thick], body=name, **given) for name in BLADES]


def blade_axes(angle: float) -> np.ndarray:
    """Axes of a blade at an angle in those of the rotor, as columns: outwards, with the rotation, along the rotor's axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _add_blade(
    m: Model,
    name: str,
    hub: Any,
    centre: np.ndarray,
    frame: np.ndarray,
    angle: float,
    speed: float,
    modes: int,
    scale: float,
) -> None:
    R, root = frame @ blade_axes(angle), scale * HUB_RADIUS
    blade = m.flexible_body(
        name,
        wind_blade(modes, scale),
        at=centre + root * R[:, 0],
        orientation=R,
        velocity=speed * root * R[:, 1],
        angular_velocity=speed * R[:, 2],
    )
    m.fixed(f"root of {name}", hub, blade.node("root"))


def air_loads(angle: float, speed: float, until: float, scale: float = 1.0) -> dict[str, Any]:
    """Stations, table and times of the air loads of a blade that starts at an angle: those of the place where it is then."""
    length = scale * windpact_blade().station[-1]
    turn = 2 * np.pi / speed
    times = np.linspace(0.0, until, max(2, int(np.ceil(8 * until / turn)) + 1))
    height = 1.0 + _SHEAR * np.cos(angle + speed * times)
    load = scale * np.stack([np.zeros(len(_AIR_AT)), _AIR_DRIVE, _AIR_THRUST], axis=1)
    return {"stations": np.array(_AIR_AT) * length, "table": height[:, None, None] * load, "times": times}
