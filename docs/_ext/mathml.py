"""Equations as MathML, written at build time: a browser shows them without a script and without a network.

Sphinx's `html_math_renderer` "mathml". LaTeX goes through latex2mathml; the number of an equation comes from its ``\\tag{1.2}``,
and becomes an anchor ``eq-1.2``. An equation that cannot be converted is a warning, hence an error of the build.
"""

from __future__ import annotations

import html
import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import ziamath
from latex2mathml.converter import convert
from sphinx.util import logging

TAG = re.compile(r"\\tag\{([\d.]+)\}")
SPACE = "{http://www.w3.org/1998/Math/MathML}"
PRIMES, BARS = {"\u2032", "\u2033", "\u2034"}, {"|", "\u2016"}
FONT = Path(ziamath.__file__).parent / "fonts" / "STIXTwoMath-Regular.ttf"
ElementTree.register_namespace("", SPACE[1:-1])
logger = logging.getLogger(__name__)


def formula(tex: str, display: str, node) -> str:
    """The element <math> of a piece of LaTeX, with the LaTeX as its label."""
    try:
        element = convert(tex, display=display)
    except Exception as error:
        logger.warning("equation %r: %r", tex, error, location=node)
        return f"<code>{html.escape(tex)}</code>"
    tree = ElementTree.fromstring(element)
    improve(tree)
    tree.set("aria-label", " ".join(tex.split()))
    return ElementTree.tostring(tree, encoding="unicode")


def improve(element: ElementTree.Element) -> None:
    """Primes as the font draws them, already raised; bars of absolute values without the space of an operator."""
    for child in element:
        improve(child)
    if element.tag == f"{SPACE}mo" and element.text in BARS and element.get("stretchy") == "false":
        element.set("lspace", "0")
        element.set("rspace", "0")
    if element.tag == f"{SPACE}msup" and element[1].text in PRIMES and not len(element[1]):
        element.tag = f"{SPACE}mrow"
        element[1].tag = f"{SPACE}mo"
        element[1].attrib |= {"lspace": "0", "rspace": "0"}


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
