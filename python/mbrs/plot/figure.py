"""The one place that touches matplotlib: figures without a display, a common look, legends that do not cover curves."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from ..errors import MbrsError

__all__ = ["FADED", "PALETTE", "MissingExtraError", "figure", "legend", "log_frequencies", "style"]

PALETTE = ("#1f5fa8", "#d9662b", "#2e8b57", "#8e4fa8", "#b8860b", "#c2334d", "#3a9bb3", "#6b7280", "#5b7f1e", "#a0522d")
FADED = "#b8c2cc"

_STYLE = {
    "font.size": 10.0,
    "axes.grid": True,
    "grid.color": "#e4e9ef",
    "axes.axisbelow": True,
    "axes.edgecolor": "#9aa7b5",
    "axes.labelcolor": "#33404e",
    "xtick.color": "#4b5968",
    "ytick.color": "#4b5968",
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "figure.dpi": 110.0,
}


class MissingExtraError(MbrsError, ImportError):
    """An optional package is not installed; the message says how to install it."""


@contextmanager
def style() -> Iterator[None]:
    """The look of mbrs, for the block only: nothing of the user's own settings changes."""
    with _matplotlib().rc_context(_STYLE):
        yield


def figure(
    rows: int = 1, columns: int = 1, *, size: tuple[float, float] = (8.0, 4.5), **options: Any
) -> tuple[Any, Any]:
    """A figure and its axes (one, or an array as from ``subplots``, which ``options`` go to). ``size`` in inches.

    In an interactive session with pyplot in use the figure is pyplot's, so that it shows; otherwise it has a canvas of
    its own.
    """
    matplotlib = _matplotlib()
    if "matplotlib.pyplot" in sys.modules and matplotlib.is_interactive():
        made = sys.modules["matplotlib.pyplot"].figure(figsize=size, layout="constrained")
    else:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        made = Figure(figsize=size, layout="constrained")
        FigureCanvasAgg(made)
    return made, made.subplots(rows, columns, **options)


def legend(axes: Any, labels: Sequence[str], *, inside: int = 4) -> None:
    """A legend for the labelled curves: inside for a few short ones, beside the axes for more."""
    if len(labels) == 0:
        return
    if len(labels) > inside or max(len(label) for label in labels) > 28:
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    else:
        axes.legend(loc="best")


def log_frequencies(axes: Any) -> None:
    """A logarithmic x axis whose ticks read 1, 2, 5, 10 instead of powers, as long as there are few decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    low, high = axes.get_xlim()
    if high <= 5e3 * low:
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())


def _matplotlib() -> Any:
    try:
        import matplotlib
    except ImportError:
        raise MissingExtraError(
            "plots need matplotlib, which is not installed; install it with: pip install 'mbrs-dynamics[plot]'"
        ) from None
    return matplotlib
