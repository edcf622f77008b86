"""Figures of matrices and of what modes are made of: linearisations, state spaces, energy shares, modes of rotors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .figure import canvas, colours, figure, legend, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["eigenvalues", "energy_shares", "matrices", "rotor_modes"]

_MOST_TICKS = 40


def matrices(lin: Any, *, ax: Axes | None = None) -> Figure:
    """Size of the entries |a_ij| over sqrt(|a_ii a_jj|) of each matrix that is there; with ``ax`` those of K."""
    present = [name for name in "MCGKN" if getattr(lin, name) is not None]
    with style():
        if ax is None:
            made, panels = figure(1, len(present), size=(3.4 * len(present) + 1.0, 4.0), squeeze=False)
            panels = panels[0]
        else:
            made, panels, present = ax.figure, [ax], ["K"]
        for axes, name in zip(panels, present, strict=True):
            picture = _cells(axes, _scaled(np.abs(getattr(lin, name))), "Blues")
            _ticks(axes, lin.coordinates)
            axes.set_xticks(())
            axes.set_title(name)
        if ax is None:
            made.colorbar(picture, ax=panels[-1], fraction=0.05, pad=0.03)
    return made


def energy_shares(shares: Any, *, ax: Axes | None = None) -> Figure:
    """Shares of kinetic and strain energy of each mode as coloured cells; with ``ax`` those of the kinetic energy."""
    parts = shares.parts()
    with style():
        if ax is None:
            rows = sum(min(len(names), _MOST_TICKS) for _, names, _ in parts)
            made, panels = figure(1, 2, size=(10.0, 2.4 + 0.14 * rows))
        else:
            made, panels, parts = ax.figure, [ax], parts[:1]
        for axes, (title, names, values) in zip(panels, parts, strict=True):
            picture = _cells(axes, 100.0 * np.asarray(values, dtype=float), "Blues", 100.0)
            _ticks(axes, names)
            n = values.shape[1]
            every = max(1, -(-n // 16))
            axes.set_xticks(np.arange(0, n, every), [str(i + 1) for i in range(0, n, every)])
            axes.set(xlabel="mode", title=f"{title} [%]")
        if ax is None:
            made.colorbar(picture, ax=panels[-1], fraction=0.05, pad=0.03)
    return made


def eigenvalues(space: Any, *, ax: Axes | None = None) -> Figure:
    """Eigenvalues of A in the complex plane."""
    s = np.linalg.eigvals(space.A)
    with style():
        made, axes = canvas(ax, (6.0, 4.8))
        axes.plot(s.real, s.imag / (2 * np.pi), "o", color=colours(axes, 1)[0], ms=6, mew=0)
        axes.axvline(0.0, color="#9aa7b5", lw=0.8)
        axes.margins(0.15)
        axes.set(xlabel="Re s [rad/s]", ylabel="Im s / 2 pi [Hz]", title=f"eigenvalues of {len(space.states)} states")
    return made


def rotor_modes(result: Any, *, ax: Axes | None = None) -> Figure:
    """Frequencies as a fixed observer sees them (filled) and in the turning frame (rings), coloured by family."""
    families = list(dict.fromkeys(result.family))
    with style():
        made, axes = canvas(ax)
        for family, colour in zip(families, colours(axes, len(families)), strict=True):
            chosen = np.array([f == family for f in result.family])
            axes.plot(result.numbers[chosen], result.frequency[chosen], "o", mfc="white", mec=colour, ms=8)
            axes.plot(result.numbers[chosen], result.fixed[chosen], "o", color=colour, ms=6, mew=0, label=family)
        axes.plot([], [], "o", mfc="white", mec="#33404e", ms=8, ls="none", label="turning frame")
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.set(xlabel="mode", ylabel="f [Hz]", title="modes of the rotor")
        legend(axes)
    return made


def _scaled(size: np.ndarray) -> np.ndarray:
    """Entries over the root of the product of their diagonal entries (of the largest of row and column where these vanish)."""
    d = np.diag(size)
    d = np.where(d > 0.0, d, np.max(size, axis=0, initial=0.0))
    scale = np.sqrt(np.outer(d, d))
    return np.divide(size, scale, out=np.zeros_like(size), where=scale > 0.0)


def _cells(axes: Any, values: np.ndarray, colours_: str, top: float = 1.0) -> Any:
    picture = axes.imshow(values, aspect="auto", cmap=colours_, vmin=0.0, vmax=top, interpolation="nearest")
    axes.grid(False)
    return picture


def _ticks(axes: Any, names: Any) -> None:
    if len(names) <= _MOST_TICKS:
        axes.set_yticks(range(len(names)), names, fontsize=8 if len(names) <= 20 else 6)
