"""Air along a motion: flow and forces at the sections of blades."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..errors import ModelError
from ..model.aerodynamics import Aerodynamics
from ..results import Result, Stats, quantity, result
from ..system.air_flow import FLOW, flows, wrapped
from ..system.snapshot import Snapshot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@result
class BladeLoads(Result):
    """The flow at the sections of one blade and the forces per length, over ``time`` (n_t,) s and ``place`` (n,) m along the blade.

    ``angle_of_attack`` rad, ``speed`` m/s of the wind across the section, ``circulation`` m^2/s, ``normal_force`` and
    ``tangential_force`` N/m along z and y of the section (of the body, turned by its bending; without the twist), each (n_t, n);
    ``force`` (n_t, n, 3) N/m and ``point`` (n_t, n, 3) m, the aerodynamic centre, in world axes.
    """

    time: np.ndarray = quantity(dims=("time",), unit="s")
    place: np.ndarray = quantity(dims=("place",), unit="m", label="distance along the blade")
    angle_of_attack: np.ndarray = quantity(dims=("time", "place"), unit="rad", label="angle of attack")
    speed: np.ndarray = quantity(dims=("time", "place"), unit="m/s", label="wind across the section")
    circulation: np.ndarray = quantity(dims=("time", "place"), unit="m2/s", label="circulation")
    normal_force: np.ndarray = quantity(dims=("time", "place"), unit="N/m", label="normal force per length")
    tangential_force: np.ndarray = quantity(dims=("time", "place"), unit="N/m", label="tangential force per length")
    force: np.ndarray = quantity(dims=("time", "place", "axis"), unit="N/m", label="force per length")
    point: np.ndarray = quantity(dims=("time", "place", "axis"), unit="m", label="aerodynamic centre")
    body: str

    row: ClassVar[str] = "time"
    axes: ClassVar[Mapping[str, str]] = {"time": "time", "place": "place"}

    def heading(self) -> str:
        a = np.degrees(self.angle_of_attack)
        return (
            f"air at {self.body!r}: {len(self.place)} sections, {len(self.time)} times, angles of attack from {a.min():.4g} to "
            f"{a.max():.4g} degrees"
        )

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: means over the times at every section."""
        parts = (np.degrees(self.angle_of_attack), self.circulation, self.normal_force, self.tangential_force)
        columns = [self.place, *(np.mean(p, axis=0) for p in parts)]
        names = ["place [m]", "angle [deg]", "circulation [m2/s]", "normal [N/m]", "tangential [N/m]"]
        return names, [[float(v) for v in row] for row in zip(*columns, strict=True)]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """Normal force per length over the place, mean and range in time; returns the figure."""
        from ..plot.aero import blade_loads as draw

        return draw(self, ax=ax)


class AirMotion:
    """The part of a motion that belongs to air; a trajectory has it."""

    t: np.ndarray
    q: np.ndarray
    rate: np.ndarray
    memory: np.ndarray
    snapshot: Snapshot
    without: tuple[str, ...]

    @cached_property
    def _flow(self) -> np.ndarray:
        """(n_t, sections, 36) rows of `FLOW`."""
        return flows(self.snapshot.system, self.t, self.q, self.rate, self.memory)

    def _airs(self) -> list[Aerodynamics]:
        airs: list[Aerodynamics] = self.snapshot.model.airs
        if not airs or "aerodynamics" in self.without:
            raise ModelError("this motion is without air; give its model m.aerodynamics(...)")
        return airs

    def aero(self, blade: Any) -> BladeLoads:
        """Flow and forces at the sections of the blade that a body carries, by its name or handle."""
        name = getattr(blade, "name", blade)
        airs = self._airs()
        known = [b["body"] for air in airs for b in air.blades]
        if name not in known:
            raise ModelError(f"no blade is carried by {name!r}; blades are on {', '.join(dict.fromkeys(known))}")
        start = 0
        for air in airs:
            for one in air.blades:
                n = len(one["place"])
                if one["body"] == name:
                    return blade_loads(self.t, one, self._flow[:, start : start + n])
                start += n
        raise AssertionError("a known blade is among the blades")

    def _going(self, i: int) -> Any:
        """The wake from which a motion goes on, at the last output."""
        wake = getattr(self, "wake", None)
        return wake.going if wake is not None and i == len(self.t) - 1 else None

    @property
    def thrust(self) -> np.ndarray:
        """(n_t,) N: force of the air on all blades along the rotor's axis, as drawn."""
        total, start = np.zeros(len(self.t)), 0
        for air in self._airs():
            n = sum(air.counts())
            axis = np.array(air.values("axis")) / np.linalg.norm(air.values("axis"))
            total += np.sum(self._flow[:, start : start + n, FLOW["force"]], axis=1) @ axis
            start += n
        return total

    @property
    def power(self) -> np.ndarray:
        """(n_t,) W that the air gives to the blades: force times velocity, the blades' vibration included."""
        parts = self.energy.power  # type: ignore[attr-defined]
        return -np.sum([parts[air.name] for air in self._airs()], axis=0)  # type: ignore[no-any-return]


def blade_loads(t: np.ndarray, blade: Mapping[str, Any], flow: np.ndarray) -> BladeLoads:
    """The result of rows (n_t, n, 36) of one blade."""
    width = np.array(blade["width"])
    force = flow[..., FLOW["force"]] / width[:, None]
    return BladeLoads(
        time=t,
        place=np.array(blade["place"]),
        angle_of_attack=wrapped(flow[..., FLOW["angle"]]),
        speed=flow[..., FLOW["speed"]],
        circulation=flow[..., FLOW["circulation"]],
        normal_force=np.sum(force * flow[..., FLOW["suction"]], axis=-1),
        tangential_force=np.sum(force * flow[..., FLOW["ahead"]], axis=-1),
        force=force,
        point=flow[..., FLOW["centre"]],
        body=blade["body"],
        stats=Stats(),
        error=None,
    )
