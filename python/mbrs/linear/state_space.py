"""First-order form of models, linearisations and matrices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .first_order import StateSpace, first_order
from .second_order import linear_system

if TYPE_CHECKING:
    from ..system.state import StateLike
    from .aliases import Linear, Ports


def state_space(
    m: Linear,
    inputs: Ports,
    outputs: Ports,
    *,
    kind: str = "displacement",
    at: StateLike = None,
    without: Sequence[str] = (),
) -> StateSpace:
    """A = [[0, 1], [-M^-1 S, -M^-1 D]], B = [0; M^-1 F], C = [L, 0] (velocity C A, acceleration C A^2 and C A B).

    Parameters
    ----------
    m
        A `Model` (linearised at ``at``), a linearised model, or a `MechanicalSystem`.
    inputs, outputs
        As in `mb.frf`; outputs in m or rad and their derivatives, inputs in N or N m, motions of the base in m or rad.
    kind
        "displacement", "velocity" or "acceleration" of the outputs.
    at, without
        State to linearise at; effects to leave out.

    Returns
    -------
    StateSpace
        Unpackable as ``A, B, C, D``.

    Raises
    ------
    SingularError
        A singular mass matrix.
    ModelError
        An output that would need a derivative of an input, such as the acceleration of a body that a damper connects to
        a moving base.

    Notes
    -----
    Equations: docs/theory.md (7.4).
    Cost O(n^3).

    Examples
    --------
    >>> import mbrs as mb
    >>> A, B, C, D = mb.state_space(mb.MechanicalSystem(M=[[2.0]], K=[[8.0]]), inputs=0, outputs=0)
    >>> A.tolist()
    [[0.0, 1.0], [-4.0, -0.0]]
    """
    return first_order(linear_system(m, inputs, outputs, at, without), kind)
