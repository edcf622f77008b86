"""The built site needs no network, and shows every equation: python docs/_ext/check_site.py FOLDER.

Every file that a page loads (script, style, picture, font) is in the folder, every link within the site leads somewhere, equations are
MathML without errors, and the picture of every example of the gallery is there.
"""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {"script": "src", "link": "href", "img": "src", "source": "src", "iframe": "src", "object": "data"}


class Page(HTMLParser):
    """What a page loads, links to and names."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.names: set[str] = set()
        self.equations = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list) -> None:
        found = dict(attrs)
        self.names |= {found[key] for key in ("id", "name") if found.get(key)}
        self.equations += tag == "math"
        if tag == "link" and found.get("rel") in ("canonical", "next", "prev", "index", "search", "author"):
            return
        if tag in LOADED and found.get(LOADED[tag]):
            self.loads.append(found[LOADED[tag]])
        if tag == "a" and found.get("href"):
            self.links.append(found["href"])


def faults(folder: Path) -> tuple[list[str], dict[str, int]]:
    """What is wrong, and counts."""
    pages = {p: Page(p.read_text(encoding="utf-8")) for p in sorted(folder.rglob("*.html")) if "_static" not in p.parts}
    here = str(Path(__file__).resolve().parents[2])
    wrong = [
        f"{p.relative_to(folder)} names a folder of this machine"
        for p in pages
        if here in p.read_text(encoding="utf-8")
    ]
    counts = {"pages": len(pages), "equations": 0, "files loaded": 0, "links": 0}
    for path, page in pages.items():
        name = str(path.relative_to(folder))
        counts["equations"] += page.equations
        for url in page.loads:
            counts["files loaded"] += 1
            parts = urlsplit(url)
            if parts.scheme in ("http", "https") or url.startswith("//"):
                wrong.append(f"{name} loads {url}")
            elif parts.scheme != "data" and not (path.parent / unquote(parts.path)).exists():
                wrong.append(f"{name} loads {url}, which is not there")
        for url in page.links:
            parts = urlsplit(url)
            if parts.scheme or url.startswith("//"):
                continue
            counts["links"] += 1
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            if not target.exists():
                wrong.append(f"{name} links to {url}")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].names:
                wrong.append(f"{name} links to {url}, which has no such place")
    for style in sorted(folder.rglob("*.css")):
        for url in re.findall(
            r"(?:url\(|@import\s+)[\"']?(https?:[^\"')]+|//[^\"')]+)",
            style.read_text(encoding="utf-8", errors="replace"),
        ):
            wrong.append(f"{style.relative_to(folder)} loads {url}")
    if not (folder / "_static" / "STIXTwoMath-Regular.ttf").exists():
        wrong.append("the font of the equations is not there")
    return wrong, counts


def main() -> None:
    """Print counts; end with 1 where something is wrong."""
    folder = Path(sys.argv[1]).resolve()
    wrong, counts = faults(folder)
    print(", ".join(f"{n} {what}" for what, n in counts.items()))
    if counts["equations"] < 500:
        wrong.append(f"only {counts['equations']} equations")
    print("\n".join(wrong))
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
