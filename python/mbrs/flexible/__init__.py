"""Elastic bodies as mode shapes with their inertia integrals, for `Model.flexible_body`."""

from __future__ import annotations

from .beams import beam
from .component_modes import craig_bampton
from .file_bodies import from_file
from .modal_body import ModalBody

__all__ = ["ModalBody", "beam", "craig_bampton", "from_file"]
