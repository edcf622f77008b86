"""Motion in time: `mb.simulate`."""

from __future__ import annotations

import functools
import time
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from .. import _core
from .._lib.border import core_errors
from .._lib.checks import is_word
from .._lib.warning import warn_user
from ..errors import ConvergenceError, Interrupted
from ..linear.matrices import MechanicalSystem
from ..linear.response import ResponseResult
from ..results import Stats
from ..system.air_flow import flows, require_covered
from ..system.effects import effects
from ..system.snapshot import Snapshot
from ..system.state import State, state_of
from .air_march import Wakes, march, stepped
from .amplification import warn_amplified
from .error import estimated_error, run_core
from .matrix_motion import simulate_matrices
from .options import (
    effects_without,
    limits,
    motion_options,
    penalised,
    refuse_options_of_matrices,
    refuse_options_of_models,
    refuse_order_nine,
    refuse_output_times,
    variant,
    with_sensitivities,
    with_served_tolerance,
)
from .tangent import differentiated_by
from .trajectory import Trajectory

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ..linear.aliases import Loads
    from ..model.model import Model
    from ..system.state import StateLike

# changes of initial values below this are rounding
_CHANGED = 1e-9
# deflections beyond this part of a body's length are too large for linear elasticity in a frame
_BENT = 0.2
# for derivatives, steps end at kinks of laws to rounding
_EXACT = {"exact_kinks": 1.0}


@overload
def simulate(
    m: Model,
    t: ArrayLike,
    *,
    rtol: float | None = None,
    step: float | None = None,
    method: str = "auto",
    at: StateLike = None,
    without: Sequence[str] = (),
    rho: float | None = None,
    form: str | None = None,
    update: str | None = None,
    coordinates: str | None = None,
    order: int | None = None,
    max_step: float | None = None,
    first_step: float | None = None,
    max_steps: int | None = None,
    parameters: str | Sequence[str] | None = None,
    penalty: float | None = None,
    passes: int | None = None,
) -> Trajectory: ...


@overload
def simulate(
    m: MechanicalSystem,
    t: ArrayLike,
    *,
    rtol: float | None = None,
    step: float | None = None,
    method: str = "auto",
    rho: float | None = None,
    form: str | None = None,
    update: str | None = None,
    order: int | None = None,
    max_step: float | None = None,
    first_step: float | None = None,
    max_steps: int | None = None,
    loads: Loads | None = None,
    x0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
) -> ResponseResult: ...


