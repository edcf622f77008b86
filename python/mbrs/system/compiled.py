"""The core's System of a model, compiled once for a topology."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..model import tables

if TYPE_CHECKING:
    from ..model.model import Model


def compiled(model: Model, flexible: bool = True, absolute: bool = False) -> Any:
    """The core's System at the present values; the topology is compiled once. ``flexible=False``: flexible bodies are rigid there;
    ``absolute``: every body has coordinates of its own and all joints are rows.
    """
    from .. import _core

    now = (model.structure_version, model.values_version)
    systems: dict[tuple[bool, bool], Any] = model.cache.setdefault("compiled", {})
    kept = systems.get((flexible, absolute))
    if kept is None or kept[0][0] != now[0]:
        kept = (now, _core.System(tables.tables(model, flexible, absolute)))
    elif kept[0] != now:
        kept = (now, kept[1].with_values(tables.x(model)))
    systems[flexible, absolute] = kept
    return kept[1]
