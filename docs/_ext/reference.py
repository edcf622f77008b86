"""Pages of the public names, the fields of results and the strings of addresses and ports, from the package itself.

Written into docs/generated at the beginning of a build; a page whose text is unchanged keeps its time, so that it is not read again.
"""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path

import mbrs as mb
from mbrs._lib.names import PUBLIC
from mbrs.model import schema
from mbrs.results import Result

DOCS = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(DOCS.parent / "tests"))
from public_names import TITLES  # noqa: E402

NO_FIELDS = "no labelled quantities: see the methods of the class"


def names(folder: str) -> list[str]:
    """Public names that live in a folder of the package."""
    return sorted((n for n, home in PUBLIC.items() if home.split(".")[0] == folder), key=str.casefold)


def entry(name: str) -> list[str]:
    """Directive of autodoc for a public name."""
    thing = getattr(mb, name)
    kind = "class" if inspect.isclass(thing) else "function" if callable(thing) else "data"
    if inspect.ismodule(thing):
        return [f".. automodule:: {thing.__name__}", "   :members:", ""]
    if inspect.isclass(thing) and issubclass(thing, BaseException):
        kind = "exception"
    members = ["   :members:"] if kind == "class" else []
    return [f".. auto{kind}:: mbrs.{name}", *members, ""]


def folder_page(folder: str, title: str) -> str:
    """All public names of a folder with their docstrings."""
    lines = [title, "=" * len(title), ""]
    return "\n".join([*lines, *(line for name in names(folder) for line in entry(name))])


def results() -> str:
    """Fields of every result: dimensions, unit, meaning."""
    lines = ["# Results and their fields", ""]
    lines += [
        "Every result prints as a table, and has `.status`, `.error`, `.stats`, `.save`, `.to_frame`, `.to_xarray` and"
    ]
    lines += [
        "`.plot`. The quantities below are those of `.to_xarray()`; a dimension that is empty means one number.",
        "",
    ]
    for name in sorted(n for f in TITLES for n in names(f)):
        thing = getattr(mb, name)
        if not (inspect.isclass(thing) and issubclass(thing, Result) and thing.quantities()):
            continue
        lines += [f"## {name}", "", "| attribute | dimensions | unit | |", "|---|---|---|---|"]
        for attribute, q in thing.quantities().items():
            dims = ", ".join(q.dims)
            label = (q.label or attribute.replace("_", " ")).replace("|", "\\|")
            lines.append(f"| `{attribute}` | {dims} | {q.unit.replace('|', chr(92) + '|')} | {label} |")
        lines.append("")
    return "\n".join(lines)


PORTS = [
    ("body.force.z", "N", "in", "force on the origin of a body, or at a marker: marker.force.z"),
    ("body.torque.x", "N m", "in", "torque on a body"),
    ("base.z", "m", "in", "motion of ground along z; base.rx turns it (rad)"),
    ("body.motion.x", "m", "out", "displacement of the origin of a body, or of a marker"),
    ("body.motion.rz", "rad", "out", "rotation of a body, or of a marker"),
    (
        "blade.tip.motion.z",
        "m",
        "out",
        "displacement of the node tip of the flexible body blade; force and torque likewise",
    ),
]


