"""The public names: complete, known to type checkers, listed in docs/api.md."""

from __future__ import annotations

import importlib
import inspect

import mbrs
import public_names
import pytest
from mbrs._lib.names import PUBLIC
from mbrs.results import Result


def subclasses(cls):
    return {cls}.union(*(subclasses(one) for one in cls.__subclasses__()))


def test_every_result_has_a_public_name():
    for path in public_names.PACKAGE.rglob("*.py"):
        parts = path.relative_to(public_names.PACKAGE).with_suffix("").parts
        if path.name != "__init__.py" and parts[0] not in ("cli", "reference"):
            importlib.import_module("mbrs." + ".".join(parts))
    found = {cls for cls in subclasses(Result) if cls.__module__.startswith("mbrs.")}
    assert len(found) > 25
    for cls in found:
        assert getattr(mbrs, cls.__name__, None) is cls, f"mbrs.{cls.__name__} is missing in mbrs/_lib/names.py"


def test_names_come_from_the_modules_that_define_them():
    for name, home in PUBLIC.items():
        value = getattr(mbrs, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert value.__module__ == f"mbrs.{home}", name
            assert inspect.getdoc(value), f"mb.{name} has no docstring"


def test_every_name_is_on_the_page_under_a_title():
    homes = {home.split(".")[0] for home in PUBLIC.values()} - {"_lib"}
    assert homes == set(public_names.TITLES)


@pytest.mark.skipif(not public_names.PAGE.exists(), reason="an installed package has no docs beside it")
def test_the_stub_and_the_page_list_them():
    assert public_names.STUB.read_text(encoding="utf-8") == public_names.stub(), "run python tests/public_names.py"
    assert public_names.PAGE.read_text(encoding="utf-8") == public_names.page(), "run python tests/public_names.py"
