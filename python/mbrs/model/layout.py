"""The schema as others read it: the fields in docs/tables.md, and the offsets of the Rust core in rust/src/model/layout.rs.

``python -m mbrs.model.layout`` in a source tree writes both; a test compares them with the schema.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from .air_schema import AIR, INFLOWS, SECTION, UNSTEADY
from .schema import (
    BODY,
    COORDINATE_ROLES,
    COUPLER,
    DRAWING_TOLERANCE,
    ELEMENTS,
    FLAGS,
    GRAVITY,
    JOINTS,
    LARGEST_TOLERANCE,
    LAWS,
    LOADS,
    MARKER,
    MOTIONS,
    NODE,
    POSE,
    QUADRATIC,
    SHAPES,
    UNITS,
    Block,
    Field,
    Size,
    size_of,
)

BLOCKS: tuple[Block, ...] = (
    BODY.block,
    JOINTS["revolute"].block,
    *(kind.block for kind in ELEMENTS.values()),
    LOADS["force"].block,
    MARKER.block,
    POSE.block,
    GRAVITY.block,
    COUPLER.block,
    SHAPES.block,
    NODE,
    QUADRATIC,
    AIR.block,
    SECTION,
)
_BEGIN, _END = "<!-- fields: written by python -m mbrs.model.layout -->", "<!-- end of fields -->"


# --- docs/tables.md -----


def markdown() -> str:
    """The tables of fields, codes and flags."""
    parts = [_BEGIN, *(part for block in BLOCKS for part in _block_page(block)), *_code_page(), _END]
    return "\n".join(parts)


def _block_page(block: Block) -> Iterator[str]:
    note = f": {block.note}" if block.note else ""
    yield from ("", f"**{block.name}**, {_count(block.total)} numbers{note}", "")
    yield from ("| field | place | unit | without it | |", "|---|---|---|---|---|")
    for field in block:
        used = f"of {', '.join(field.types)}" if field.types and len(field.types) < len(JOINTS) - 2 else ""
        flag = f"flag {field.bit}" if field.flag else ""
        replaced = f"not with flag {FLAGS[field.replaced_by]}" if field.replaced_by else ""
        note = "; ".join(text for text in (field.note, used, flag, replaced) if text)
        yield f"| `{field.name}` | {_place(block, field)} | {_unit(field)} | {_default(field)} | {note} |"


def _place(block: Block, field: Field) -> str:
    start, end = block.starts[field.name], block.starts[field.name] + size_of(field.shape)
    shape = "" if len(field.shape) < 2 else f" ({' x '.join(map(str, field.shape))})"
    return f"{_count(start)}{shape}" if size_of(field.shape) == Size(1) else f"{_count(start)}:{_count(end)}{shape}"


def _count(size: Size) -> str:
    terms = [str(size.constant)] if size.constant else []
    terms += [f"{size.linear} m"] if size.linear else []
    terms += [f"{size.quadratic} m^2"] if size.quadratic else []
    return " + ".join(terms) or "0"


def _unit(field: Field) -> str:
    return f"{field.role} of its coordinate" if field.role in COORDINATE_ROLES else UNITS.get(field.role, "")


def _default(field: Field) -> str:
    if field.role == "integral":
        return ""
    numbers = field.neutral
    same = len(set(numbers)) == 1
    return f"{numbers[0]:g}" if same else "(" + ", ".join(f"{v:g}" for v in numbers) + ")"


def _code_page() -> Iterator[str]:
    for heading, kinds in (("joint_type", JOINTS), ("element_type", ELEMENTS), ("load_type", LOADS)):
        yield from ("", f"**{heading}**: " + ", ".join(f"{k.code} {k.type}" for k in kinds.values()) + ".")
    yield from (
        "",
        "**free coordinates**: "
        + "; ".join(f"{k.type} {', '.join(k.coordinates)}" for k in JOINTS.values() if k.free)
        + ".",
    )
    flags = ", ".join(f"{bit} {name.replace('_', ' ').lower()}" for name, bit in FLAGS.items())
    yield from ("", f"**flags**: {flags}.")
    laws = "; ".join(f"{'/'.join(map(str, law.codes))} {law.name}: {law.numbers}" for law in LAWS.values())
    yield from ("", f"**law_type** and numbers: {laws}.")
    motions = "; ".join(f"{m.code} {m.name}: {', '.join(m.groups) or m.note}" for m in MOTIONS.values())
    yield from ("", "**air_inflow**: " + ", ".join(f"{code} {name}" for name, code in INFLOWS.items()) + ".")
    yield from ("", "**air_unsteady**: " + ", ".join(f"{bit} {name}" for name, bit in UNSTEADY.items()) + ", added up.")
    yield from ("", f"**motion_type** and numbers (* any number of them): {motions}.", "")


def page(text: str) -> str:
    """docs/tables.md with the tables of fields renewed."""
    return re.sub(f"{re.escape(_BEGIN)}.*{re.escape(_END)}", lambda _: markdown(), text, flags=re.DOTALL)


# --- rust/src/model/layout.rs -----


def rust() -> str:
    """The offsets as constants, in the form of rustfmt."""
    out = [
        "//! Places of the numbers of each object in its block of x (docs/tables.md). Written by `python -m mbrs.model.layout` from",
        "//! the schema of Python; do not edit.",
        '#![allow(dead_code, reason = "the whole table is here, whoever reads it")]',
        "",
        "/// What `tolerance` of a model must stay below.",
        f"pub const LARGEST_TOLERANCE: f64 = {LARGEST_TOLERANCE!r};",
        "/// `tolerance` of a model that does not say.",
        f"pub const DRAWING_TOLERANCE: f64 = {DRAWING_TOLERANCE!r};",
        "",
        "/// Bits of `flags` of joints and elements.",
        "pub mod flag {",
        *(
            line
            for name, bit in FLAGS.items()
            for line in (f"    /// `{_given_with(name)}` is given.", f"    pub const {name}: i64 = {bit};")
        ),
        "}",
    ]
    for kinds in (JOINTS, ELEMENTS, LOADS):
        heading = next(iter(kinds.values())).heading
        what = "Names of the joints by their code in" if kinds is JOINTS else "Codes of"
        out += ["", f"/// {what} `{heading}_type`.", f"pub mod {heading}_type {{"]
        if kinds is JOINTS:
            types = [k.type for k in sorted(kinds.values(), key=lambda k: k.code)]
            out += [f"    pub const NAMES: [&str; {len(types)}] = [", *(f'        "{t}",' for t in types), "    ];"]
        else:
            out += [f"    pub const {k.type.upper()}: i64 = {k.code};" for k in kinds.values()]
        out += ["}"]
    out += ["", "/// Codes of `air_inflow`.", "pub mod air_inflow {"]
    out += [*(f"    pub const {name.upper()}: i64 = {code};" for name, code in INFLOWS.items()), "}"]
    out += ["", "/// Bits of `air_unsteady`.", "pub mod air_unsteady {"]
    out += [*(f"    pub const {name.upper()}: i64 = {bit};" for name, bit in UNSTEADY.items()), "}"]
    for block in BLOCKS:
        out += ["", f"/// The numbers of a {block.name.replace('_', ' ')}.", f"pub mod {block.name} {{"]
        for name, size in (*block.starts.items(), ("size", block.total)):
            out += _rust_place(_ascii_name(name), size)
        out += ["}"]
    return "\n".join(out) + "\n"


def _given_with(flag: str) -> str:
    """The field that sets a flag."""
    return next(
        field.name for kinds in (JOINTS, ELEMENTS) for k in kinds.values() for field in k.fields if field.flag == flag
    )


def _ascii_name(name: str) -> str:
    return {"S": "s", "P1": "p1", "P2": "p2", "K": "k", "C": "c", "KG": "kg"}.get(name, name)


def _rust_place(name: str, size: Size) -> list[str]:
    if not size.linear and not size.quadratic:
        return [f"    pub const {name.upper()}: usize = {size.constant};"]
    terms = [str(size.constant)] if size.constant else []
    terms += [f"{size.linear} * m"] if size.linear else []
    terms += [("m * m" if size.quadratic == 1 else f"{size.quadratic} * m * m")] if size.quadratic else []
    return [f"    pub const fn {name}(m: usize) -> usize {{", f"        {' + '.join(terms)}", "    }"]


def _write(root: Path) -> None:
    path = root / "docs" / "tables.md"
    path.write_text(page(path.read_text(encoding="utf-8")), encoding="utf-8")
    (root / "rust" / "src" / "model" / "layout.rs").write_text(rust(), encoding="utf-8")


if __name__ == "__main__":
    _write(Path(__file__).resolve().parents[3])
