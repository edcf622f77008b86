"""Charts as inline SVG with nothing but the standard library and NumPy, so that `mbrs demo` needs no more."""

from __future__ import annotations

import html
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import ModelError
from ..plot.data import breaks_at_jumps, frf_unit, magnitude_label, ranked_curves, tornado_bars
from ..report import number

__all__ = ["PALETTE", "Line", "bode", "line_chart", "tornado"]

PALETTE = ("#1f5fa8", "#d9662b", "#2e8b57", "#8e4fa8", "#b8860b", "#c2334d", "#3a9bb3", "#6b7280")
_WIDTH = 1000
_LEFT, _RIGHT, _TOP, _BOTTOM = 92, 24, 34, 50
_INK, _FAINT, _GRID = "#33404e", "#66727f", "#e4e9ef"
_MOST_POINTS = 1500


@dataclass(frozen=True, eq=False)
class Line:
    """One curve: ``x`` and ``y`` (n,); nan breaks it. ``dashed`` tells a companion curve apart from its colour mate."""

    x: Any
    y: Any
    label: str = ""
    dashed: bool = False
    mate: int | None = None  # the number of the curve whose colour it shares


@dataclass(frozen=True)
class _Axis:
    """A scale from data to pixels with its ticks."""

    low: float
    high: float
    log: bool
    start: float
    end: float

    def place(self, values: Any) -> Any:
        values = np.asarray(values, dtype=float)
        low, high = self.low, self.high
        if self.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                values = np.log10(np.where(values > 0.0, values, np.nan))
            low, high = math.log10(low), math.log10(high)
        return self.start + (values - low) / (high - low) * (self.end - self.start)

    def ticks(self) -> list[float]:
        return _log_ticks(self.low, self.high) if self.log else _linear_ticks(self.low, self.high)


def line_chart(
    lines: Iterable[Line],
    *,
    x_label: str,
    y_label: str,
    x_log: bool = False,
    y_log: bool = False,
    title: str = "",
    y_ticks: Sequence[float] | None = None,
    marks: Sequence[float] = (),
    height: int = 320,
) -> str:
    """Curves over a common axis as an SVG fragment.

    Parameters
    ----------
    lines
        The curves; points that are nan, or not above 0 on a logarithmic axis, leave a gap.
    x_label, y_label, title
        Texts, escaped here.
    x_log, y_log
        Logarithmic axes.
    y_ticks
        Where the ticks of y are, which also sets its range; None chooses.
    marks
        Places on x marked by a vertical line, such as natural frequencies.
    height
        In pixels of a chart 1000 wide; it scales with the page.

    Raises
    ------
    ModelError
        No curve with a point that can be drawn.

    Examples
    --------
    >>> line_chart([Line([1, 2, 3], [1, 4, 9])], x_label="x", y_label="y").startswith("<svg")
    True
    """
    kept = [_drawable(line, x_log, y_log) for line in lines]
    kept = [line for line in kept if line.x.size]
    rows = _legend_rows([line.label for line in kept], title)
    top = _TOP + 20 * (len(rows) - 1) if rows else _TOP if title else 10
    height += top - _TOP
    if not kept:
        raise ModelError("there is nothing to draw: no curve has a finite point (above 0 on a logarithmic axis)")
    x_axis = _axis([line.x for line in kept], x_log, _LEFT, _WIDTH - _RIGHT, tight=True)
    y_axis = _axis([line.y for line in kept] if y_ticks is None else [np.asarray(y_ticks, dtype=float)], y_log,
                   height - _BOTTOM, top, tight=y_ticks is not None)  # fmt: skip
    parts = [_frame(x_axis, y_axis, top, height, x_label, y_label, title, y_ticks)]
    parts += [_mark(float(x_axis.place(m)), top, height) for m in marks if x_axis.low <= m <= x_axis.high]
    colours = [PALETTE[(i if line.mate is None else line.mate) % len(PALETTE)] for i, line in enumerate(kept)]
    parts += [_path(line, x_axis, y_axis, colour) for line, colour in zip(kept, colours, strict=True)]
    parts += [_legend(row, 20 + 20 * i) for i, row in enumerate(rows)]
    return _svg(height, title or y_label, parts)


