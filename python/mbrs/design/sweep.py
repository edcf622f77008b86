"""One function of a model for many designs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import choice, count, real_array, shown
from ..errors import ModelError
from .session import Options, Session
from .table import Designs

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from ..model.model import Model
    from .pools import HasSubmit
    from .runs import Runs


def sweep(
    model: Model,
    designs: Designs,
    outputs: Callable[[Any], Mapping[str, Any]] | None = None,
    *,
    executor: int | Executor | HasSubmit | None = None,
    store: str | Path | None = None,
    on_error: str = "record",
    time_limit: float | None = None,
    chunk: int | None = None,
    n: int | None = None,
    progress: bool | None = None,
) -> Runs:
    """Compute outputs for every design: y_i = outputs(model with the numbers of design i).

    Every design starts from the model as it is given, so that neither executor nor order nor chunks change a bit of the results.
    Designs go out in chunks that take about ten seconds; the first ones tell how many these are.

    Parameters
    ----------
    model
        Is not changed.
    designs
        From ``mb.design``: their names are addresses of the model.
    outputs
        One of ``mb.outputs``, or a function of the model that returns numbers and arrays by name. With ``store`` it is a function
        of a module, with an executor of processes one that can be imported.
    executor
        None (here, one after the other), a number of threads, any executor of `concurrent.futures`, or a
        `dask.distributed.Client` (``pip install mbrs-dynamics[dask]``).
    store
        A folder, which keeps results as they come. The same call again goes on where it was; another model, other outputs or
        designs are refused with what differs. One process at a time writes there.
    on_error
        "record": what fails is data, see ``runs.failures``; "raise": the first failure ends the sweep.
    time_limit
        Seconds for one design, after which it counts as failed. In threads and on Dask, compiled code is let finish first.
    chunk
        Designs of a chunk, instead of what the first ones tell.
    n
        How many of the designs that have no result to compute now: 0 for ``runs.ask`` and ``runs.tell``.
    progress
        True shows a line with rate, time left and failures, False none; by default on a terminal, after a second.

    Returns
    -------
    Runs

    Raises
    ------
    ModelError
        Designs that do not fit the model, outputs that cannot go to the workers.
    StoreError
        The folder is in use or belongs to another sweep, or the disk is full; ``.result`` has the runs so far.
    DesignError
        With ``on_error="raise"``; ``.result`` has the runs so far.
    Interrupted
        Ctrl-C; ``.result`` has the runs so far.

    Notes
    -----
    A design that ends its process (out of memory, a crash of compiled code) is found and recorded as "killed": in the same run with
    executors of processes and Dask, by the next call with the same ``store`` otherwise. The chunk is halved in child processes
    until one design is left, which has to end three of them.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.examples.cubic_hexapod()
    >>> designs = mb.design.latin_hypercube({"k_leg": (5e4, 2e5), "c_leg": (10, 200)}, n=20, seed=1)
    >>> runs = mb.sweep(m, designs, mb.outputs.modes(n=6))
    >>> runs["frequency"].shape
    (20, 6)
    """
    checked_designs(model, designs)
    if outputs is not None and not callable(outputs):
        raise ModelError(f"outputs= must be one of mb.outputs or a function of the model, it is {shown(outputs)}")
    if outputs is None and n != 0:
        raise ModelError("outputs= is missing: without it n=0 leaves the computing to runs.ask and runs.tell")
    if time_limit is not None and not (float(real_array("time_limit", time_limit)) > 0.0 and math.isfinite(time_limit)):
        raise ModelError(f"time_limit={time_limit!r} must be a number of seconds above 0")
    options = Options(
        executor,
        None if chunk is None else count("chunk", chunk, 10**8),
        time_limit,
        choice("on_error", on_error, ("record", "raise")),
        progress,
    )
    session = Session(model, designs, outputs or no_outputs, store, options)
    return session.run(None if n is None else count("n", n, 10**9, least=0))


def no_outputs(model: Any) -> dict[str, Any]:
    """Stands for outputs that are computed elsewhere."""
    raise ModelError("this sweep has no outputs=; give them to mb.sweep, or use runs.tell")


def checked_designs(model: Any, designs: Any) -> None:
    """Names that are single numbers of the model, in its units."""
    from ..model.addresses import target

    if not isinstance(designs, Designs):
        raise ModelError(
            f"designs must come from mb.design, such as mb.design.from_table(...), they are {shown(designs)}"
        )
    if not np.all(np.isfinite(designs.values)):
        raise ModelError("the designs hold NaN or infinite numbers")
    for name, unit in zip(designs.names, designs.units, strict=True):
        place = target(model, name)
        if place.shape != ():
            raise ModelError(f"{name!r} holds {len(place.labels)} numbers; name one, such as {place.labels[0]!r}")
        if place.item is None:
            own = model.space.unit_of(place.components[0])
            if unit and own and unit != own:
                raise ModelError(f"the designs have {name!r} in {unit}, the model in {own}")
