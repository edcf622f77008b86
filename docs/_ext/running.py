"""Pages whose Python blocks run while the site is built: what they print and draw comes from the run.

A page opts in by a mark. ``<!-- printed -->`` becomes the text that was printed since the last mark, ``<!-- figure: name.png -->``
the picture that the blocks saved under this name. A block that fails ends the build. Blocks of another program are written ``py``
instead of ``python``: they are shown, not run.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import tempfile
from pathlib import Path

from sphinx.errors import ExtensionError

PIECE = re.compile(
    r"^```python\n(?P<code>.*?)^```|<!-- (?P<printed>printed) -->|<!-- figure: (?P<figure>[\w-]+\.png) -->", re.S | re.M
)


def run(app, docname, source) -> None:
    """Fill the marks of a page."""
    if "<!-- printed -->" not in source[0] and "<!-- figure:" not in source[0]:
        return
    figures = Path(app.srcdir) / "generated" / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    names: dict = {"__name__": docname}
    printed = io.StringIO()
    up = "../" * docname.count("/")

    def piece(match):
        if match["code"] is not None:
            try:
                with contextlib.redirect_stdout(printed):
                    exec(compile(match["code"], f"{docname}.md", "exec"), names)
            except Exception as error:
                raise ExtensionError(f"a block of {docname}.md failed: {error!r}\n{match['code']}") from error
            return match[0]
        if match["printed"]:
            text = printed.getvalue().rstrip()
            printed.seek(0)
            printed.truncate()
            return f"```text\n{text}\n```"
        name = f"{docname.replace('/', '-')}-{match['figure']}"
        shutil.copy(match["figure"], figures / name)
        return f"![]({up}generated/figures/{name})"

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        source[0] = PIECE.sub(piece, source[0])
    import matplotlib.pyplot as plt

    plt.close("all")


def setup(app) -> dict:
    """Register; tables as wide as the pages."""
    os.environ.setdefault("COLUMNS", "100")
    app.connect("source-read", run, priority=400)
    return {"parallel_read_safe": False, "parallel_write_safe": True}
