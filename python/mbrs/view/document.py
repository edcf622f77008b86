"""The shell of every page: head, style, and a policy that forbids the browser every request."""

from __future__ import annotations

import html
from importlib.resources import files

_POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"


def document(title: str, body: str, *, wide: bool = False) -> str:
    """The shell of a page: head, style, and a policy that forbids the browser every request."""
    style = files("mbrs.view").joinpath("page.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>\n{style}</style></head>\n"
        f'<body class="{"wide" if wide else "report"}">\n{body}\n</body></html>\n'
    )
