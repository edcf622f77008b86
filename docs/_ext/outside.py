"""Links to files of the repository that are not pages of the site: scripts become downloads, pages of other folders are included.

A page of another folder, such as examples/README.md, has a page here that includes it; links to it lead there.
"""

from __future__ import annotations

import re

PAGES = {
    "../examples/README.md": "examples.md",
    "../examples/gallery/README.rst": "gallery/index.rst",
    "../benches/README.md": "speed.md",
    "../CHANGELOG.md": "changes.md",
    "../README.md": "index.md",
}


def rewrite(app, docname, source) -> None:
    """Replace links to pages of other folders by links to the pages that include them."""
    up = "../" * docname.count("/")
    for outside, page in PAGES.items():
        source[0] = source[0].replace(f"]({outside})", f"]({up}{page})")
    source[0] = re.sub(r"\]\(docs/", "](", source[0])


def included(app, relative_path, parent_docname, content) -> None:
    """The same for included pages, whose links are relative to the folder of the repository that they are in."""
    folder = str(relative_path).replace("\\", "/").split("/")
    name = next((f for f in ("examples", "benches") if f in folder), "")

    def link(match):
        target = match[1]
        if re.match(r"[a-z]+:|#|/", target):
            return match[0]
        if target.startswith("../docs/"):
            return f"]({target.removeprefix('../docs/')})"
        if not name:
            return f"]({target.removeprefix('docs/')})" if target.startswith("docs/") else f"](../{target})"
        inner = f"../{target.removeprefix('../')}" if target.startswith("../") else f"../{name}/{target}"
        return f"]({PAGES.get(inner, inner)})"

    content[0] = re.sub(r"\]\(([^)\s]+)\)", link, content[0])


def setup(app) -> dict:
    """Register both."""
    app.connect("source-read", rewrite)
    app.connect("include-read", included)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
