"""Figures of aerodynamics: performance of rotors."""

from __future__ import annotations

from typing import Any

from .figure import canvas, colours, legend, style

__all__ = ["performance"]


def performance(result: Any, *, ax: Any = None) -> Any:
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
