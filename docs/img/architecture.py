"""Draws docs/img/architecture.svg, the picture of docs/architecture.md: what a model becomes on its way to a result.

python docs/img/architecture.py
"""

from html import escape
from pathlib import Path

PICTURE = Path(__file__).resolve().with_suffix(".svg")
SIZE = (1000, 470)
STYLE = """
    .python { fill: #e8f0fa; stroke: #1f5fa8 } .rust { fill: #fbeadf; stroke: #d9662b } .plain { fill: #f1f3f5; stroke: #9aa7b5 }
    rect { stroke-width: 1.5; rx: 8 } .name { font-weight: 700; font-size: 15px } .small { font-size: 12px; fill: #4b5968 }
    path { fill: none; stroke: #33404e; stroke-width: 1.6; marker-end: url(#tip) }
"""
TIP = (
    '<marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" orient="auto">'
    '<path d="M0 0 L10 5 L0 10 z" style="fill:#33404e;stroke:none;marker-end:none"/></marker>'
)

# Language, place and width, name, lines of each box; the height follows from the lines.
BOXES = (
    ("python", 20, 40, 180, "Model", ("names, expressions,", "world points, what the", "user typed")),
    ("python", 270, 40, 180, "Tables", ("one vector x of numbers,", "index arrays, names:", "the one specification")),
    (
        "rust",
        520,
        40,
        200,
        "System",
        ("Arc<Topology> + values:", "tree, cut joints, markers;", "new values keep topology"),
    ),
    ("plain", 270, 200, 180, "mbrs.reference", ("the same once more in", "plain NumPy and SciPy")),
    ("rust", 520, 200, 200, "State", ("assembly, equilibrium,", "steady motion")),
    (
        "rust",
        520,
        340,
        200,
        "SecondOrder",
        ("M, C, G, K, N; maps to", "inputs, outputs, bodies;", "local elements and laws"),
    ),
    ("plain", 270, 340, 180, "MechanicalSystem", ("a user's own matrices", "enter here, dense or", "sparse")),
    ("rust", 790, 200, 190, "Analyses", ("modes, frf, response,", "sensitivity, harmonic", "balance, stability")),
    ("python", 790, 40, 190, "Result", ("frozen; arrays, .stats,", ".error, .status; prints,", "plots, saves")),
)
# Path of each arrow, and its word with the place of that.
ARROWS = (
    ("M200 88 H268", "tables", 206, 80),
    ("M450 88 H518", "border", 455, 80),
    ("M360 136 V198", "", 0, 0),
    ("M620 136 V198", "assemble", 628, 172),
    ("M620 278 V338", "linearize", 628, 312),
    ("M450 388 H518", "", 0, 0),
    ("M720 388 H885 V298", "", 0, 0),
    ("M885 200 V138", "", 0, 0),
)
LEGEND = (
    '<text x="20" y="24" class="small"><tspan fill="#1f5fa8" font-weight="700">Python</tspan>  and  '
    '<tspan fill="#d9662b" font-weight="700">Rust</tspan></text>'
)


def text(kind: str, x: int, y: int, words: str) -> str:
    """One line of text."""
    return f'<text class="{kind}" x="{x}" y="{y}">{escape(words, quote=False)}</text>'


def box(language: str, x: int, y: int, width: int, name: str, lines: tuple[str, ...]) -> list[str]:
    """A rectangle with its name and its lines."""
    height = 44 + 17 * len(lines) + (1 if len(lines) > 2 else 0)
    inside = [text("small", x + 16, y + 48 + 17 * i, line) for i, line in enumerate(lines)]
    return [
        f'<rect class="{language}" x="{x}" y="{y}" width="{width}" height="{height}"/>',
        text("name", x + 16, y + 26, name),
        *inside,
    ]


def picture() -> str:
    """The whole file."""
    width, height = SIZE
    parts = [f'<rect width="{width}" height="{height}" fill="#ffffff" rx="0"/>']
    for one in BOXES:
        parts += box(*one)
    for path, word, x, y in ARROWS:
        parts += [f'<path d="{path}"/>', *([text("small", x, y, word)] if word else [])]
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"'
    body = "\n".join(f"  {part}" for part in (f"<style>{STYLE}  </style>", f"<defs>{TIP}</defs>", *parts, LEGEND))
    return f'{head} font-family="system-ui, sans-serif" font-size="14">\n{body}\n</svg>\n'


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8")