def bode(result: Any, *, marks: Sequence[float] = (), most: int = 8) -> str:
    """Magnitude and phase of an `FrfResult` over frequency, as two SVG charts; at most ``most`` curves, the largest.

    ``marks`` (Hz) draws vertical lines, such as natural frequencies. The phase is that of exp(+i omega t), in degrees.
    """
    kept, rounding = ranked_curves(result)
    chosen = kept[:most]
    frequency = np.asarray(result.frequency, dtype=float)
    logarithmic = bool(frequency.min() > 0.0 and frequency.max() > 20.0 * frequency.min())
    unit = frf_unit(result)
    common: dict[str, Any] = {"x_label": "frequency [Hz]", "x_log": logarithmic, "marks": marks}
    size = [Line(frequency, np.abs(c.value), c.label) for c in chosen]
    title = str(getattr(result, "kind", "magnitude")) + (f" (left out as zero: {rounding})" if rounding else "")
    above = line_chart(size, y_label=magnitude_label(unit), y_log=True, title=title, **common)
    phase = [Line(frequency, breaks_at_jumps(np.degrees(np.angle(c.value)), 270.0)) for c in chosen]
    below = line_chart(phase, y_label="phase [deg]", y_ticks=(-180, -90, 0, 90, 180), height=220, **common)
    return above + below


def tornado(sensitivity: Any, mode: int = 0, *, most: int = 12, title: str = "") -> str:
    """Bars of the change of one natural frequency for a small change of each parameter, the largest on top."""
    bars = tornado_bars(sensitivity, mode, most)
    if not bars:
        raise ModelError("there is nothing to draw: no parameter has a value other than 0 and a finite derivative")
    row, left, right = 34, 320, 130
    height = _TOP + row * len(bars) + _BOTTOM
    reach = max(abs(bar.value) for bar in bars) or 1.0
    signs = [min(min(bar.value for bar in bars), 0.0), max(max(bar.value for bar in bars), 0.0)]
    if signs[0] == signs[1]:
        signs = [-reach, reach]
    # a value is written beyond the end of its bar, on the negative side as well
    axis = _Axis(signs[0], signs[1], False, left + (100 if signs[0] < 0 else 0), _WIDTH - right)
    zero = float(axis.place(0.0))
    parts = [_text(18, 20, title or f"mode {mode + 1}: change of the natural frequency", weight=600)]
    bottom = _TOP + row * len(bars)
    for tick in axis.ticks():
        at = float(axis.place(tick))
        parts.append(f'<line x1="{at:.1f}" y1="{_TOP}" x2="{at:.1f}" y2="{bottom}" stroke="{_GRID}"/>')
        parts.append(_text(at, bottom + 18, _label(tick), anchor="middle", fill=_FAINT))
    for i, bar in enumerate(bars):
        parts += _bar(bar, i, row, axis, zero)
    parts.append(f'<line x1="{zero:.1f}" y1="{_TOP}" x2="{zero:.1f}" y2="{bottom}" stroke="{_INK}"/>')
    parts.append(_text((axis.start + axis.end) / 2, bottom + 40, "change of f [Hz]", anchor="middle"))
    return _svg(height, title or "tornado", parts)


def _bar(bar: Any, i: int, row: int, axis: _Axis, zero: float) -> list[str]:
    end, top = float(axis.place(bar.value)), _TOP + i * row
    colour = PALETTE[0] if bar.value >= 0 else PALETTE[1]
    anchor, away = ("start", 6) if bar.value >= 0 else ("end", -6)
    middle = top + row / 2 + 4
    return [
        f'<rect x="{min(zero, end):.1f}" y="{top + 5}" width="{max(abs(end - zero), 0.5):.1f}" height="{row - 10}" '
        f'fill="{colour}" rx="2"/>',
        _text(308, top + row / 2 - 1, _cut(bar.label, 40), anchor="end"),
        _text(308, top + row / 2 + 11, _cut(bar.change, 46), anchor="end", fill=_FAINT, size=10.5),
        _text(end + away, middle, number(bar.value, 3), anchor=anchor, fill=_FAINT),
    ]


