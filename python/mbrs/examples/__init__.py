"""Example models. Chain, tree and ladder have the published geometry of docs/theory.md (23.2) to (23.4); masses and stiffnesses are
invented, except the hexapod's.

Each builder takes sizes by keyword and returns a `Model`; the small nonlinear systems return a `MechanicalSystem`.
"""

from ._car import car
from ._five_bar import five_bar, ice_skate
from ._four_bar import four_bar, four_bars
from ._gap import gap_problem
from ._heavy_top import heavy_top
from ._hexapod import cubic_hexapod, cubic_hexapod_points
from ._known_values import error_table
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
from ._particle import nonholonomic_particle
from ._pendulum_chain import pendulum_chain
from ._quadruped import quadruped
from ._quarter_car import quarter_car
from ._rolling_disc import rolling_disc
from ._rotor import rotor
from ._slider_crank import slider_crank
from ._stewart import stewart_platform
from ._swing import swing
from ._wafer_stage import wafer_stage
from ._whole_rotor import whole_rotor
from ._wind_rotor import wind_blade, wind_rotor, wind_rotor_blades
from ._windpact import windpact_blade

__all__ = [
    "car",
    "chain",
    "clearance_oscillator",
    "cubic_hexapod",
    "cubic_hexapod_points",
    "duffing",
    "engine_on_mounts",
    "error_table",
    "five_bar",
    "four_bar",
    "four_bars",
    "from_code",
    "gap_problem",
    "heavy_top",
    "ice_skate",
    "jenkins_oscillator",
    "ladder",
    "ladder_with_gap",
    "nonholonomic_particle",
    "pendulum_chain",
    "quadruped",
    "quarter_car",
    "rolling_disc",
    "rotor",
    "slider_crank",
    "stewart_platform",
    "swing",
    "tree",
    "two_mass_cubic",
    "two_mass_stop",
    "two_tone_duffing",
    "van_der_pol",
    "wafer_stage",
    "whole_rotor",
    "wind_blade",
    "wind_rotor",
    "wind_rotor_blades",
    "windpact_blade",
]
