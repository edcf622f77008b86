"""Aerodynamics of blades: polars, blades and wind."""

from .blades import Blade, blade
from .polar_files import read_polar
from .polars import Polar, polar
from .winds import Wind, wind

__all__ = ["Blade", "Polar", "Wind", "blade", "polar", "read_polar", "wind"]
