"""The demonstration of ``mbrs demo``, and pages of single results."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.text import html_table
from ..linear.frf import frf
from ..linear.modes import modes
from ..linear.sensitivity import sensitivity
from ..system.effects import effects
from ..system.system import System
from ..view.modes import modes as animate
from ..view.page import Section, fragment, page, write_page
from ._hexapod import cubic_hexapod

__all__ = ["result_page", "run"]

_INTRO = (
    "A payload of 20 kg on six legs along the edges of a cube of 0.2 m, each with k = 1e5 N/m and c = 30 N s/m "
    "(an invented design whose frequencies are known in closed form). "
    "Everything here was computed by one call of `mbrs demo`."
)


def run(out: str | Path) -> str:
    """Analyse an isolator, write the page and return the text for the terminal."""
    m = cubic_hexapod()
    found = modes(m)
    force, motion, band = "payload.force.z", "payload.motion.z", (1.0, 200.0)
    receptance = frf(m, inputs=force, outputs=motion, frequency=band, kind="receptance")
    transmissibility = frf(m, inputs="base.z", outputs=motion, frequency=band, kind="transmissibility")
    derivatives = sensitivity(found, ["k_leg", "c_leg", "payload.mass", "leg0.at_b[2]"])
    sections = [
        Section("The model", [str(System(m)), str(effects(m))]),
        modes_section(found),
        frf_section("Receptance", receptance, found),
        frf_section(
            "Transmissibility", transmissibility, found, "Motion of the payload for a unit motion of the base."
        ),
        sensitivity_section(derivatives),
    ]
    path = write_page(out, "mbrs demo: an isolator on six legs", sections, intro=_INTRO)
    return "\n\n".join([str(found), str(receptance), str(derivatives), f"wrote {path}"])


def modes_section(result: Any, title: str = "Modes") -> Section:
    """Table of modes, and the shapes in motion where there is geometry."""
    content: list[Any] = [_table_of(result)]
    text = ""
    if getattr(result, "geometry", None) is not None:
        content.append(animate(result))
        text = "Drag to turn, scroll to zoom, shift-drag to move. Colour shows how far a point moves."
    return Section(title, content, text)


def _table_of(result: Any) -> Any:
    """The result's own table as HTML; the result itself where it has none to give."""
    rows = getattr(result, "rows", None)
    return html_table(*rows()) if callable(rows) else result


def frf_section(title: str, result: Any, modes: Any = None, text: str = "") -> Section:
    """Bode plot; natural frequencies are marked by dotted lines where the modes are given."""
    from ..plot.linear import frf as draw

    marks = () if modes is None else [f for f in np.unique(np.round(modes.frequency, 6)) if f > 0.0]
    note = "Dotted lines: natural frequencies." if len(marks) else ""
    return Section(title, drawn(lambda: draw(result, marks=marks)), f"{text} {note}".strip())


def sensitivity_section(result: Any, title: str = "Sensitivities") -> Section:
    """Table of derivatives and a tornado chart of the first mode that any parameter moves."""
    from ..plot.data import tornado_bars
    from ..plot.studies import tornado

    content: list[Any] = [_table_of(result)]
    for mode in range(np.atleast_2d(result.frequency).shape[0]):
        if any(bar.value != 0.0 for bar in tornado_bars(result, mode)):
            content.append(drawn(partial(tornado, result, mode, most=12)))
            break
    return Section(
        title, content, "Exact derivatives; the bars show their first-order effect on one natural frequency."
    )


def curve_section(curve: Any, outputs: tuple[str, ...]) -> Section:
    """Table and chart of a nonlinear frequency response; unstable parts dashed."""

    def draw() -> Any:
        from ..plot.figure import canvas, style

        with style():
            made, axes = canvas(None, (8.5, 4.6))
        for output in outputs:
            curve.plot(output, ax=axes, label=output if len(outputs) > 1 else None)
        if len(outputs) > 1:
            axes.set(yscale="log", ylabel="amplitude of harmonic 1")
        return made

    table = html_table(*curve.rows(outputs), digits=7)
    return Section("Nonlinear frequency response", [table, drawn(draw)], "Dashed: unstable.")


def drawn(draw: Callable[[], Any]) -> str:
    """A figure as HTML; it is closed again, so that pages leave none behind."""
    import matplotlib.pyplot as plt

    made = draw()
    text = fragment(made)
    plt.close(made)
    return text


def result_page(analysis: str, name: str, result: Any, outputs: tuple[str, ...] = ()) -> str:
    """One result as a page, for ``--out page.html``."""
    if analysis == "nlfr":
        return page(f"{name}: {analysis}", [curve_section(result, outputs)])
    if analysis == "simulate":
        return result.animate().html()
    make = {"modal": modes_section, "sens": sensitivity_section}
    section = frf_section("Transfer function", result) if analysis == "frf" else make[analysis](result)
    return page(f"{name}: {analysis}", [section])
