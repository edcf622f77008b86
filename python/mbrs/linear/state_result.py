"""Shared parts of results that are a state of a model: its bodies and where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.names import index
from .linearization import Linearization

if TYPE_CHECKING:
    from ..model.aliases import BodyLike
    from ..model.model import Model


class StateResult:
    """A state with the exact linearisation there; base of `Equilibrium` and `SteadyMotion`."""

    linearization: Linearization

    @property
    def model(self) -> Model:
        """The model this belongs to."""
        return self.linearization.model

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies, in the order of `poses`."""
        return self.linearization.bodies

    @property
    def poses(self) -> dict[str, np.ndarray]:
        """Position (n, 3), rotation (n, 3, 3), velocity and angular velocity (n, 3) of the bodies' origins, world, m and rad/s."""
        return self.linearization.poses

    def position(self, body: BodyLike) -> np.ndarray:
        """(3,) world position of a body's origin, m."""
        return np.asarray(self.poses["position"][index("no body", body, self.bodies)])

    def rotation(self, body: BodyLike) -> np.ndarray:
        """(3, 3) rotation matrix of a body, body to world."""
        return np.asarray(self.poses["rotation"][index("no body", body, self.bodies)])
