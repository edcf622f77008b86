"""A model as it was when a result was made: compiled, with its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .. import _core
from .._lib.border import core_errors
from ..errors import ModelError
from ..model.book import Book
from ..model.scene import scene_from_tables
from ..model.tables import tables, tables_with_nodes
from ..view.scene import SceneGeometry
from .compiled import compiled

if TYPE_CHECKING:
    from ..model.model import Model


@dataclass(frozen=True, eq=False, repr=False)
class Snapshot:
    """The model as it was when a result was made: its compiled form, its numbers, and the versions that say whether it
    changed since.
    """

    model: Model
    system: Any
    versions: tuple[int, int]
    tables: dict[str, Any]

    @classmethod
    def of(cls, model: Model, without: Sequence[str] = (), absolute: bool = False) -> Snapshot:
        """Compile a model as it is now; without the effect "flexibility" its flexible bodies are rigid; ``absolute``: with all
        joints as rows between bodies that have coordinates of their own.
        """
        if not isinstance(model, Book):
            raise ModelError(f"expected a mb.Model, got {type(model).__name__}")
        with core_errors():
            flexible = not (model.is_flexible and "flexibility" in without)
            system = compiled(model, flexible, absolute)
        made = tables_with_nodes(tables(model, flexible, absolute))
        return cls(model, system, (model.structure_version, model.values_version), made)

    def frame(self, name: str) -> int:
        """Index of a body, or of a node ``body.node`` that the results follow."""
        names = self.tables["body_name"]
        if name not in names and "flexible_body" not in self.tables:
            name = name.partition(".")[0]
        if name not in names:
            raise ModelError(
                f"this result does not follow the node {name!r}, which was named after it: compute it again"
            )
        index: int = names.index(name)
        return index

    @property
    def scene(self) -> SceneGeometry:
        """Bodies, springs and joints to draw, as the model was drawn."""
        return scene_from_tables(self.tables, self.model)

    @property
    def current(self) -> bool:
        """True while the model is as it was."""
        return (self.model.structure_version, self.model.values_version) == self.versions

    def check_current(self, what: str) -> None:
        """Derivatives need the expressions as they were: refuse when the model was changed in between."""
        if not self.current:
            raise ModelError(
                f"model {self.model.name!r} was changed after this {what} was computed; compute it again, then its "
                "sensitivities"
            )

    def __getstate__(self) -> dict[str, Any]:
        raw = self.tables.get("raw", self.tables)
        kind = {"flexible": "flexible_body" in raw, "absolute": "absolute" in raw}
        return {"model": self.model, "current": self.current, "tables": raw, **kind}

    def data_state(self) -> dict[str, Any]:
        """State for a file of data: the Tables of a model are made again from it."""
        state = self.__getstate__()
        return {**state, "tables": None} if state["current"] else state

    def __setstate__(self, state: dict[str, Any]) -> None:
        model, current, absolute = state["model"], state["current"], state.get("absolute", False)
        # a model that can be flexible, but was compiled without it
        flexible = state["flexible"] or not model.is_flexible
        if state["tables"] is None:
            state = {**state, "tables": tables(model, flexible, absolute)}
        system = compiled(model, flexible, absolute) if current else _core.System(state["tables"])
        versions = (model.structure_version, model.values_version) if current else (-1, -1)
        for name, value in (
            ("model", model),
            ("system", system),
            ("versions", versions),
            ("tables", tables_with_nodes(state["tables"])),
        ):
            object.__setattr__(self, name, value)
