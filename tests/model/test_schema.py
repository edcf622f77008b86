"""The schema of model objects: constructors, Tables, addresses, files, docs and the core's offsets agree with it."""

from __future__ import annotations

import inspect
import pickle
import typing
from pathlib import Path

import jitter
import mbrs
import mbrs as mb
import numpy as np
import pytest
from folders import ROOT
from mbrs.errors import ModelError
from mbrs.model import layout, toml
from mbrs.model.air_schema import HEADINGS
from mbrs.model.model import Model
from mbrs.model.schema import ELEMENTS, JOINTS, LAWS, MOTIONS, NODE, QUADRATIC, SHAPES
from mbrs.model.tables import tables
from scenes import everything, same_tables

KINDS = [kind for kinds in HEADINGS.values() for kind in kinds.values()]
SPRUNG = [*JOINTS.values(), *ELEMENTS.values()]


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: k.type)
def test_a_constructor_has_the_arguments_of_its_kind(kind):
    signature = inspect.signature(getattr(Model, kind.type)).parameters
    given = {name: p for name, p in signature.items() if name != "self"}
    assert set(given) == set(kind.known)
    assert {n for n, p in given.items() if p.default is p.empty} == set(kind.required)
    hints = (
        typing.get_type_hints(getattr(Model, kind.type), include_extras=True) if kind.type != "flexible_body" else {}
    )
    assert typing.Any not in hints.values() and "Parameters\n" in getattr(Model, kind.type).__doc__


def random_arguments(kind, rng):
    """Everything that a joint or an element takes; no number is round, nothing lies along x, y or z."""
    out = {"a": "a", "b": "b"}
    for argument in kind.known:
        if argument == "at":
            pair = kind.points == "two" or (kind.points == "either" and rng.random() < 0.5)
            out["at"] = rng.normal(size=(2, 3)) if pair else rng.normal(size=3)
        elif argument == "axis":
            out["axis"] = rng.normal(size=3)
        elif argument == "axis2":
            out["axis2"] = np.cross(out["axis"], rng.normal(size=3))
        elif argument in ("length", "radius", "pitch"):
            out[argument] = rng.uniform(0.1, 2.0)
        elif argument == "angle":
            out["angle"] = rng.normal()
        elif argument in ("k", "c", "preload"):
            n = len(kind.free)
            full = kind.type == "bushing" and argument != "preload" and rng.random() < 0.5
            out[argument] = rng.normal(size=(n, n) if full else n if n > 1 else ())
    if "axis" not in kind.known and "orientation" in kind.known:
        out["orientation"] = rng.normal(size=4)
    return out


def two_bodies():
    m = Model("two")
    for name, x in (("a", 0.3), ("b", -0.7)):
        m.body(name, mass=1.1, inertia=(1.2, 1.3, 1.4), at=(x, 0.1, 0.2))
    return m


@pytest.mark.parametrize("kind", SPRUNG, ids=lambda k: k.type)
@pytest.mark.parametrize("seed", range(4))
def test_what_is_typed_stands_at_its_place_has_an_address_and_comes_back_from_a_file(kind, seed):
    rng = np.random.default_rng([seed, kind.code, len(kind.heading)])
    m, given = two_bodies(), random_arguments(kind, rng)
    item = getattr(m, kind.type)("new", **given)
    t = tables(m)
    block = t["x"][t[f"{kind.heading}_x"][0] :][: kind.block.size()]
    assert t[f"{kind.heading}_type"].tolist() == [kind.code]
    flags = int(t[f"{kind.heading}_flags"][0])
    for field in kind.fields:
        now = block[kind.block.slice(field.name)]
        if field.name.startswith("at_"):
            pair = np.shape(given["at"]) == (2, 3)
            expected = given["at"][int(field.name == "at_b")] if pair else given["at"]
        elif field.name in given:
            expected = np.ravel(given[field.name])
            if np.shape(given[field.name]) == (6,) and field.shape == (6, 6):
                expected = np.diag(given[field.name]).ravel()
            assert m.value(f"new.{field.name}") == pytest.approx(given[field.name], rel=0, abs=0)
        else:
            expected = field.neutral
        expected = np.concatenate([np.ravel(expected), field.neutral])[: len(now)]
        # bit by bit without jitter, which multiplies the numbers of tables
        assert now.tolist() == pytest.approx(expected.tolist(), rel=1.001 * jitter.level(), abs=0, nan_ok=True), (
            field.name
        )
        assert bool(flags & field.bit) == (bool(field.flag) and field.name in given), field.name
    for address in item.fields():
        value = m.value(f"new.{address}")
        if address not in ("axis", "axis2", "orientation", "at"):
            m.set({f"new.{address}": np.abs(value) * 1.7})
            assert m.value(f"new.{address}") == pytest.approx(np.abs(value) * 1.7, rel=1e-15)
    assert not same_tables(tables(m), tables(toml.loads(toml.dumps(m), Model)))
    assert not same_tables(tables(m), tables(pickle.loads(pickle.dumps(m))))


