"""Types of the arguments that users give."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from .book import Attachable, Item
from .expressions import Expression
from .parameters import ArrayParameter

# A number, or an expression of parameters.
Scalar = float | int | np.floating[Any] | np.integer[Any] | Expression
# Any sequence or array of them; the argument's description says how many.
Vector = Sequence[Scalar] | np.ndarray | ArrayParameter
Vector3 = Vector
Matrix = Sequence[Vector] | np.ndarray | ArrayParameter
# "x", "-y", ... or three numbers.
Axis = str | Vector3
# One point (3,), or (P_a, P_b).
Points = Vector3 | tuple[Vector3, Vector3] | Sequence[Vector3]
# A quaternion (4,), scalar first, or a matrix (3, 3), body to world.
Rotation = Vector | Matrix
# One number where there is one free coordinate, else one for each; a matrix of a bushing.
Coefficients = Scalar | Vector | Matrix
# (origin, orientation); None is the identity.
PoseLike = tuple[Vector3, Rotation | None] | Sequence[Any]
# A handle or its name; "ground", "body.node".
BodyLike = Attachable | str
# Any handle of a model (body, joint, element, marker, drive), or its name.
ItemLike = Item | Attachable | str
# One, several, or those that matter most.
Items = ItemLike | Sequence[ItemLike] | None


class LawLike(Protocol):
    """A law: its code and its numbers, as `mbrs.Cubic` and the others have them."""

    @property
    def code(self) -> int:
        """Code of the kind in the Tables."""

    @property
    def values(self) -> Sequence[Any]:
        """Its numbers."""


# A function of (t, u, v) becomes a law; keys are names of coordinates, or tuples of them.
Laws = LawLike | Callable[..., Any] | Sequence[Any] | Mapping[Any, Any]
TimeFunctionLike = Callable[[float], Any]
