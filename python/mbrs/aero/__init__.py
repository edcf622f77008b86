"""Aerodynamics of blades: polars, blades and wind; rotors by blade elements and momentum."""

from .blades import Blade, blade
from .polar_files import read_polar
from .polars import Polar, polar
from .rotors import Performance, Rotor, performance, rotor
from .winds import Wind, wind

__all__ = [
    "Blade",
    "Performance",
    "Polar",
    "Rotor",
    "Wind",
    "blade",
    "performance",
    "polar",
    "read_polar",
    "rotor",
    "wind",
]
