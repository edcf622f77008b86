"""From what a user gives to the linear analyses, a model, its linearisation or matrices, to one linear system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .._lib.checks import one_or_names
from ..errors import ModelError
from .linear_system import LinearSystem, assembled
from .linearize import second_order_of
from .matrices import EFFECT_OF, MechanicalSystem, check_matrix_effects


def second_order(m: Any, at: Any, without: Sequence[str]) -> tuple[Any, tuple[str, ...]]:
    """The object that holds M, C, G, K, N, coordinates and maps, and the effects that are on in it."""
    without = one_or_names("without", without)
    if isinstance(m, MechanicalSystem):
        if at is not None:
            raise ModelError("at= is for models; a MechanicalSystem has no other state than its matrices")
        check_matrix_effects(without)
        system: Any = m.leaving_out(frozenset(k for k, e in EFFECT_OF.items() if e in without))
    elif hasattr(m, "input_map"):
        if at is not None or without:
            raise ModelError("at= and without= belong to the call of mb.linearize that made this linear system")
        system = m
    elif hasattr(m, "bodies") or hasattr(m, "ground"):
        system = second_order_of(m, at, without)
    else:
        raise ModelError(f"expected a Model or a MechanicalSystem, got {type(m).__name__}")
    return system, tuple(e for k, e in EFFECT_OF.items() if getattr(system, k) is not None)


def linear_system(
    m: Any, inputs: Any, outputs: Any, at: Any, without: Sequence[str], relaxing: bool = False
) -> LinearSystem:
    """The matrices and maps for these inputs and outputs; ``relaxing``: the caller knows states of laws that relax."""
    system, effects = second_order(m, at, without)
    return assembled(system, effects, inputs, outputs, relaxing)
