"""Models to try things on. Geometry from METHODS.md a.1 where it says so; masses and stiffnesses are invented, except
the hexapod's.

Each builder takes sizes by keyword and returns a `Model`; the small nonlinear systems return a `MechanicalSystem`.
"""

from ._four_bar import four_bar
from ._hexapod import cubic_hexapod, cubic_hexapod_points
from ._lattices import chain, from_code, ladder, tree
from ._nonlinear import clearance_oscillator, engine_on_mounts, ladder_with_gap
from ._oscillators import (
    duffing,
    jenkins_oscillator,
    two_mass_cubic,
    two_mass_stop,
    two_tone_duffing,
    van_der_pol,
)
from ._quadruped import quadruped
from ._rotor import rotor
from ._stewart import stewart_platform
from ._wafer_stage import wafer_stage

__all__ = [
    "chain",
    "clearance_oscillator",
    "cubic_hexapod",
    "cubic_hexapod_points",
    "duffing",
    "engine_on_mounts",
    "four_bar",
    "from_code",
    "jenkins_oscillator",
    "ladder",
    "ladder_with_gap",
    "quadruped",
    "rotor",
    "stewart_platform",
    "tree",
    "two_mass_cubic",
    "two_mass_stop",
    "two_tone_duffing",
    "van_der_pol",
    "wafer_stage",
]
