"""Many designs: sampling, sweeps over them with failures as data, uncertainty; optimisation of a design.

``mb.design`` holds the ways to make `Designs`; ``mb.sweep`` computes outputs for each of them.
"""

from __future__ import annotations

from . import outputs
from .gaussian import normal
from .sampling import from_table, full_factorial, halton, latin_hypercube, sobol
from .table import Designs
from .uncertainty import saltelli

__all__ = [
    "Designs",
    "from_table",
    "full_factorial",
    "halton",
    "latin_hypercube",
    "normal",
    "outputs",
    "saltelli",
    "sobol",
]
