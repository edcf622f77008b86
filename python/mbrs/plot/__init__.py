"""Figures of results. Each function returns the matplotlib ``Figure``, one of pyplot unless ``ax=`` was given."""

from __future__ import annotations

from .campbell_diagram import campbell
from .linear import frf, modes, response
from .studies import accuracy, effects, tornado

__all__ = ["accuracy", "campbell", "effects", "frf", "modes", "response", "tornado"]