def _drawable(line: Line, x_log: bool, y_log: bool) -> Line:
    x, y = np.ravel(np.asarray(line.x, dtype=float)), np.ravel(np.asarray(line.y, dtype=float))
    if x.shape != y.shape:
        raise ModelError(f"curve {line.label!r} has {x.size} places but {y.size} values")
    good = np.isfinite(x) & np.isfinite(y) & ((x > 0.0) | (not x_log)) & ((y > 0.0) | (not y_log))
    if not good.any():
        return Line(x[:0], y[:0], line.label, line.dashed, line.mate)
    return Line(np.where(good, x, np.nan), np.where(good, y, np.nan), line.label, line.dashed, line.mate)


def _axis(groups: Sequence[np.ndarray], log: bool, start: float, end: float, *, tight: bool) -> _Axis:
    low = min(float(np.nanmin(g)) for g in groups)
    high = max(float(np.nanmax(g)) for g in groups)
    if log:
        if high / low < 1.0 + 1e-9:
            low, high = low / 2.0, high * 2.0
        room = 1.0 if tight else (high / low) ** 0.04
        return _Axis(low / room, high * room, True, start, end)
    if high - low <= 1e-12 * max(abs(high), abs(low)):
        spread = abs(high) if high else 1.0
        low, high = low - spread, high + spread
    room = 0.0 if tight else 0.05 * (high - low)
    return _Axis(low - room, high + room, False, start, end)


