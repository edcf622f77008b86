"""Figure of the shapes of an elastic body."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ModelError
from .figure import PALETTE, figure, legend, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot"]

_MOST = 12


def plot(body: Any, modes: Sequence[int] | None = None) -> Figure:
    """Displacement of the points along a `ModalBody`, one pair of axes for each modal coordinate.

    Parameters
    ----------
    body
        A `ModalBody`.
    modes
        Indices of modal coordinates; the first twelve by default.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ModelError
        No such mode, or a body without points to draw.

    Examples
    --------
    >>> import mbrs as mb
    >>> len(mb.flexible.beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=4.0, modes=3).plot().axes)
    3
    """
    wanted = list(range(min(body.n_modes, _MOST))) if modes is None else list(modes)
    if not wanted or any(not 0 <= k < body.n_modes for k in wanted):
        raise ModelError(f"modes must be indices from 0 to {body.n_modes - 1}, got {wanted}")
    points = body.line_position
    if len(points) < 2:
        raise ModelError("this body has no points to draw: give it nodes, or line_position= and line_shape=")
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    columns = min(3, len(wanted))
    rows = -(-len(wanted) // columns)
    frequencies = body.K.diagonal() / body.M.diagonal()
    with style():
        made, axes = figure(rows, columns, size=(3.6 * columns + 1.0, 1.0 + 2.0 * rows), sharex=True, squeeze=False)
        for place, k in zip(axes.flat, wanted, strict=False):
            for i, name in enumerate("xyz"):
                place.plot(along, body.line_shape[:, i, k], color=PALETTE[i], label=name)
            place.axhline(0.0, color="#9aa7b5", lw=0.7)
            place.set_title(f"q{k + 1}, {np.sqrt(max(frequencies[k], 0.0)) / (2 * np.pi):.4g} Hz")
        for i, place in enumerate(axes.flat):
            place.set_visible(i < len(wanted))
            if i < len(wanted) <= i + columns:  # the lowest of its column
                place.set_xlabel("along the body [m]")
                place.tick_params(labelbottom=True)
        legend(axes.flat[0], ["x", "y", "z"])
    return made