def addresses() -> str:
    """Strings of numbers and ports in one table each, from the schema."""
    lines = ["# Addresses and ports", ""]
    lines += [
        "An **address** names a number of a model: in `m.set`, `m.value`, `mb.sensitivity`, `mb.gradient`, sweeps and problems."
    ]
    lines += [
        "A whole field may be given instead of one entry. Directions and orientations are varied by a rotation vector about"
    ]
    lines += ["world axes (rad). A parameter is named alone: `k_leg`, `V[0,1]`; gravity is `gravity[2]`.", ""]
    lines += ["| object | address | unit | |", "|---|---|---|---|"]
    kinds = [schema.BODY, schema.MARKER, *schema.JOINTS.values(), *schema.ELEMENTS.values(), *schema.LOADS.values()]
    for kind in kinds:
        for field in kind.fields:
            if field.listed == "never":
                continue
            free = len(kind.free)
            sprung = field.role in schema.COORDINATE_ROLES and kind.heading == "joint"
            if sprung and not free:
                continue
            shape = (free,) if sprung else (3,) if field.role == "orientation" else field.shape
            if field.role == "inertia":
                shape = (3, 3)
            index = "" if not shape or shape == (1,) else "[" + ",".join("0" * len(shape)) + "]"
            unit = schema.UNITS.get(field.role, f"{field.role} of the coordinate")
            note = "where it was given" if field.listed == "given" else field.note
            lines.append(f"| {kind.type} | `name.{field.name}{index}` | {unit} | {note} |")
    lines += ["", "A **port** is an input or output of transfer functions, responses and state space. In Python:"]
    lines += ["`body.force('z')`, `body.motion('x', at=(0, 0, 1))`, `mb.base_motion('z')`; as text:", ""]
    lines += ["| port | unit | | |", "|---|---|---|---|"]
    lines += [f"| `{name}` | {unit} | {way} | {text} |" for name, unit, way, text in PORTS]
    lines += [
        "",
        "The directions are `x`, `y`, `z` of the world and, of motions, the rotations `rx`, `ry`, `rz`; in Python also a",
    ]
    return "\n".join([*lines, "vector (3,).", ""])


def index() -> str:
    """The page that lists the pages."""
    lines = ["# Reference", "", "```{toctree}", ":maxdepth: 1", "", "../api", "results", "addresses", "cli"]
    return "\n".join([*lines, *(f"mbrs-{folder}" for folder in TITLES), "```", ""])


def cli() -> str:
    """Help of the commands of the shell."""
    import click
    from mbrs.cli import main

    context = click.Context(main, info_name="mbrs")
    lines = ["# Commands of the shell", "", "```text", main.get_help(context), "```", ""]
    for name in main.list_commands(context):
        command = main.get_command(context, name)
        text = command.get_help(click.Context(command, info_name=f"mbrs {name}", parent=None))
        lines += [f"## mbrs {name}", "", "```text", text, "```", ""]
    return "\n".join(lines)


def write(app) -> None:
    """Write all pages."""
    folder = DOCS / "generated"
    folder.mkdir(exist_ok=True)
    pages = {"results.md": results(), "addresses.md": addresses(), "index.md": index(), "cli.md": cli()}
    pages |= {f"mbrs-{name}.rst": folder_page(name, title) for name, title in TITLES.items()}
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


# Docstrings of mbrs are plain text with equations in ASCII: marks that reStructuredText would read are escaped.
MARKS = re.compile(r"(``[^`]*``|`[^`\n]*`)|([|*])|(?<=\w)(_)(?!\w)")


def plain(app, what, name, thing, options, lines) -> None:
    """Escape |, * and a last _ of words, outside of code."""
    code = None
    for i, line in enumerate(lines):
        indent = len(line) - len(line.lstrip())
        if code is not None and (not line.strip() or indent > code):
            continue
        code = None
        if line.lstrip().startswith((">>>", "...", ".. code", ":type", "   >>>")):
            continue
        fields = re.match(r"\s*:(?:param|ivar|var|raises|rtype|type)\b[^:]*:", line)
        head, text = (line[: fields.end()], line[fields.end() :]) if fields else ("", line)
        text = MARKS.sub(lambda m: m[1] or "\\" + (m[2] or m[3]), text)
        text = re.sub(r"(?<!`)`mb\.([\w.]+)`(?!`)", r"`mb.\1 <mbrs.\1>`", text)
        lines[i] = head + re.sub(r"docs/theory\.md \((\d+\.\d+)\)", r"`theory (\1) <../theory.html#eq-\1>`__", text)
        if line.rstrip().endswith("::"):
            code = indent


def setup(app) -> dict:
    """Register the pages and the reading of docstrings."""
    app.connect("builder-inited", write)
    app.connect("autodoc-process-docstring", plain, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
