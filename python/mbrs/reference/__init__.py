"""The analyses once more, in plain NumPy, from the same tables: the check of the Rust core, never its servant.

Absolute coordinates of the centres of mass, all joints as constraints, congruence with B' and B'' (docs/theory.md (5.7) to (5.10)).
Real quantities are complex-safe: a complex step in x gives their derivatives to rounding.
"""

from .assembly import assemble
from .bdf import bdf4
from .closure import closure_curvature, closure_defect
from .dynamics import reactions
from .equilibrium import equilibrium
from .explicit import explicit, oracle
from .frf import frf, frf_derivative, motion_rows
from .generalized_alpha import generalized_alpha
from .kinematics import State, System, advance, drawn_state, from_poses
from .linearize import Linearization, linearize
from .modal import Modes, constrained_roots, modes
from .motion import Motion, integrate, law_rows
from .precise import mp_eigenvalue_derivative
from .response import response
from .root import root
from .sensitivity import (
    Derivative,
    derivative,
    eigenvalue_derivative,
    frequency_derivative,
    group_matrix,
    real_part,
    shape_derivative,
)
from .simulate import simulate
from .steady import steady_motion
from .transient import History, Instant

__all__ = [
    "Derivative",
    "History",
    "Instant",
    "Linearization",
    "Modes",
    "Motion",
    "State",
    "System",
    "advance",
    "assemble",
    "bdf4",
    "closure_curvature",
    "closure_defect",
    "constrained_roots",
    "derivative",
    "drawn_state",
    "eigenvalue_derivative",
    "equilibrium",
    "explicit",
    "frequency_derivative",
    "frf",
    "frf_derivative",
    "from_poses",
    "generalized_alpha",
    "group_matrix",
    "integrate",
    "law_rows",
    "linearize",
    "modes",
    "motion_rows",
    "mp_eigenvalue_derivative",
    "oracle",
    "reactions",
    "real_part",
    "response",
    "root",
    "shape_derivative",
    "simulate",
    "steady_motion",
]
