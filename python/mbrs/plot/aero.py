"""Figures of aerodynamics: performance of rotors, loads and start of wings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .figure import canvas, colours, legend, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["blade_loads", "circulation", "performance", "response", "stall", "start", "wake"]


def performance(result: Any, *, ax: Axes | None = None) -> Figure:
    """Power coefficient (full) and thrust coefficient (dashed) over the tip speed ratio."""
    with style():
        made, axes = canvas(ax)
        power, thrust = colours(axes, 2)
        marker = "o" if len(result.tip_speed_ratio) < 8 else None
        axes.plot(result.tip_speed_ratio, result.power_coefficient, marker=marker, color=power, label="power")
        axes.plot(result.tip_speed_ratio, result.thrust_coefficient, "--", marker=marker, color=thrust, label="thrust")
        axes.set(xlabel="tip speed ratio", ylabel="coefficient", title="rotor performance")
        legend(axes)
    return made


def circulation(result: Any, *, ax: Axes | None = None) -> Figure:
    """Circulation over the wind's speed along the span, a curve for each angle."""
    with style():
        made, axes = canvas(ax)
        for angle, gamma, colour in zip(
            result.angle, result.circulation, colours(axes, len(result.angle)), strict=True
        ):
            axes.plot(result.place, gamma, color=colour, label=f"{np.degrees(angle):.4g} degrees")
        axes.set(xlabel="place along the span [m]", ylabel="circulation / speed [m]", title="lifting line")
        legend(axes)
    return made


def start(result: Any, *, ax: Axes | None = None) -> Figure:
    """Lift coefficient over the distance flown."""
    with style():
        made, axes = canvas(ax)
        axes.plot(result.distance, result.lift_coefficient, color=colours(axes, 1)[0])
        axes.set(xlabel="distance flown [m]", ylabel="lift coefficient", title="impulsive start")
    return made


def wake(result: Any, *, ax: Axes | None = None) -> Figure:
    """Filaments that roll up outboard (full) and inboard (thin) of each blade, from the side, over the radius."""
    with style():
        made, axes = canvas(ax)
        wake, r = result.wake, result.radius
        for blade, colour in enumerate(colours(axes, len(wake.far))):
            axes.plot(*wake.bound[blade][:, [0, 2]].T / r, color=colour, lw=3.0)
            for side, width in ((0, 1.2), (1, 0.5)):
                axes.plot(*wake.far[blade, side][:, [0, 2]].T / r, color=colour, lw=width)
        axes.set(xlabel="along the axis / R", ylabel="upwards / R", title="wake", aspect="equal")
    return made


def response(result: Any, *, ax: Axes | None = None) -> Figure:
    """Thrust over time."""
    with style():
        made, axes = canvas(ax)
        axes.plot(result.time, result.thrust, color=colours(axes, 1)[0])
        axes.set(xlabel="time [s]", ylabel="thrust [N]", title="rotor in time")
    return made


def stall(result: Any, *, ax: Axes | None = None) -> Figure:
    """Lift coefficient over the angle of attack in degrees, in time and in steady flow."""
    with style():
        made, axes = canvas(ax)
        moving, steady = colours(axes, 2)
        order = np.argsort(result.angle_of_attack)
        a = np.degrees(result.angle_of_attack)
        axes.plot(a[order], result.static_lift[order], "--", color=steady, label="steady flow")
        axes.plot(a, result.lift, color=moving, label="in time")
        axes.set(xlabel="angle of attack [degrees]", ylabel="lift coefficient", title="dynamic stall")
        legend(axes)
    return made


def blade_loads(result: Any, *, ax: Axes | None = None) -> Figure:
    """Mean of the normal force per length over the place, and its range in time."""
    with style():
        made, axes = canvas(ax)
        colour = colours(axes, 1)[0]
        f = result.normal_force
        axes.fill_between(result.place, f.min(axis=0), f.max(axis=0), color=colour, alpha=0.25, lw=0.0)
        axes.plot(result.place, f.mean(axis=0), color=colour)
        axes.set(xlabel="place along the blade [m]", ylabel="normal force [N/m]", title=f"air at {result.body}")
    return made
