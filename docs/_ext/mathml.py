"""Equations as MathML, written at build time: a browser shows them without a script and without a network.

Sphinx's `html_math_renderer` "mathml". LaTeX goes through latex2mathml; the number of an equation comes from its ``\\tag{1.2}``,
and becomes an anchor ``eq-1.2``. An equation that cannot be converted is a warning, hence an error of the build.
"""

from __future__ import annotations

import html
import re
import shutil
from pathlib import Path

import ziamath
from latex2mathml.converter import convert
from sphinx.util import logging

TAG = re.compile(r"\\tag\{([\d.]+)\}")
FONT = Path(ziamath.__file__).parent / "fonts" / "STIXTwoMath-Regular.ttf"
logger = logging.getLogger(__name__)


def formula(tex: str, display: str, node) -> str:
    """The element <math> of a piece of LaTeX, with the LaTeX as its label."""
    try:
        element = convert(tex, display=display)
    except Exception as error:
        logger.warning("equation %r: %r", tex, error, location=node)
        return f"<code>{html.escape(tex)}</code>"
    return element.replace("<math ", f'<math aria-label="{html.escape(" ".join(tex.split()), quote=True)}" ', 1)


def visit_inline(self, node) -> None:
    """Write an equation of a sentence."""
    from docutils import nodes

    self.body.append(formula(node.astext(), "inline", node))
    raise nodes.SkipNode


def visit_block(self, node) -> None:
    """Write an equation on lines of its own, its number at the right."""
    from docutils import nodes

    tex = node.astext()
    number = TAG.search(tex)
    name = f' id="eq-{number[1]}"' if number else ""
    self.body.append(f'<div class="equation"{name}>{formula(TAG.sub("", tex).strip(), "block", node)}')
    self.body.append(f'<span class="number">({number[1]})</span></div>\n' if number else "</div>\n")
    raise nodes.SkipNode


def copy_font(app, exception) -> None:
    """The font of the equations as a file of the site."""
    if exception is None and app.builder.format == "html":
        folder = Path(app.outdir) / "_static"
        folder.mkdir(exist_ok=True)
        shutil.copy(FONT, folder / FONT.name)


def setup(app) -> dict:
    """Register the renderer."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    app.connect("build-finished", copy_font)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
