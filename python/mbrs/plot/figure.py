"""The one place that touches matplotlib: figures of pyplot, a common look, colours and legends of several results."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["FADED", "PALETTE", "canvas", "colours", "figure", "from_the_top", "legend", "log_frequencies", "style"]

PALETTE = ("#1f5fa8", "#d9662b", "#2e8b57", "#8e4fa8", "#b8860b", "#c2334d", "#3a9bb3", "#6b7280", "#5b7f1e", "#a0522d")
FADED = "#b8c2cc"

_STYLE: Any = {
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


@contextmanager
def style() -> Iterator[None]:
    """The look of mbrs, for the block only: nothing of the user's own settings changes."""
    import matplotlib

    with matplotlib.rc_context(_STYLE):
        yield


def figure(
    rows: int = 1, columns: int = 1, *, size: tuple[float, float] = (8.0, 4.5), **options: Any
) -> tuple[Any, Any]:
    """A figure of pyplot, so that ``plt.show()`` shows it, and its axes: one, or an array as from ``subplots``, which
    ``options`` go to. ``size`` in inches. ``plt.close(figure)`` gives its memory back.
    """
    import matplotlib.pyplot as plt

    made = plt.figure(figsize=size, layout="constrained")
    return made, made.subplots(rows, columns, **options)


def canvas(ax: Axes | None, size: tuple[float, float] = (7.0, 4.4)) -> tuple[Any, Any]:
    """The figure and axes to draw into: those of ``ax``, or new ones."""
    return figure(size=size) if ax is None else (ax.figure, ax)


def colours(axes: Any, count: int) -> list[str]:
    """Colours for so many curves, others than those that results already in these axes have."""
    first = getattr(axes, "_mbrs_curves", 0)
    axes._mbrs_curves = first + count
    return [PALETTE[(first + i) % len(PALETTE)] for i in range(count)]


def legend(axes: Any, labels: Sequence[str] | None = None, *, inside: int = 4) -> None:
    """A legend for all labelled curves, each label once: inside for a few short ones, beside the axes for more.

    ``labels``: the curves just drawn; without any, and without others in the axes, there is no legend.
    """
    handles = _told_apart(axes)
    if not handles:
        return
    if len(handles) > inside or max(len(label) for label in handles) > 28:
        axes.legend(handles.values(), handles, loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0)
    else:
        axes.legend(handles.values(), handles, loc="best")


def _told_apart(axes: Any) -> dict[str, Any]:
    """Handles by label, each once; the same label in another colour belongs to the next result and is numbered."""
    found: dict[str, dict[Any, Any]] = {}
    for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
        one = handle.patches[0] if hasattr(handle, "patches") else handle
        colour = one.get_facecolor() if hasattr(one, "get_facecolor") else one.get_color()
        found.setdefault(label, {}).setdefault(str(colour), handle)
    return {
        label if i == 0 else f"{label} ({i + 1})": handle
        for label, own in found.items()
        for i, handle in enumerate(own.values())
    }


def from_the_top(axes: Any) -> None:
    """The first of the named rows of an axes on top, however many results are drawn into it."""
    if not axes.yaxis_inverted():
        axes.invert_yaxis()


def log_frequencies(axes: Any) -> None:
    """A logarithmic x axis whose ticks read 1, 2, 5, 10 instead of powers, as long as there are few decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    low, high = axes.get_xlim()
    if high <= 5e3 * low:
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
