"""Figures of results. Each function returns the matplotlib ``Figure``, one of pyplot unless ``ax=`` was given."""

from __future__ import annotations

from .linear import campbell, frf, modes, response
from .studies import accuracy, effects, tornado

__all__ = ["accuracy", "campbell", "effects", "frf", "modes", "response", "tornado"]
