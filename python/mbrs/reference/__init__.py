"""The equations once more, in plain NumPy, from the same tables: the check of the Rust core, never its servant.

Absolute coordinates of the centres of mass, all joints as constraints, congruence with B' and B'' (docs/theory.md (5.7) to (5.10)).
Real quantities are complex-safe: a complex step in x gives their derivatives to rounding. SciPy integrates motions.

To read it in order: `so3`, `jets` (numbers with derivatives), `reader` (what the tables hold), `topology`, `kinematics`, `joints`
(rows of constraints), `assembly` (closed loops, minimal coordinates), `dynamics` (forces and their tangents), `linearize`; then
any analysis. `hbm_balance` and `hbm_shooting` know matrices and laws only.
"""

from .assembly import assemble
from .dynamics import reactions
from .equilibrium import equilibrium, steady_motion
from .frf import frf, frf_derivative, motion_rows
from .kinematics import State, System, advance, drawn_state
from .linearize import Linearization, linearize
from .modal import Modes, modes
from .motion import Motion, law_rows
from .response import response
from .sensitivity import (
    Derivative,
    derivative,
    eigenvalue_derivative,
    frequency_derivative,
    group_matrix,
    real_part,
    shape_derivative,
)
from .simulate import History, Instant, begin, simulate

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
    "begin",
    "derivative",
    "drawn_state",
    "eigenvalue_derivative",
    "equilibrium",
    "frequency_derivative",
    "frf",
    "frf_derivative",
    "group_matrix",
    "law_rows",
    "linearize",
    "modes",
    "motion_rows",
    "reactions",
    "real_part",
    "response",
    "shape_derivative",
    "simulate",
    "steady_motion",
]