def simulate(
    m: Model | MechanicalSystem,
    t: ArrayLike,
    *,
    rtol: float | None = None,
    step: float | None = None,
    method: str = "auto",
    at: StateLike = None,
    without: Sequence[str] = (),
    rho: float | None = None,
    form: str | None = None,
    update: str | None = None,
    coordinates: str | None = None,
    order: int | None = None,
    max_step: float | None = None,
    first_step: float | None = None,
    max_steps: int | None = None,
    parameters: str | Sequence[str] | None = None,
    penalty: float | None = None,
    passes: int | None = None,
    loads: Loads | None = None,
    x0: ArrayLike | None = None,
    v0: ArrayLike | None = None,
) -> Any:
    """Integrate the constrained equations of motion from an initial state, or the nonlinear equations of a matrix system.

        M(q) v' + h(q, v, t) + J^T lam = 0,   Phi(q, t) = 0,   J v + Phi_t = 0
        M x" + (C + G) x' + (K + N) x + sum_e w_e law_e(w_e . x, w_e . x') = sum_j F_j u_j(t)

    Parameters
    ----------
    m
        The model, with its present values; or a `MechanicalSystem` with its elements.
    t
        s. A number: the end; outputs are the accepted steps and the last is exactly t. An array: the output times, increasing,
        in any relation to the steps (dense output).
    rtol
        Tolerance of the controlled steps, relative to the characteristic length, one radian and the largest rate so far;
        1e-7 if neither it nor ``step`` is given. "bdf-bfgs" serves tolerances down to 1e-10, with
        loops, drives and rolling down to 1e-8, and warns of tighter ones.
    step
        s; fixed steps instead.
    method
        "auto" chooses from what the scene contains and says why in ``stats.route``; "explicit" (order 8, for scenes that
        are not stiff); "radau" (Radau IIA of order 5 or 9, for stiff scenes); "generalized-alpha" (order 2, on the Lie group);
        "bdf" (orders 1 to 5 with Newton's method, for stiff scenes with costly forces; order 4 with ``step``); "bdf-bfgs"
        (order 4, no tangent: the equations of a step are solved by inverse quasi-Newton updates, see `mb.root`; it warns of
        undamped modes that it amplifies); "ali3p" (index-3 augmented Lagrangian with projections, order 2: the scheme whose
        gradients `mb.gradient` takes).
    at
        Start: None (drawn, with the given velocities), an equilibrium, a steady motion, or ``traj.state(t)`` to go on.
    without
        Effects to leave out: "gravity", "damping", "friction", "contact", "centrifugal", "aerodynamics".
    rho
        Generalised-alpha: spectral radius at infinite frequency, 0 <= rho <= 1 (default 0.8).
    form, update
        "bdf-bfgs": the equations of a step, "ggl" (default; positions and velocities, stabilised index 2) or "symmetric"
        (positions and h^2 lam), and the inverse update: "auto" (default; BFGS until it has failed twice, then Broyden's, which
        ``stats.route`` tells), "bfgs" or "broyden"; docs/root.md compares them.
    coordinates
        "explicit": what its stages integrate where there are loops, drives or rolling. "tree": all tree coordinates, with the
        constraints at acceleration level, projected onto them after each step. "independent": those that determine the others
        (Wehage and Haug 1982), which are switched between steps where others would serve better; ``stats.route`` names them.
        None: independent where many loops leave few degrees of freedom, else tree (docs/motion.md). Every method: "absolute":
        each body moves by six coordinates of its own (its floating frame, if it is flexible), and every joint is a set of rows
        beside those of drives, as in most texts. The motion is the same, at the cost of all its rows; ``at`` is None or a state
        of such a motion. Rows do not count turns: angles of hinges lie within half a turn, and a motion in which a spring or law of a hinge
        passes it stops.
    order
        "radau": 5 (default; three stages) or 9 (five stages: fewer and dearer steps, for tight tolerances). With ``parameters``, and in
        `mb.gradient`, it is 5.
    max_step, first_step
        s; limits of the controlled steps.
    max_steps
        Stop after so many.
    penalty, passes
        "ali3p": penalty factor in effective masses of the rows, and how often the multipliers are updated (by default once) in every
        linear system of a step and in each projection. None: the limit of many passes, solved at once, which no penalty has a part
        in. ``stats.measures`` has the largest residuals of velocities and accelerations before and after their projections (in
        characteristic lengths or radians per s and s^2), ``stats.counts`` the passes.
    parameters
        Addresses of numbers by which ``traj.sensitivity(...)`` is to differentiate ("auto" takes "ali3p" then, and
        "explicit" or "radau" where laws have kinks); ``t`` is a number then.
    loads, x0, v0
        Of a `MechanicalSystem` only. ``{coordinate: load}`` or a list of pairs (direction (n,), load); a load is a number, a motion
        (`mb.Sine`, `mb.Table`, ...) or a function of time. Start values (n,) of the coordinates and their rates at t = 0, zero by
        default; laws with states are at rest there. ``rtol`` is relative to the largest sqrt(M_ii) x_i of the motion then, and
        ``at``, ``without``, ``coordinates`` and ``parameters`` belong to models.

    Returns
    -------
    Trajectory
        Of a `MechanicalSystem` a `ResponseResult`: displacement, velocity and acceleration of all coordinates over time, ``.error`` from a
        second run as for models, relative to the largest value of each coordinate.

    Raises
    ------
    ModelError
        Wrong arguments.
    AssemblyError
        A start from which the loops cannot close.
    ConvergenceError
        A step that cannot be made; ``.result`` holds the trajectory until then.
    Interrupted
        Ctrl-C; ``.result`` holds the trajectory until then.

    Warns
    -----
    MbrsWarning
        Initial positions or velocities that had to be changed to agree with the joints; flexible bodies that deflect by more
        than a fifth of their length.

    Notes
    -----
    Equations: docs/theory.md (2.1), (2.2), and its sections 16 to 18.
    Constraints hold at position, velocity and acceleration level at every output, redundant ones too. Cost per step O(n^3) in the
    number of tree coordinates and loop rows. Sources: see `rust/src/integrate`.

    Examples
    --------
    >>> import mbrs as mb
    >>> traj = mb.simulate(mb.examples.four_bar(), t=0.5, rtol=1e-8)
    >>> bool(abs(traj.energy[-1] - traj.energy[0]) < 1e-5)
    True
    >>> duffing = mb.MechanicalSystem([[1.0]], [[0.05]], [[1.0]], elements=[mb.Cubic(0.1, w=[1.0])])
    >>> y = mb.simulate(duffing, t=10.0, loads={0: mb.Sine(0.18, 1.2)}, x0=[0.5])
    >>> bool(y.error[0] < 1e-5)
    True
    """
    of_models: dict[str, Any] = dict(
        at=at, coordinates=coordinates, parameters=parameters, penalty=penalty, passes=passes
    )
    given: dict[str, Any] = dict(rtol=rtol, step=step, method=method, rho=rho, form=form, update=update)
    given |= dict(order=order, max_step=max_step, first_step=first_step, max_steps=max_steps)
    if isinstance(m, MechanicalSystem):
        refuse_options_of_models(of_models, without)
        return simulate_matrices(m, t, loads, x0, v0, given, simulate)
    refuse_options_of_matrices(dict(loads=loads, x0=x0, v0=v0))
    return _of_model(m, t, without=without, **given, **of_models)[0]


