"""Aerodynamics of blades: polars, blades and wind; rotors by blade elements and momentum, and with wakes; vortex filaments
and lifting lines."""

from .attached import AttachedFlow, Indicial, attached_flow, indicial, theodorsen, wagner
from .blades import Blade, blade
from .dynamic_inflow import RotorResponse, rotor_response
from .filaments import induced_velocity
from .polar_files import read_polar
from .polars import Polar, polar
from .rotor_wakes import RotorWake, rotor_wake
from .rotors import Rotor, rotor
from .separation import StallResponse, dynamic_stall
from .steady_rotors import Performance, performance
from .winds import Wind, wind
from .wings import WingLoads, WingStart, impulsive_start, lifting_line

__all__ = [
    "AttachedFlow",
    "Blade",
    "Indicial",
    "Performance",
    "Polar",
    "Rotor",
    "RotorResponse",
    "RotorWake",
    "StallResponse",
    "Wind",
    "WingLoads",
    "WingStart",
    "attached_flow",
    "blade",
    "dynamic_stall",
    "impulsive_start",
    "indicial",
    "induced_velocity",
    "lifting_line",
    "performance",
    "polar",
    "read_polar",
    "rotor",
    "rotor_response",
    "rotor_wake",
    "theodorsen",
    "wagner",
    "wind",
]