def test_a_field_that_is_not_of_the_type_is_refused():
    m = two_bodies()
    for kind in SPRUNG:
        for other in {name for k in SPRUNG for name in k.known} - set(kind.known):
            text = f'[[body]]\nname = "p"\nmass = 1\ninertia = [1, 1, 1]\n[[{kind.heading}]]\ntype = "{kind.type}"\n{other} = 1\n'
            with pytest.raises(ModelError, match=f"line 7, column 1: .* has no entry '{other}'"):
                toml.loads(text, Model)
            with pytest.raises(TypeError, match=other):
                getattr(m, kind.type)("new", "a", "b", **{other: 1.0})


def test_sizes_of_blocks_with_modal_coordinates():
    from mbrs.flexible import beam

    m = Model("one")
    rod = m.flexible_body("rod", beam(1.3, mass=0.7, EI_flap=3.1, EI_edge=5.2, modes=3))
    values, n = rod.integrals.values(), 3
    modal, block = rod.modal, SHAPES.block
    for name in block.fields:
        assert values[block.slice(name, n)] == np.ravel(getattr(modal, name)).tolist(), name
    size = NODE.size(n) + QUADRATIC.size(n)
    for i in range(len(rod.nodes)):
        node = values[block.size(n) + i * size :]
        assert node[NODE.slice("position", n)] == modal.node_position[i].tolist()
        assert node[NODE.slice("shape", n)] == modal.node_shape[i].ravel().tolist()
        assert node[NODE.size(n) : size] == modal.node_quadratic[i].ravel().tolist()
    assert len(values) == block.size(n) + len(rod.nodes) * size


def test_a_body_without_second_order_has_no_numbers_for_it():
    from mbrs.flexible import beam

    rod = Model("one").flexible_body("rod", beam(1.3, mass=0.7, EI_flap=3.1, EI_edge=5.2, modes=3, stiffening=False))
    assert len(rod.integrals.values()) == SHAPES.block.size(3) + len(rod.nodes) * NODE.size(3)


def test_codes_are_unique_and_the_classes_have_them():
    assert sorted(c for law in LAWS.values() for c in law.codes) == list(range(15))
    assert all(code == motion.code for code, motion in MOTIONS.items()) and sorted(MOTIONS) == list(range(7))
    assert (
        mb.Gap(1.0, 0.1).code == 3 and mb.Gap(1.0, 0.1, bilateral=True).code == 4 and mb.Iwan([1.0], [2.0]).code == 10
    )
    assert mb.Polynomial1D([1.0]).code == 1 and mb.Polynomial1D([1.0], velocity=[2.0]).code == 2
    assert mb.Sine(1.0, frequency=2.0).code == 2 and mb.Table([0, 1], [0, 1], kind="linear").code == 5


@pytest.mark.skipif(not (ROOT / "docs").is_dir(), reason="an installed package has no docs beside it")
def test_the_page_of_tables_is_that_of_the_schema():
    text = (ROOT / "docs" / "tables.md").read_text(encoding="utf-8")
    assert layout.markdown() in text, "run python -m mbrs.model.layout"


