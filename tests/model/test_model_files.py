"""A model file is data: nothing in it is imported or called; its mistakes are named, shortly, with line and column."""

from __future__ import annotations

import difflib
import itertools
import pickle
import random
import sys

import mbrs as mb
import pytest
from mbrs.errors import ModelError
from mbrs.model import toml
from mbrs.model.model import Model
from mbrs.model.tables import tables
from mbrs.system.compiled import compiled

HEAD = """[model]
name = "one"
[[body]]
name = "b"
mass = 1.3
inertia = [1.0, 1.1, 1.2]
[[joint]]
type = "revolute"
name = "j"
a = "ground"
b = "b"
axis = [0.3, 0.4, 0.5]
at = [0.1, 0.2, 0.3]
"""
PLACES = {
    "whole load": '[[load]]\ntype = "force"\nname = "f"\nbody = "b"\nat = [0, 0, 0]\nvalue = "{}"\n',
    "component": '[[load]]\ntype = "torque"\nname = "f"\nbody = "b"\nvalue = [1.5, "{}", 0]\n',
    "drive": '[[drive]]\nname = "f"\njoint = "j"\nmotion = "{}"\n',
}


@pytest.fixture
def helper(tmp_path, monkeypatch):
    """A module that leaves a mark when it is imported, and another when it is called."""
    (tmp_path / "mbrs_helper.py").write_text(
        "seen = []\nopen('imported', 'w').close()\n"
        "def run(t):\n    open('called', 'w').close()\n    return 0.1 * t\n"
        "def three(t):\n    open('called', 'w').close()\n    return 0.0, 0.1 * t, 0.2\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("mbrs_helper", None)


@pytest.mark.parametrize("place", PLACES)
def test_a_file_calls_nothing_until_it_is_trusted(place, helper):
    name = "mbrs_helper:" + ("three" if place == "whole load" else "run")
    path = helper / "m.toml"
    path.write_text(HEAD + PLACES[place].format(name))
    m = Model.load(path)
    assert "Model('one'" in repr(m) and m.value("b.mass") == 1.3 and "f" in m and m.copy() and pickle.dumps(m)
    m.set({"b.mass": 2.5})
    again = Model.load(m.save(helper / "again.toml"))
    assert name in toml.dumps(again) and again.value("b.mass") == 2.5
    pickled = pickle.loads(pickle.dumps(m))
    for untrusted in (m, again, m.copy(), pickled):
        for compute in (tables, mb.linearize, mb.System, lambda n: mb.simulate(n, t=0.1), lambda n: compiled(n)):
            with pytest.raises(ModelError, match=r"'mbrs_helper:\w+', which was not imported.*functions=True"):
                compute(untrusted)
    assert not (helper / "imported").exists() and "mbrs_helper" not in sys.modules
    trusted = Model.load(helper / "again.toml", functions=True)
    assert (helper / "called").exists() and tables(trusted)["functions"]
    assert toml.dumps(trusted) == toml.dumps(again)


@pytest.mark.parametrize("functions", [False, True])
@pytest.mark.parametrize("name", ["..:x", ":x", "a:", "a b:c", "1a:b", "a:b c", "a..b:c", ".a:b", "a:b:c", "a:1"])
@pytest.mark.parametrize("place", PLACES)
def test_a_text_that_names_no_function(place, name, functions):
    with pytest.raises(ModelError, match=r"<text>: line \d+, column 1: .*does not name a function"):
        toml.loads(HEAD + PLACES[place].format(name), Model, functions=functions)


def test_a_module_that_raises_is_a_mistake_of_the_model(helper):
    (helper / "mbrs_broken.py").write_text("raise KeyError('" + "x" * 3000 + "')")
    with pytest.raises(ModelError, match="cannot be imported") as caught:
        toml.loads(HEAD + PLACES["drive"].format("mbrs_broken:f"), Model, functions=True)
    assert len(str(caught.value)) <= 500


@pytest.mark.parametrize("digits", [4301, 20_000])
@pytest.mark.parametrize("where", ["mass = {}", "mass = -{}", "com = [0, 0, {}]"])
def test_an_integer_of_too_many_digits(digits, where):
    text = HEAD.replace("mass = 1.3", where.format("7" * digits))
    line = HEAD.splitlines().index("mass = 1.3") + 1
    with pytest.raises(
        ModelError, match=rf"line {line}, column {where.index('{') + 1}: an integer of {digits} digits"
    ) as caught:
        toml.loads(text, Model)
    assert len(str(caught.value)) < 300


def longest_shared(message, text):
    match = difflib.SequenceMatcher(None, message, text, autojunk=False).find_longest_match()
    return match.size


LONG = [
    "x" * 9000,
    "a b " * 3000,
    "k+" * 4000 + "k",
    "'" * 5000,
    '\\"' * 4000,
    "sin(" * 60,
    "m.n" * 2000,
    "[" * 700,
    "zz:" * 2000,
]


def long_files():
    """Files in which one value, key or name is long, in each place where it may be wrong."""
    lines = (HEAD + PLACES["component"].format("0.5*t")).splitlines()
    rng = random.Random(5)
    for i, line in enumerate(lines):
        key, equals, _ = line.partition(" = ")
        for text in LONG:
            value = f'"{text}"' if equals else None
            if value is None:
                yield [*lines[:i], f'[["{text}"]]', *lines[i + 1 :]]
                continue
            yield [*lines[:i], f"{key} = {value}", *lines[i + 1 :]]
            yield [*lines[:i], f'"{text}" = 1', *lines[i + 1 :]]
        if equals:
            array = ", ".join(f'"{rng.random()}"' for _ in range(400))
            yield [*lines[:i], f"{key} = [{array}]", *lines[i + 1 :]]
            yield [*lines[:i], f"{key} = {{ {', '.join(f'k{n} = {n}' for n in range(900))} }}", *lines[i + 1 :]]


@pytest.mark.slow
def test_messages_are_short_and_do_not_repeat_the_file():
    seen = 0
    for lines in itertools.islice(long_files(), 400):
        text = "\n".join(lines)
        try:
            toml.loads(text, Model, "m.toml")
        except ModelError as error:
            message = str(error)
            assert len(message) <= 500, message
            longest = max(lines, key=len)
            assert longest_shared(message, longest) <= 200, message
            assert message.startswith("m.toml: ")
            seen += 1
    assert seen > 200


def test_long_paths_leave_room_for_the_message(tmp_path):
    with pytest.raises(ModelError, match="mass") as caught:
        toml.loads(HEAD.replace("mass = 1.3", "mass = -1"), Model, "/a" * 900)
    assert len(str(caught.value)) <= 500


def test_a_save_is_whole_or_does_not_happen(tmp_path, monkeypatch):
    path = tmp_path / "m.toml"
    m = toml.loads(HEAD, Model)
    m.save(path)
    before = path.read_text()
    m.set({"b.mass": 4.0})

    def fails(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.fsync", fails)
    with pytest.raises(OSError, match="disk full"):
        m.save(path)
    assert path.read_text() == before and [p.name for p in tmp_path.iterdir()] == ["m.toml"]
