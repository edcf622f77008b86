"""Models to try things on. Geometry from METHODS.md a.1 where it says so; masses and stiffnesses are invented, except
the hexapod's.

Each builder takes sizes by keyword and returns a `Model`.
"""

from ._five_bar import five_bar, ice_skate
from ._four_bar import four_bar, four_bars
from ._gap import gap_problem
from ._heavy_top import heavy_top
from ._hexapod import cubic_hexapod, cubic_hexapod_points
from ._lattices import chain, from_code, ladder, tree
from ._pendulum_chain import pendulum_chain
from ._quadruped import quadruped
from ._rotor import rotor
from ._slider_crank import slider_crank
from ._stewart import stewart_platform
from ._wafer_stage import wafer_stage

__all__ = [
    "chain",
    "cubic_hexapod",
    "cubic_hexapod_points",
    "five_bar",
    "four_bar",
    "four_bars",
    "from_code",
    "gap_problem",
    "heavy_top",
    "ice_skate",
    "ladder",
    "pendulum_chain",
    "quadruped",
    "rotor",
    "slider_crank",
    "stewart_platform",
    "tree",
    "wafer_stage",
]
