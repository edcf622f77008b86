"""Options of `mb.simulate`, checked and in the form that the core takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.border import require_memory
from .._lib.checks import choice, count, is_word, positive, real_array, real_number, rising, shown
from ..errors import ModelError
from ..model.directions import directions
from ..system.effects import LINEAR_ONLY, check_without
from ..system.snapshot import Snapshot
from ..system.state import State

if TYPE_CHECKING:
    from ..model.model import Model

METHODS = ("auto", "explicit", "generalized-alpha", "radau", "bdf", "bdf-bfgs", "ali3p")
# of the error over the step
ORDER = {"explicit": 8, "generalized-alpha": 2, "radau": 5, "radau/9": 9, "bdf": 4, "bdf-bfgs": 4, "ali3p": 2}
# their error is estimated by a tighter run, that of the others by a looser one
TIGHTENED = frozenset({"explicit", "radau", "bdf", "bdf-bfgs"})
TIGHTEST, LOOSEST = 1e-13, 1e-1
# the tolerance where none is asked for
DEFAULT = 1e-7
# more would take days
MOST_STEPS = 10**9
# numbers that an output of a motion and a step of a gradient hold while they are made, measured: 380 and 430 bytes with one coordinate,
# 1080 with twelve and 780 with eight. Larger, motions are refused that would fit; smaller, the process ends for want of memory
# (tests/test_memory.py)
_NUMBERS_OF_AN_INSTANT, _NUMBERS_OF_A_COORDINATE = 48, 8
# below it the norm to which the equations of a step of bdf-bfgs are solved shows in the rates, and steps collapse; with rows of loops
# or drives it shows earlier (slider-crank: from 1e-8 on errors of 7e-10 to 1.4e-8, whatever is asked, over 16 noises of 1e-13)
_TIGHTEST_WITHOUT_TANGENT = 1e-10
_TIGHTEST_WITH_ROWS = 1e-8
# updates of multipliers in one linear system
_MOST_PASSES = 1000


def effects_without(without: Sequence[str]) -> tuple[str, ...]:
    """The effects to leave out, checked."""
    names = check_without(without)
    for name in names:
        if name in LINEAR_ONLY:
            raise ModelError(f"'{name}' is a part of a linearisation; a motion cannot be without it")
    return names


def with_served_tolerance(options: dict[str, Any], snapshot: Snapshot) -> dict[str, Any]:
    """The options with the tolerance that the method can serve."""
    if options["method"].partition("/")[0] != "bdf-bfgs" or "rtol" not in options:
        return options
    rows = snapshot.system.topology()["row_joint"]
    least = _TIGHTEST_WITH_ROWS if rows else _TIGHTEST_WITHOUT_TANGENT
    return {**options, "rtol": max(options["rtol"], least)}


def variant(method: str, form: Any, update: Any, coordinates: Any, order: Any) -> str:
    """The method with what belongs to it, as the core names it: "explicit/tree", "radau/9", "bdf-bfgs/ggl/auto"."""
    if order is not None:
        if isinstance(order, bool) or not isinstance(order, int | np.integer) or order not in (5, 9):
            raise ModelError(f"order= is 5 or 9, got {shown(order)}")
        if method != "radau":
            raise ModelError(f'order= belongs to method="radau", not to {shown(method)}')
        method = f"radau/{int(order)}"
    if coordinates is not None:
        if not is_word(coordinates, ("tree", "independent")):
            raise ModelError(f"coordinates= is 'tree', 'independent' or 'absolute', got {shown(coordinates)}")
        if method != "explicit":
            raise ModelError(f'coordinates={coordinates!r} belongs to method="explicit", not to {shown(method)}')
        method = f"{method}/{coordinates}"
    if form is None and update is None:
        return method
    if method != "bdf-bfgs":
        method = method.partition("/")[0]
        raise ModelError(f'form= and update= belong to method="bdf-bfgs", not to {shown(method)}')
    form, update = "ggl" if form is None else form, "auto" if update is None else update
    if form not in ("ggl", "symmetric"):
        raise ModelError(f"form= is 'ggl' or 'symmetric', got {shown(form)}")
    if update not in ("auto", "bfgs", "broyden"):
        raise ModelError(f"update= is 'auto', 'bfgs' or 'broyden', got {shown(update)}")
    return f"{method}/{form}/{update}"


def penalised(method: str, penalty: Any, passes: Any, parameters: Any) -> dict[str, float]:
    """Penalty factor and passes of "ali3p", where they are given."""
    if penalty is None and passes is None:
        return {}
    if method != "ali3p":
        raise ModelError(f'penalty= and passes= belong to method="ali3p", not to {shown(method)}')
    if parameters is not None:
        raise ModelError(
            "sensitivities belong to the limit of many passes; leave out penalty= and passes=, or parameters="
        )
    if penalty is None:
        raise ModelError("passes= belongs to a penalty factor: give penalty=, such as 1e6")
    return {
        "penalty": positive("penalty=", penalty),
        "passes": float(count("passes", 1 if passes is None else passes, _MOST_PASSES)),
    }


def with_sensitivities(m: Model, parameters: Any, method: str, coordinates: Any) -> tuple[str, Any]:
    """Method and coordinates of a motion that is differentiated."""
    if coordinates == "absolute":
        raise ModelError('a motion in coordinates="absolute" has no sensitivities; leave out one of both')
    if not is_word(method, ("auto", "explicit", "radau", "bdf", "ali3p", "generalized-alpha")):
        raise ModelError(
            f"method={shown(method)} has no sensitivities; those that have are method='explicit', 'radau', 'bdf', 'ali3p' and "
            "'generalized-alpha', or leave parameters= out"
        )
    method = "ali3p" if method == "auto" else method
    if method == "explicit" and coordinates == "independent":
        raise ModelError(
            'a motion in coordinates="independent" has no sensitivities; leave out coordinates= or parameters='
        )
    if not isinstance(parameters, (str, Sequence)):
        raise ModelError(f"parameters= takes an address or a list of them, got {shown(parameters)}")
    directions(m, parameters)
    return method, "tree" if method == "explicit" else coordinates


def refuse_order_nine(order: Any, parameters: Any) -> None:
    """Nine in a motion that is differentiated."""
    if parameters is not None and order == 9:
        raise ModelError('sensitivities of "radau" are those of order 5; leave out order=9, or parameters=')


def refuse_output_times(options: Mapping[str, Any], parameters: Any) -> None:
    """Times other than those of the steps, in a motion that is differentiated."""
    if parameters is not None and "outputs" in options:
        raise ModelError(
            "sensitivities belong to the steps of a motion: with parameters= give t= as a number, or take mb.gradient with "
            "mb.AtTimes for given times"
        )


def refuse_options_of_models(given: Mapping[str, Any], without: Sequence[str]) -> None:
    for name, value in given.items():
        if value is not None:
            raise ModelError(f"{name}= belongs to motions of a Model; a MechanicalSystem starts from x0= and v0=")
    if tuple(without):
        raise ModelError("without= belongs to motions of a Model; a MechanicalSystem is what its matrices are")


def refuse_options_of_matrices(given: Mapping[str, Any]) -> None:
    for name, value in given.items():
        if value is not None:
            raise ModelError(
                f"{name}= belongs to motions of a MechanicalSystem; a model has m.force(..., value=f), and at= for its start"
            )


def limits(rho: Any, max_step: Any, first_step: Any, max_steps: Any, span: float) -> dict[str, float]:
    """Damping of generalised-alpha and limits of the steps, those that are given."""
    given = {"max_step": max_step, "first_step": first_step, "max_steps": max_steps}
    options = {name: positive(f"{name}=", value) for name, value in given.items() if value is not None}
    if rho is not None:
        options["rho"] = real_number("rho=", rho, 0.0, 1.0)
    if max_steps is not None and options["max_steps"] % 1.0 != 0.0:
        raise ModelError(f"max_steps= must be a whole number, got {shown(max_steps)}")
    if max_step is not None and span / options["max_step"] > MOST_STEPS:
        raise ModelError(f"max_step={max_step} would need more than 1e9 steps")
    return options


def require_room(instants: float, state: State, what: str, remedy: str) -> None:
    """Memory of what is kept of every instant of a motion."""
    size = 8.0 * (_NUMBERS_OF_AN_INSTANT + _NUMBERS_OF_A_COORDINATE * len(state.q)) * instants
    require_memory(size, what, remedy)


def motion_options(t: Any, rtol: Any, step: Any, method: Any, state: State) -> dict[str, Any]:
    """Method, outputs, end, and the fixed step or the tolerance, for the core."""
    choice("method", method, METHODS)
    if rtol is not None and step is not None:
        raise ModelError("give rtol= (controlled steps) or step= (fixed steps), not both")
    options: dict[str, Any] = {"method": method, "t": state.t, "memory": state.memory.tolist()}
    times = real_array("t=", t, None, "give the end in s, or the times of the outputs")
    if times.ndim:
        require_room(times.size, state, f"a motion with {times.size} outputs", "ask for fewer times")
        options["outputs"] = rising("t=", times, 1).tolist()
    options["end"] = float(times.max())
    if times.min() < state.t:
        raise ModelError(f"t={times.min():.9g} s lies before the start at {state.t:.9g} s")
    if times.ndim == 0 and options["end"] == state.t:
        raise ModelError(f"t= must lie after the start at {state.t:.9g} s")
    if step is not None:
        options["step"] = positive("step=", step)
        if (options["end"] - state.t) / options["step"] > MOST_STEPS:
            raise ModelError(f"step={step} would need more than 1e9 steps")
        if times.ndim == 0:
            outputs = (options["end"] - state.t) / options["step"]
            require_room(
                outputs,
                state,
                f"a motion with {outputs:.0f} outputs",
                "name the times of the outputs, such as t=np.linspace(0, 1, 101)",
            )
    else:
        options["rtol"] = positive("rtol=", DEFAULT if rtol is None else rtol)
        if not TIGHTEST <= options["rtol"] <= LOOSEST:
            raise ModelError(f"rtol= must lie between {TIGHTEST} and {LOOSEST}, got {shown(rtol)}")
    return options
