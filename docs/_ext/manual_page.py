"""The verification manual: docs/generated/manual.md from the records that the tests wrote (tests/manual/record.py)."""

from __future__ import annotations

import json
import os
from pathlib import Path

from sphinx.errors import ExtensionError

ROOT = Path(__file__).resolve().parents[2]
FEWEST = 60
TITLES = {
    "statics": "Equilibrium and steady motion",
    "modes": "Modes",
    "rotors": "Rotors",
    "loops": "Closed loops",
    "transfer": "Transfer functions and responses",
    "sensitivity": "Sensitivities",
    "nonlinear": "Nonlinear vibration",
    "motion": "Motion in time",
    "gradients": "Gradients of motions",
    "flexible": "Flexible bodies",
    "aero": "Blades in the wind",
}
HEAD = """---
html_theme.sidebar_secondary.remove: true
---
# Verification manual

{count} cases whose answer does not come from mbrs: {kinds}. The tests assert every case and write its record while they run; this
page is made of the records. No number here was typed.

**known**: the answer, and how well it is known (relative; a formula has the rounding of double precision). **mbrs**: our value. Where
a case has several numbers, the one with the largest distance is shown. **distance**: between both, over the largest known number.
**estimate**: what mbrs said about its own error (`.error`), `-` where the analysis computes none. **allowed**: the distance beyond
which the test fails.

| topic | cases |
|---|---|
{summary}
"""


def page(records: list[dict]) -> str:
    """The whole page."""
    kinds: dict[str, int] = {}
    for r in records:
        kinds[r["kind"]] = kinds.get(r["kind"], 0) + 1
    by_topic = {t: sorted((r for r in records if r["topic"] == t), key=lambda r: r["name"]) for t in TITLES}
    by_topic = {t: rs for t, rs in by_topic.items() if rs}
    summary = "\n".join(f"| {TITLES[t]} | {len(rs)} |" for t, rs in by_topic.items())
    text = ", ".join(f"{n} by {kind}" for kind, n in sorted(kinds.items(), key=lambda item: -item[1]))
    parts = [HEAD.format(count=len(records), kinds=text, summary=summary)]
    for topic, rs in by_topic.items():
        parts.append(f"## {TITLES[topic]}\n")
        parts.append("| case | known, and mbrs | distance | estimate | allowed |\n|---|---|---|---|---|")
        parts += [row(r) for r in rs]
        parts.append("")
    return "\n".join(parts)


def row(r: dict) -> str:
    """One case."""
    estimate = "-" if r["estimate"] is None else f"{r['estimate']:.1e}"
    unit = f" {r['unit']}" if r["unit"] else ""
    several = f" ({r['count']} numbers)" if r["count"] > 1 else ""
    function = r["test"].split("::")[-1]
    source = r["source"].replace("<", "&lt;")
    cells = (
        f"**{r['name']}**{several}<br>{r['kind']}: {source}<br>test: [{function}](../../{r['file']})",
        f"{r['known']}{unit} (± {r['uncertainty']:.0e})<br>{r['ours']}{unit}",
        f"{r['distance']:.1e}", estimate, f"{r['within']:.0e}",
    )  # fmt: skip
    return "| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |"


def write(app) -> None:
    """Write the page, or end the build where cases are missing."""
    folder = Path(os.environ.get("MBRS_MANUAL", ROOT / "target" / "manual"))
    records = [json.loads(p.read_text()) for p in sorted(folder.glob("*.json"))]
    if len(records) < FEWEST:
        raise ExtensionError(
            f"{len(records)} records of at least {FEWEST} in {folder}: run the tests with MBRS_MANUAL={folder}, or docs/build.py"
        )
    failed = [r["name"] for r in records if not r["distance"] <= r["within"]]
    if failed:
        raise ExtensionError(f"cases that failed: {failed}")
    path = ROOT / "docs" / "generated" / "manual.md"
    path.parent.mkdir(exist_ok=True)
    path.write_text(page(records), encoding="utf-8")


def setup(app) -> dict:
    """Register the page."""
    app.connect("builder-inited", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
