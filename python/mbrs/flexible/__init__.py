"""Elastic bodies as mode shapes with their inertia integrals, for `Model.flexible_body`."""

from __future__ import annotations

from .beam import beam
from .craig_bampton import craig_bampton
from .from_file import from_file
from .modal_body import ModalBody

__all__ = ["ModalBody", "beam", "craig_bampton", "from_file"]
