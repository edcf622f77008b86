"""Aerodynamics of blades: polars, blades and wind; rotors by blade elements and momentum; vortex filaments and
lifting lines."""

from .attached import AttachedFlow, Indicial, attached_flow, indicial, theodorsen, wagner
from .blades import Blade, blade
from .filaments import induced_velocity
from .polar_files import read_polar
from .polars import Polar, polar
from .rotors import Performance, Rotor, performance, rotor
from .winds import Wind, wind
from .wings import WingLoads, WingStart, impulsive_start, lifting_line

__all__ = [
    "AttachedFlow",
    "Blade",
    "Indicial",
    "Performance",
    "Polar",
    "Rotor",
    "Wind",
    "WingLoads",
    "WingStart",
    "attached_flow",
    "blade",
    "impulsive_start",
    "indicial",
    "induced_velocity",
    "lifting_line",
    "performance",
    "polar",
    "read_polar",
    "rotor",
    "theodorsen",
    "wagner",
    "wind",
]
