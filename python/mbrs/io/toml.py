"""Models as TOML files, see `mbrs.model.toml`."""

from __future__ import annotations

from pathlib import Path

from .._lib.formats import Format, register
from ..model import toml
from ..model.model import Model


def read(path: Path, functions: bool = False) -> Model:
    """A model as `Model.save` wrote it, or as a user did."""
    model: Model = toml.load(path, Model, functions)
    return model


register(Format(".toml", "model", "TOML of mbrs", read, toml.save))
