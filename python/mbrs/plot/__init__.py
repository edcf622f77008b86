"""Figures of results. Each function returns a matplotlib ``Figure`` without a display; it is imported when used."""

from __future__ import annotations

from .figure import MissingExtraError
from .linear import campbell, frf, modes, response
from .studies import accuracy, effects, tornado

__all__ = ["MissingExtraError", "accuracy", "campbell", "effects", "frf", "modes", "response", "tornado"]