def to_be_differentiated(
    m: Model, t: ArrayLike, *, ends: Sequence[float] | None = None, keep: int | None = None, **asked: Any
) -> tuple[Trajectory, dict[str, Any]]:
    """As `simulate`, and the numbers of the core; steps, fixed ones too, end at kinks of laws to rounding; fixed ones end at ``ends``.

    With ``keep`` steps of "radau" or "bdf" by a tolerance are solved to rounding, and kept where they need at most so many numbers and
    are all of the method.
    """
    given = {"ends": ends, "keep": keep}
    special = _EXACT | {name: value for name, value in given.items() if value is not None}
    return _of_model(m, t, special=special, **asked)


def _of_model(
    m: Model,
    t: ArrayLike,
    *,
    rtol: float | None = None,
    step: float | None = None,
    method: str = "auto",
    at: StateLike = None,
    without: Sequence[str] = (),
    rho: float | None = None,
    form: str | None = None,
    update: str | None = None,
    coordinates: str | None = None,
    order: int | None = None,
    max_step: float | None = None,
    first_step: float | None = None,
    max_steps: int | None = None,
    parameters: str | Sequence[str] | None = None,
    penalty: float | None = None,
    passes: int | None = None,
    special: Mapping[str, Any] = MappingProxyType({}),
) -> tuple[Trajectory, dict[str, Any]]:
    """A motion, and the numbers of the core; ``special``: further options for it."""
    start = time.perf_counter()
    without = effects_without(without)
    absolute = is_word(coordinates, ("absolute",))
    snapshot = Snapshot.of(m, without, absolute)
    state = state_of(m, snapshot.system, at, hold=False, without=without)
    if parameters is not None:
        if (
            is_word(method, ("auto",))
            and step is None
            and isinstance(t, (int, float))
            and _has_kinks(snapshot, without)
        ):
            # steps of order two through a stiff contact are countless
            method = differentiated_by(snapshot, state, without, float(t), None)
        method, coordinates = with_sensitivities(m, parameters, method, coordinates)
    options = motion_options(t, rtol, step, method, state)
    options |= limits(rho, max_step, first_step, max_steps, options["end"] - state.t)
    options |= penalised(method, penalty, passes, parameters)
    options["method"] = variant(method, form, update, None if absolute else coordinates, order)
    refuse_order_nine(order, parameters)
    refuse_output_times(options, parameters)
    if parameters is not None and step is None:
        special = {**_EXACT, **special}
    served = {**with_served_tolerance(options, snapshot), **special}
    made, snapshot, wake = _integrated(m, snapshot, state, without, served, absolute)
    traj = _trajectory(m, snapshot, made, without, time.perf_counter() - start, state, served, wake)
    if parameters is not None:
        kinks = {"smooth": made["smooth"], "missed": made["missed"]}
        traj = traj.replaced(parameters=parameters, start=state, rho=rho, **kinks)
    if m.airs and "aerodynamics" not in without:
        require_covered(m, traj.t, flows(snapshot.system, traj.t, traj.q, traj.rate, traj.memory))
    if traj.status == "interrupted":
        raise Interrupted(f"the motion of {m.name!r} was interrupted at t = {made['end']:.6g} s", traj)
    _warn(m, at, made, traj, options, served)
    if traj.status == "stopped":
        raise ConvergenceError(
            f"the motion of {m.name!r} stopped at t = {made['end']:.9g} s: {made['message']}; the trajectory until then is "
            "the result of this error",
            traj,
        )
    return traj, made


def _has_kinks(snapshot: Snapshot, without: Sequence[str]) -> bool:
    with core_errors():
        return _core.motion_has_kinks(snapshot.system, list(without), False)


