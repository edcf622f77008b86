"""Warnings that show the line of the user's script that led to them, however deep in the package they arise."""

from __future__ import annotations

import sys
import warnings
from types import FrameType

from ..errors import MbrsWarning


def warn_user(what: str | Warning, category: type[Warning] = MbrsWarning) -> None:
    """Warn of ``what``, at the innermost line that is not of this package."""
    frame: FrameType | None = sys._getframe(1)
    level = 2
    while frame is not None and _of_package(frame):
        frame, level = frame.f_back, level + 1
    warnings.warn(what, category, stacklevel=level - 1 if frame is None else level)


def _of_package(frame: FrameType) -> bool:
    return str(frame.f_globals.get("__name__", "")).startswith("mbrs.")
