"""Results as figures see them: the quantities that each figure draws."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

import numpy as np


class HasModes(Protocol):
    """Modes, computed or measured."""

    @property
    def eigenvalue(self) -> np.ndarray:
        """Roots (n,), 1/s."""

    @property
    def frequency(self) -> np.ndarray:
        """Natural frequencies (n,), Hz."""

    @property
    def damping(self) -> np.ndarray:
        """Damping ratios (n,)."""

    @property
    def shape(self) -> np.ndarray:
        """Shapes (dof, n)."""


class HasTransfer(Protocol):
    """A transfer function."""

    @property
    def frequency(self) -> np.ndarray:
        """Points (n_freq,), Hz."""

    @property
    def value(self) -> np.ndarray:
        """Values (n_out, n_in, n_freq), complex."""


class HasOutputs(Protocol):
    """Outputs over time."""

    @property
    def t(self) -> np.ndarray:
        """Times (n_t,), s."""

    @property
    def value(self) -> np.ndarray:
        """Values (n_out, n_t)."""


class HasWhirl(Protocol):
    """Natural frequencies over the speed of rotation."""

    @property
    def speed(self) -> np.ndarray:
        """Speeds (n_s,)."""

    @property
    def frequency(self) -> np.ndarray:
        """Natural frequencies (n_s, n), Hz."""


class HasFrequencyRates(Protocol):
    """Derivatives of natural frequencies by parameters."""

    @property
    def frequency(self) -> np.ndarray:
        """Derivatives (n, n_p), Hz per unit of the parameter."""

    @property
    def labels(self) -> Sequence[str]:
        """Names of the parameters."""

    @property
    def units(self) -> Sequence[str]:
        """Units of the parameters."""


class TimedRun(Protocol):
    """A run of a study of accuracy."""

    @property
    def time(self) -> float:
        """Wall time, s."""

    @property
    def error(self) -> float:
        """Measured error."""

    @property
    def text(self) -> str:
        """The numeric settings, short."""

    @property
    def numeric(self) -> Mapping[str, float]:
        """The numeric settings by name."""


class HasLines(Protocol):
    """A study of accuracy and time."""

    @property
    def measure(self) -> str:
        """Name of the distance between two results."""

    def lines(self) -> Iterable[tuple[str, Sequence[TimedRun]]]:
        """A label and its runs for each categorical setting."""


class WithoutEffect(Protocol):
    """A run without one effect."""

    @property
    def effect(self) -> str:
        """Its name."""

    @property
    def change(self) -> float:
        """Change of the result."""

    @property
    def saved(self) -> float:
        """Part of the time that is saved."""


class HasEffectRuns(Protocol):
    """A study of effects."""

    @property
    def measure(self) -> str:
        """Name of the distance between two results."""

    @property
    def runs(self) -> Sequence[WithoutEffect]:
        """One run for each effect."""
