"""The linear analyses once more, in plain NumPy, from the same tables: the check of the Rust core, never its servant.

Absolute coordinates of the centres of mass, all joints as constraints, congruence with B' and B'' (METHODS.md a). Real quantities are
complex-safe: a complex step in x gives their derivatives to rounding.
"""

from .assembly import assemble
from .equilibrium import equilibrium
from .kinematics import State, System, advance, drawn_state, from_poses
from .linearize import Linearization, linearize

__all__ = ["Linearization", "State", "System", "advance", "assemble", "drawn_state", "equilibrium", "from_poses", "linearize"]
