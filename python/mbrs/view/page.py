"""One self-contained HTML page of text, tables, pictures and moving scenes: no network, no library."""

from __future__ import annotations

import html
import io
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._lib.files import write_atomic
from ..errors import ModelError
from .document import document
from .modes import Viewer

__all__ = ["Section", "page", "write_page"]


@dataclass(frozen=True)
class Section:
    """A heading and its content: HTML, matplotlib figures, viewers, results with a table, or plain text.

    ``text`` is a paragraph of plain text under the heading (escaped); ``content`` one object or a sequence of them.
    """

    title: str
    content: Any = ()
    text: str = ""

    def html(self) -> str:
        """The section as a fragment."""
        parts = self.content if isinstance(self.content, list | tuple) else [self.content]
        text = f"<p>{html.escape(self.text)}</p>" if self.text else ""
        body = "\n".join(fragment(part) for part in parts)
        return f"<section><h2>{html.escape(self.title)}</h2>{text}\n{body}</section>"


def fragment(part: Any) -> str:
    """One object as HTML. A string that begins with ``<`` is taken as HTML, any other as preformatted text."""
    if isinstance(part, str):
        return part if part.lstrip().startswith("<") else f"<pre>{html.escape(part)}</pre>"
    if hasattr(part, "fragment"):
        return part.fragment()
    if hasattr(part, "savefig"):
        return _image(part)
    if hasattr(part, "_repr_html_"):
        return part._repr_html_()
    return f"<pre>{html.escape(str(part))}</pre>"


def page(title: str, sections: Iterable[Section | tuple[str, Any]], *, intro: str = "") -> str:
    """A whole page from its sections, as one string of HTML that needs no network.

    Parameters
    ----------
    title
        Title and first heading.
    sections
        `Section` objects, or pairs of a title and content.
    intro
        A paragraph of plain text under the title.

    Examples
    --------
    >>> text = page("Report", [("Modes", "<p>none</p>"), Section("Notes", "a < b")])
    >>> "a &lt; b" in text and "://" not in text
    True
    """
    built = [one if isinstance(one, Section) else Section(*one) for one in sections]
    if not built:
        raise ModelError("a page needs at least one section")
    body = "\n".join(one.html() for one in built)
    lead = f'<p class="lead">{html.escape(intro)}</p>' if intro else ""
    assets = ""
    if 'class="mbrs-scene"' in body:
        assets = Viewer.assets()
    return document(title, f"<header><h1>{html.escape(title)}</h1>{lead}</header>\n{body}\n{assets}")


def write_page(path: str | Path, title: str, sections: Iterable[Section | tuple[str, Any]], *, intro: str = "") -> Path:
    """Write `page` to a file and return its path."""
    return write_atomic(path, page(title, sections, intro=intro).encode())


def _image(figure: Any) -> str:
    """A matplotlib figure as inline SVG: sharp at every size, letters as outlines, no link to anywhere."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", bbox_inches="tight")
    text = buffer.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    # inside HTML the names of the namespaces mean themselves
    text = re.sub(r' xmlns(:\w+)?="[^"]*"', "", text)
    return f'<div class="figure">{text}</div>'