def _linear_ticks(low: float, high: float, most: int = 8) -> list[float]:
    raw = (high - low) / most
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * factor for factor in (1.0, 2.0, 2.5, 5.0, 10.0) if raw <= power * factor * (1.0 + 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [round(k * step, 12 - math.floor(math.log10(step))) for k in range(first, last + 1)]


def _log_ticks(low: float, high: float) -> list[float]:
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    decades = last - first
    factors = (1, 2, 5) if decades <= 3 else (1,)
    every = max(1, math.ceil(decades / 10))
    ticks = [f * 10.0**k for k in range(first, last + 1, every) for f in factors]
    inside = [t for t in ticks if low * (1 - 1e-9) <= t <= high * (1 + 1e-9)]
    return inside if len(inside) >= 2 else _linear_ticks(low, high, 5)


def _frame(
    x: _Axis, y: _Axis, top: int, height: int, x_label: str, y_label: str, title: str, y_ticks: Sequence[float] | None
) -> str:
    bottom, right = height - _BOTTOM, _WIDTH - _RIGHT
    parts = []
    for tick in x.ticks():
        at = float(x.place(tick))
        parts.append(f'<line x1="{at:.1f}" y1="{top}" x2="{at:.1f}" y2="{bottom}" stroke="{_GRID}"/>')
        parts.append(_text(at, bottom + 18, _label(tick, x.log), anchor="middle", fill=_FAINT))
    for tick in y.ticks() if y_ticks is None else y_ticks:
        at = float(y.place(tick))
        parts.append(f'<line x1="{_LEFT}" y1="{at:.1f}" x2="{right}" y2="{at:.1f}" stroke="{_GRID}"/>')
        parts.append(_text(_LEFT - 8, at + 4, _label(tick, y.log), anchor="end", fill=_FAINT))
    parts.append(
        f'<rect x="{_LEFT}" y="{top}" width="{right - _LEFT}" height="{bottom - top}" fill="none" stroke="#9aa7b5"/>'
    )
    parts.append(_text((_LEFT + right) / 2, height - 10, x_label, anchor="middle"))
    middle = (top + bottom) / 2
    parts.append(f'<g transform="translate(20 {middle:.1f}) rotate(-90)">{_text(0, 0, y_label, anchor="middle")}</g>')
    if title:
        parts.append(_text(_LEFT, 20, title, weight=600))
    return "".join(parts)


def _mark(at: float, top: int, height: int) -> str:
    ends = f'x1="{at:.1f}" y1="{top}" x2="{at:.1f}" y2="{height - _BOTTOM}"'
    return f'<line {ends} stroke="#9aa7b5" stroke-dasharray="3 4"/>'


def _path(line: Line, x_axis: _Axis, y_axis: _Axis, colour: str) -> str:
    x, y = x_axis.place(line.x), y_axis.place(line.y)
    x, y = _thinned(x, y)
    pieces, pen_up = [], True
    for px, py in zip(x.tolist(), y.tolist(), strict=True):
        if math.isnan(px) or math.isnan(py):
            pen_up = True
            continue
        pieces.append(f"{'M' if pen_up else 'L'}{px:.1f} {py:.1f}")
        pen_up = False
    dash = ' stroke-dasharray="6 4"' if line.dashed else ""
    return (
        f'<path d="{"".join(pieces)}" fill="none" stroke="{colour}" stroke-width="1.8" stroke-linejoin="round"{dash}/>'
    )


def _thinned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At most some thousand points: of each run of neighbours the lowest and the highest, so that no peak is lost."""
    if x.size <= 2 * _MOST_POINTS:
        return x, y
    keep: set[int] = {0, x.size - 1}
    for run in np.array_split(np.arange(x.size), _MOST_POINTS):
        part = y[run]
        if np.all(np.isnan(part)):
            keep.add(int(run[0]))
            continue
        keep.update((int(run[np.nanargmin(part)]), int(run[np.nanargmax(part)])))
        keep.update(int(i) for i in run[np.isnan(part)][:1])
    order = np.array(sorted(keep))
    return x[order], y[order]


def _legend_rows(labels: list[str], title: str) -> list[list[tuple[int, str, float]]]:
    """Legend entries (curve, text, width in pixels) in rows; the first row leaves room for the title."""
    rows: list[list[tuple[int, str, float]]] = []
    room = 0.0
    for i, label in enumerate(labels):
        if not label:
            continue
        entry = (i, _cut(label, 44), 7.0 * len(_cut(label, 44)) + 40.0)
        if entry[2] > room:
            rows.append([])
            room = _WIDTH - _LEFT - _RIGHT - (8.0 * len(title) + 20.0 if len(rows) == 1 else 0.0)
        rows[-1].append(entry)
        room -= entry[2]
    return rows


def _legend(row: list[tuple[int, str, float]], y: float) -> str:
    """One row of legend entries, flush right."""
    parts, at = [], _WIDTH - _RIGHT - sum(width for _, _, width in row)
    for i, text, width in row:
        colour = PALETTE[i % len(PALETTE)]
        parts.append(
            f'<line x1="{at + 8:.1f}" y1="{y - 4}" x2="{at + 28:.1f}" y2="{y - 4}" '
            f'stroke="{colour}" stroke-width="2.5"/>'
        )
        parts.append(_text(at + 33, y, text))
        at += width
    return "".join(parts)


def _text(
    x: float, y: float, text: str, *, anchor: str = "start", fill: str = _INK, size: float = 13, weight: int = 400
) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{fill}" font-size="{size}" font-weight="{weight}">'
        f"{html.escape(text)}</text>"
    )


def _label(value: float, log: bool = False) -> str:
    if log and not 0.01 <= value < 1e5:
        return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e")
    text = f"{value:.6g}"
    if "e" in text:
        mantissa, power = text.split("e")
        return f"{mantissa}e{int(power)}"
    return text


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."


def _svg(height: int, name: str, parts: Iterable[str]) -> str:
    label = html.escape(name, quote=True)
    return (
        f'<svg class="mbrs-chart" viewBox="0 0 {_WIDTH} {height}" role="img" aria-label="{label}" '
        f'font-family="system-ui, sans-serif">{"".join(parts)}</svg>'
    )