@pytest.mark.skipif(not (ROOT / "rust").is_dir(), reason="an installed package has no Rust sources beside it")
def test_the_offsets_of_the_core_are_those_of_the_schema():
    text = (ROOT / "rust" / "src" / "model" / "layout.rs").read_text(encoding="utf-8")
    assert text == layout.rust(), "run python -m mbrs.model.layout"


@pytest.mark.parametrize("wrong", [0, -1e-9, 0.1, 1, float("nan"), float("inf"), "1e-7", None, True, 1j])
def test_a_tolerance_is_a_small_share(wrong):
    with pytest.raises(ModelError, match=r"tolerance of model .m. must be a number between 0 and 0\.1"):
        Model("m", tolerance=wrong)
    m = Model("m")
    with pytest.raises(ModelError, match="tolerance"):
        m.tolerance = wrong
    assert m.tolerance == 1e-7


def test_the_tolerance_stays_with_the_model():
    m = everything()
    assert "tolerance" not in toml.dumps(m)
    m.tolerance = 3.7e-4
    for again in (toml.loads(toml.dumps(m), Model), m.copy(), pickle.loads(pickle.dumps(m))):
        assert again.tolerance == 3.7e-4 and tables(again)["tolerance"] == 3.7e-4


def test_dir_shows_what_a_user_uses():
    m = everything()
    shown = {name for name in dir(m) if not name.startswith("_")}
    assert {"body", "revolute", "set", "value", "tolerance", "gravity", "bodies", "joints", "ground", "save"} <= shown
    assert not shown & {
        "stores",
        "cache",
        "driver",
        "target",
        "find_body",
        "load_place",
        "register",
        "space",
        "laws_of",
    }
    for name in ("a", "revolute", "spring", "pull", "tip", "world mark"):
        own = {n for n in dir(m[name]) if not n.startswith("_")}
        assert not own & {"recheck", "entries", "put", "flags", "start", "check", "evaluated", "index", "store"}, name
        assert {"name", "kind"} <= own
    assert {"force", "torque", "motion"} <= set(dir(m["a"])) and "type" in dir(m["revolute"])


def test_a_rotation_needs_an_angle():
    for wrong in (((0, 0, 90),), ("z",)):
        with pytest.raises(TypeError, match="angle"):
            mb.rotation(*wrong)


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(p.stem, marks=[pytest.mark.exact] * (p.stem == "tables"))  # prints numbers of Tables
        for p in sorted(Path(layout.__file__).parent.glob("[a-z]*.py"))
    ],
)
def test_examples_in_docstrings(path):
    import doctest
    import importlib

    module = importlib.import_module(f"mbrs.model.{path}")
    found = doctest.testmod(module)
    assert found.failed == 0
    assert found.attempted > 0 or path not in (
        "bodies",
        "joints",
        "forces",
        "drives",
        "flexible",
        "section_loads",
        "model",
    )


def test_offsets_stand_in_the_schema_only():
    """No file but the schema (and the reference, which reads Tables by itself) counts places in x."""
    import re

    offset = re.compile(
        r"\bstart \+ [0-9]|\bx \+ [1-9]\d\b|flags & [0-9]|\b(?:values|entries)\([0-9]|body_x.*range\([0-9]"
    )
    package = Path(mbrs.__file__).parent
    wrong = [
        f"{path.relative_to(package)}:{i}: {line.strip()}"
        for path in package.rglob("*.py")
        if "reference" not in path.parts
        for i, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if offset.search(line)
    ]
    assert not wrong, "\n".join(wrong)


@pytest.mark.skipif(not (ROOT / "rust").is_dir(), reason="an installed package has no Rust sources beside it")
def test_offsets_of_the_core_stand_in_its_table_only():
    import re

    offset = re.compile(
        r"\b(?:b|j|e|l|spec|body|joint|element|load|tables|spec)\.x \+ [0-9]|\bn\[[0-9]{2}|flags & [0-9]|\b(?:12|23) \* (?:self\.)?m\b"
    )
    source = ROOT / "rust" / "src"
    wrong = [
        f"{path.relative_to(source)}:{i}: {line.strip()}"
        for path in source.rglob("*.rs")
        if path.name != "layout.rs" and "linalg" not in path.parts
        for i, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if offset.search(line)
    ]
    assert not wrong, "\n".join(wrong)