def _integrated(
    m: Model, snapshot: Snapshot, state: State, without: tuple[str, ...], options: dict[str, Any], absolute: bool
) -> tuple[dict[str, Any], Snapshot, Wakes | None]:
    """The numbers of the core, the snapshot that they belong to, and the wake where the air has one."""
    air = stepped(m, without, absolute)
    if air is None:
        return run_core(snapshot, state, without, options), snapshot, None
    return march(air, snapshot, state, without, options, lambda s, x, o: run_core(s, x, without, o, True))


def _warn(
    m: Model, at: StateLike, made: dict[str, Any], traj: Trajectory, asked: dict[str, Any], served: dict[str, Any]
) -> None:
    _warn_of_start(m, made)
    if asked["method"].partition("/")[0] in ("bdf", "bdf-bfgs") and "step" in asked:
        # steps that follow a tolerance see what grows
        warn_amplified(m, at, traj.steps)
    _warn_of_tolerance(asked, served)
    _warn_of_bending(traj)


def _warn_of_tolerance(asked: dict[str, Any], served: dict[str, Any]) -> None:
    if served.get("rtol") != asked.get("rtol"):
        warn_user(
            f"rtol={asked['rtol']:g} was not reached: the equations of a step are solved without a tangent, which allows "
            f"{served['rtol']:g}; .error estimates the error of the motion"
        )


def _warn_of_bending(traj: Trajectory) -> None:
    for name in traj.flexible:
        handle: Any = traj.model.bodies[traj.bodies.index(name)]
        body = handle.modal
        if len(body.line_position) < 2 or not len(traj.t):
            continue
        extent = np.linalg.norm(np.ptp(body.line_position, axis=0))
        moved = np.einsum("kim,tm->tki", body.line_shape[:, :3], traj.modal(name))
        part = float(np.linalg.norm(moved, axis=-1).max() / extent) if extent > 0.0 else 0.0
        if part > _BENT:
            warn_user(
                f"{name!r} deflects by {part:.2g} of its length; flexible bodies deform linearly in their frame, which is "
                "for small deflections: stiffen it, or divide it into several bodies"
            )


def _trajectory(
    m: Model,
    snapshot: Snapshot,
    made: dict[str, Any],
    without: tuple[str, ...],
    wall: float,
    state: State,
    options: dict[str, Any],
    wake: Wakes | None,
) -> Trajectory:
    acting = tuple(e.name for e in effects(m) if e.on and e.name not in without)
    return Trajectory(
        t=made["t"],
        q=made["q"],
        rate=made["rate"],
        memory=made["memory"],
        acceleration=made["acceleration"],
        multipliers=made["multipliers"],
        joints=made["joints"],
        steps=made["steps"],
        local_error=made["local_error"],
        orders=tuple(int(k) for k in made["orders"]),
        method=made["method"],
        message=made["message"],
        snapshot=snapshot,
        wake=wake,
        without=without,
        error=functools.partial(estimated_error, state=state, options=options),
        stats=Stats(
            wall,
            dict(made["counts"]),
            acting,
            f"{made['method']}: {made['why']}{_solved_by(made, options)}",
            made["measures"],
        ),
        status=made["status"],
    )


def _solved_by(made: dict[str, Any], options: dict[str, Any]) -> str:
    """The inverse update that solved the equations of the steps, and how often H was formed and kept."""
    if made["method"] != "bdf-bfgs":
        return ""
    n = made["counts"]
    asked = options["method"].rpartition("/")[2]
    if asked == "broyden":
        used = "Broyden's"
    else:
        used = "inverse BFGS, then Broyden's" if "Broyden" in made["why"] else "inverse BFGS"
        if n.get("fallback steps", 0):
            used += f" ({n['fallback steps']} steps by Broyden's after a failure)"
    formed = n.get("inverse formations", 0)
    return (
        f"; update: {used}; H from differences {formed} {'time' if formed == 1 else 'times'}, "
        f"{n.get('updates left out', 0)} of {n.get('iterations', 0)} updates left out"
    )


def _warn_of_start(m: Model, made: dict[str, Any]) -> None:
    for what, plural, unit in (("position", "positions", ""), ("velocity", "velocities", " per second")):
        size = made[f"{what}_correction"]
        if size > _CHANGED:
            warn_user(
                f"the initial {plural} of {m.name!r} contradict its joints; joint coordinates were changed by up to {size:.3g} "
                f"radians or characteristic lengths{unit} to agree"
            )
