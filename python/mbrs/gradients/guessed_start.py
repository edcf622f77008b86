"""Starts from a first guess: where ``pose=`` decides what assembly leaves free, its derivative is missing, and that is said."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import NotDifferentiableError
from ..linear.linearize import Snapshot
from ..motion.quantities import Asked
from ..system.state import state_of

if TYPE_CHECKING:
    from ..system.tables import Directions
    from .gradient import Run

_STEP = 1e-5
# Differences of the start that are off by more than this (relative) show a start that moves otherwise than its derivative says.
_OFF = 1e-4


def require_followed_guess(run: Run, along: Directions) -> None:
    """Compare the derivative of a start that first guesses (``pose=``) led to with differences of the assembly.

    Raises
    ------
    NotDifferentiableError
        A parameter that moves the start through the guess; names it. Two assemblies for each parameter, where there are guesses.
    """
    if run.state.kind != "drawn" or not run.model.poses:
        return
    asked: list[Asked] = []
    for body in range(len(run.model.bodies)):
        asked += [("point", body, 0, None, None), ("rotation", body, 0, None, None)]
    start = replace(run, times=run.times[:1])
    exact = start.direct(asked, along)["derivatives"][0]
    x = np.array(run.snapshot.tables["x"], dtype=float)
    for p, label in enumerate(along.labels):
        way = along.dense[:, p]
        if not way.any():
            continue
        size = _STEP * max(1.0, float(np.abs(x[way != 0.0]).max())) / float(np.abs(way).max())
        ends = [_values(start, x + side * size * way, asked) for side in (1.0, -1.0)]
        difference = (ends[0] - ends[1]) / (2.0 * size)
        floor = 1e-12 * float(np.abs(ends[0]).max(initial=1.0)) / size
        if (
            np.abs(difference - exact[:, p]).max()
            > _OFF * np.abs(difference).max() + floor + _OFF * np.abs(exact[:, p]).max()
        ):
            raise NotDifferentiableError(
                f"{label!r} moves the start through the first guess pose= of a body, of which there is no derivative: draw the bodies "
                "where they start, or begin at a state or an equilibrium with at="
            )


def _values(run: Run, x: np.ndarray, asked: list[Asked]) -> np.ndarray:
    system = run.snapshot.system.with_values(x)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        state = state_of(run.model, system, None, hold=False, without=run.without)
    moved = Snapshot(run.model, system, run.snapshot.versions, run.snapshot.tables)
    found: np.ndarray = replace(run, snapshot=moved, state=state).direct(asked, None)["values"][0]
    return found
