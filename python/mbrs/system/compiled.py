"""The core's System of a model, compiled once for a topology."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..model import tables

if TYPE_CHECKING:
    from ..model.model import Model


def compiled(model: Model, flexible: bool = True) -> Any:
    """The core's System at the present values; the topology is compiled once. ``flexible=False``: flexible bodies are rigid there."""
    from .. import _core

    now = (model.structure_version, model.values_version)
    systems: dict[bool, Any] = model.cache.setdefault("compiled", {})
    kept = systems.get(flexible)
    if kept is None or kept[0][0] != now[0]:
        kept = (now, _core.System(tables.tables(model, flexible)))
    elif kept[0] != now:
        kept = (now, kept[1].with_values(tables.x(model)))
    systems[flexible] = kept
    return kept[1]
