"""Error of modes by the meshes and shapes of flexible bodies: the same modes of bodies that are made finer."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from ..model.flexible import FlexibleBody
from .equilibrium import equilibrium

if TYPE_CHECKING:
    from .modal_result import ModalResult


def discretisation(result: ModalResult, modes: Callable[..., ModalResult]) -> np.ndarray:
    """(n,) relative change of each frequency where elements are halved and shapes more than doubled; nan for rigid modes.

    ``modes`` is `mbrs.modes`.
    """
    model = getattr(result.system, "model", None)
    if model is None:
        raise ModelError("modes of plain matrices do not know the mesh that made them; take modes of a Model")
    frequency, rigid = result.frequency, result.kind == "rigid"
    if not any(isinstance(b, FlexibleBody) for b in model.bodies):
        return np.where(rigid, np.nan, 0.0)
    state, without = result.system.state, result.system.without
    if state.kind not in ("drawn", "equilibrium"):
        raise ModelError(
            f"the discretisation of modes is known of models as they are drawn and at equilibria, not at a {state.kind} state"
        )
    fine = finer(model)
    at = equilibrium(fine, without=without) if state.kind == "equilibrium" else None
    better = modes(fine, at=at, n=result.n, without=without, shift=result.shift).frequency
    return np.where(rigid, np.nan, np.abs(better - frequency) / np.where(rigid, 1.0, frequency))


def finer(model: Any) -> Any:
    """A copy of a model, its flexible bodies of half the element length and with more than twice the shapes."""
    made = model.copy()
    for body in made.bodies:
        if isinstance(body, FlexibleBody):
            body.refine()
    return made
