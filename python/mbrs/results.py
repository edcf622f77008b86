"""What every analysis returns: a frozen object that prints, plots, saves and says what it cost and how far it may
be off.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Stats:
    """What a result cost: wall time in seconds, deterministic work counts, the effects that ran, the route that was
    taken.
    """

    wall_time: float = 0.0
    counts: Mapping[str, int] = field(default_factory=dict)
    effects: tuple[str, ...] = ()
    route: str = ""


def added_counts(*parts: Any) -> dict[str, int]:
    """Work counts of several steps together; a part may be counts, or anything with ``.stats`` (else it counts
    nothing).
    """
    total: dict[str, int] = {}
    for part in parts:
        counts = part if isinstance(part, Mapping) else getattr(getattr(part, "stats", None), "counts", {})
        for name, n in counts.items():
            total[name] = total.get(name, 0) + n
    return total


@dataclass(frozen=True, eq=False)
class Result:
    """Base of all results. Subclasses add arrays, `__str__` as a readable table, `plot` and `to_xarray`.

    ``error`` is an estimate computed with the result (relative unless the subclass says otherwise), ``status`` a
    named reason.
    """

    stats: Stats = field(default_factory=Stats, kw_only=True)
    error: Any = field(default=None, kw_only=True)
    status: str = field(default="converged", kw_only=True)

    def save(self, path: str | Path) -> Path:
        """Save as NetCDF (``.nc``, through xarray) or as a pickle (any other ending). Returns the path."""
        path = Path(path)
        if path.suffix == ".nc":
            self.to_xarray().to_netcdf(path, engine="h5netcdf")
        else:
            path.write_bytes(pickle.dumps(self))
        return path

    def to_xarray(self) -> Any:
        """The result as labelled data (`xarray.Dataset`; needs ``pip install mbrs-dynamics[xarray]``)."""
        raise TypeError(f"{type(self).__name__} has no labelled form")
