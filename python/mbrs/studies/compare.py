"""`mb.compare`: the answer of the plain NumPy reference beside that of the core, for results of small models."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import reference as ref
from .._lib.checks import shown
from .._lib.text import number
from ..errors import ModelError
from ..linear.equilibrium import Equilibrium
from ..linear.frf import FrfResult
from ..linear.linear_system import LinearSystem
from ..linear.linearization import Linearization
from ..linear.modal_result import ModalResult
from ..linear.response import ResponseResult
from ..linear.steady import SteadyMotion
from ..motion.trajectory import Trajectory
from ..nonlinear.periodic import PeriodicSolution
from ..nonlinear.quasi_periodic_curves import QuasiPeriodicResponse
from ..nonlinear.quasi_periodic_solution import QuasiPeriodicSolution
from ..nonlinear.response_curve import FrequencyResponse
from ..reference import hbm_balance
from ..reference.assembly import drawn_and_assembled
from ..reference.motion import with_rates
from ..results import Result, Stats, quantity, result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Comparison", "compare"]

# The reference is dense NumPy whose cost grows with the cube of its size: at this many degrees of freedom a linearisation takes
# about a second. Larger: minutes without a word; smaller: ordinary machines are refused. Pinned by tests/studies/test_compare.py.
MOST_FREEDOMS = 120
# Times between start and end at which a motion is compared, and the tolerance of the reference's integration.
_TIMES = 12
_RTOL = 1e-12
# A difference up to this many times the error that the core states (and the rounding of both) counts as agreement: estimates are
# right to a factor of ten, and both sides round. Smaller calls luck a disagreement; larger hides a lost digit.
_WITHIN = 10.0
_ROUNDING = 1e-10


@dataclass(frozen=True)
class _Row:
    """One quantity: values of both sides as arrays of one shape, and the size that a difference is seen beside."""

    name: str
    unit: str
    core: np.ndarray
    reference: np.ndarray
    scale: float


@result
class Comparison(Result):
    """A result beside the same computed by the NumPy reference, one row for each quantity.

    Attributes
    ----------
    labels, units
        Quantities and their units.
    core, reference
        Their values where the two differ most.
    difference
        The largest difference of a quantity over the size of its largest value.
    stated
        The relative error that the result states of itself.
    agree
        True where the difference is within ten times the stated error and rounding.
    """

    labels: tuple[str, ...]
    units: tuple[str, ...]
    core: np.ndarray = quantity(dims=("quantity",))
    reference: np.ndarray = quantity(dims=("quantity",))
    difference: np.ndarray = quantity(dims=("quantity",), unit="1")
    stated: float = quantity(unit="1")
    agree: np.ndarray = quantity(dims=("quantity",))
    subject: str = ""

    row: ClassVar[str] = "quantity"
    axes: ClassVar[dict[str, str]] = {"quantity": "labels"}

    def heading(self) -> str:
        return f"{self.subject}: the core beside the NumPy reference"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table."""
        rows = [
            [name, unit, number(a, 10), number(b, 10), number(float(d), 2), bool(ok)]
            for name, unit, a, b, d, ok in zip(
                self.labels, self.units, self.core, self.reference, self.difference, self.agree, strict=True
            )
        ]
        return ["quantity", "unit", "core", "reference", "relative difference", "agree"], rows

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """The relative difference of each quantity, logarithmic, with the stated error as a line; returns the figure."""
        from ..plot.studies import comparison

        return comparison(self, ax=ax)

    def __bool__(self) -> bool:
        return bool(np.all(self.agree))


def compare(found: Result) -> Comparison:
    """Compute a result once more by the NumPy reference, which shares no code with the core.

    The reference writes the equations in absolute coordinates of the centres of mass with all joints as constraints, and takes
    minimal coordinates by congruence (docs/theory.md (5.7) to (5.10)). It starts from the numbers of the model and, where a result
    belongs to a state, from the poses of that state.

    Parameters
    ----------
    found
        What `mb.linearize`, `mb.modes`, `mb.frf`, `mb.response`, `mb.equilibrium`, `mb.steady_motion`, `mb.harmonic_balance`,
        `mb.limit_cycle`, `mb.quasi_periodic`, `mb.frequency_response`, `mb.quasi_periodic_response` (ends and middle of a curve) or
        `mb.simulate` returned.

    Returns
    -------
    Comparison
        A table of differences; true where all agree.

    Raises
    ------
    ModelError
        A result of another kind (derivatives are compared with differences by `mb.check_gradients`), a model with more than 120
        degrees of freedom, a moving model with flexible bodies or with laws that slip.

    Notes
    -----
    Cost O(n^3) of dense NumPy, some hundred times that of the core. A motion is integrated by SciPy's DOP853 to 1e-12 up to
    twelve times between start and end.

    Examples
    --------
    >>> import mbrs as mb
    >>> bool(mb.compare(mb.modes(mb.examples.cubic_hexapod())))
    True
    """
    start = time.perf_counter()
    for kind, quantities in _KINDS:
        if isinstance(found, kind):
            rows = quantities(found)
            break
    else:
        known = ", ".join(kind.__name__ for kind, _ in _KINDS)
        raise ModelError(
            f"compare takes one of {known}, got {shown(found)}; derivatives are compared by mb.check_gradients"
        )
    return _comparison(type(found).__name__, rows, _stated(found), time.perf_counter() - start)


def _comparison(subject: str, rows: Sequence[_Row], stated: float, seconds: float) -> Comparison:
    core, other, difference = [], [], []
    for row in rows:
        a, b = np.ravel(row.core), np.ravel(row.reference)
        gap = np.where(np.isnan(a) & np.isnan(b), 0.0, np.abs(a - b))
        gap = np.where(np.isnan(gap), np.inf, gap)
        worst = int(np.argmax(gap)) if gap.size else 0
        core.append(a[worst] if gap.size else 0.0)
        other.append(b[worst] if gap.size else 0.0)
        difference.append(float(gap[worst] / row.scale) if gap.size and gap[worst] > 0.0 else 0.0)
    far = np.array(difference)
    agree = far <= _WITHIN * max(stated, 0.0) + _ROUNDING
    return Comparison(
        labels=tuple(row.name for row in rows),
        units=tuple(row.unit for row in rows),
        core=np.array(core),
        reference=np.array(other),
        difference=far,
        stated=stated,
        agree=agree,
        subject=subject,
        error=float(far.max(initial=0.0)),
        status="converged" if np.all(agree) else "different",
        stats=Stats(seconds, {"quantities": len(rows)}, (), "NumPy reference"),
    )


def _stated(found: Any) -> float:
    error = np.asarray(found.error, dtype=float) if found.error is not None else np.zeros(0)
    finite = error[np.isfinite(error)]
    return float(finite.max(initial=0.0))


def _row(name: str, unit: str, core: Any, other: Any, scale: float | None = None) -> _Row:
    a, b = np.asarray(core), np.asarray(other)
    if a.shape != b.shape:
        raise ModelError(
            f"the reference has {name} of shape {b.shape}, the core of shape {a.shape}: they see different systems"
        )
    sizes = np.abs(np.concatenate([a.ravel(), b.ravel()]))
    largest = float(sizes[np.isfinite(sizes)].max(initial=0.0))
    return _Row(name, unit, a, b, max(largest, scale or 0.0) or 1.0)


def _check_size(freedoms: int) -> None:
    if freedoms > MOST_FREEDOMS:
        raise ModelError(
            f"the model has {freedoms} degrees of freedom; the reference is dense NumPy for at most {MOST_FREEDOMS}: compare a smaller "
            "model of the same kind"
        )


def _system(tables: Any, freedoms: int) -> Any:
    _check_size(freedoms)
    return ref.System(tables.get("raw", tables))


def _state_at(sys: Any, poses: Any) -> Any:
    """The reference's state, which is that of the centres of mass, at the poses and velocities of the bodies' origins."""
    arm = np.einsum("nij,nj->ni", poses["rotation"], np.array([b.com for b in sys.bodies]).reshape(-1, 3))
    spin = poses["angular_velocity"]
    return ref.State(poses["position"] + arm, poses["rotation"], poses["velocity"] + np.cross(spin, arm), spin)


def _state(sys: Any, lin: Linearization) -> Any:
    """The reference's state at the poses of a linearisation; flexible models are assembled or brought to rest anew."""
    if sys.flexible:
        if lin.state.moving or lin.state.kind not in ("drawn", "equilibrium"):
            raise ModelError("a model with flexible bodies is compared in its drawn state and at its equilibrium only")
        if lin.state.kind == "equilibrium":
            return ref.equilibrium(sys, without=lin.without)[0]
        return drawn_and_assembled(sys)
    return _state_at(sys, lin.poses)


def _again(lin: Linearization) -> Any:
    """The reference's linearisation at the same state, in the same coordinates."""
    sys = _system(lin.snapshot.tables, lin.n)
    independent = [sys.coordinates.index(name) for name in lin.coordinates]
    return ref.linearize(sys, _state(sys, lin), independent, lin.without)


def _linearization(lin: Linearization) -> list[_Row]:
    other = _again(lin)
    whole = {"C": lin.C, "G": lin.G, "N": lin.N}
    rows = [_row("M", "kg, kg m, kg m2", lin.M, other.M), _row("K", "N/m, N, N m", lin.K, other.K)]
    for name, beside in (("C", other.C), ("G", other.G), ("N", other.N)):
        matrix = np.zeros_like(lin.M) if whole[name] is None else whole[name]
        # beside K and M, whose size says what is nothing for a matrix that vanishes
        size = float(np.abs(other.K).max(initial=0.0)) if name == "N" else float(np.abs(other.M).max(initial=0.0))
        rows.append(_row(name, "N s/m, N s, N m s" if name != "N" else "N/m, N, N m", matrix, beside, size))
    return rows


def _matrices(system: Any) -> tuple[Any, Any, Any, Any, Any]:
    if isinstance(system, Linearization):
        other = _again(system)
        return other.M, other.C, other.G, other.K, other.N
    _check_size(system.n)
    dense = [None if m is None else (m.toarray() if hasattr(m, "toarray") else np.asarray(m))
             for m in (system.M, system.C, system.G, system.K, system.N)]  # fmt: skip
    return dense[0], dense[1], dense[2], dense[3], dense[4]


def _modes(modes: ModalResult) -> list[_Row]:
    other = ref.modes(*_matrices(modes.system))
    n = modes.n
    size = float(np.abs(other.eigenvalue).max(initial=0.0))
    rows = [
        _row("natural frequency", "Hz", modes.frequency, other.frequency[:n]),
        _row("real part of the eigenvalue", "rad/s", modes.eigenvalue.real, other.eigenvalue[:n].real, size),
        _row("imaginary part of the eigenvalue", "rad/s", modes.eigenvalue.imag, other.eigenvalue[:n].imag, size),
    ]
    alone = [
        i for i in range(n) if not any(i in g for g in (*modes.groups, modes.cut_group)) and modes.kind[i] != "rigid"
    ]
    agreement = [_alike(modes.shape[:, i], other.shape[:, i]) for i in alone]
    return [*rows, _row("agreement of shapes (MAC)", "1", np.ones(len(alone)), np.array(agreement))]


def _alike(a: np.ndarray, b: np.ndarray) -> float:
    return float(abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real))


def _of_forces(result: FrfResult | ResponseResult) -> tuple[Any, Any, Any, LinearSystem]:
    """The reference's M, C + G and K + N of a linear system that forces alone excite."""
    linear = result.linear
    if linear is None or linear.shared or linear.D0 is not None or np.any(linear.order_in) or linear.states is not None:
        raise ModelError(
            "responses to forces alone, of laws without states of their own, are compared: base motion enters the reference in no "
            "other way"
        )
    M, C, G, K, N = (np.zeros((linear.n, linear.n)) if X is None else X for X in _matrices(linear.source))
    return M, G if "damping" not in linear.effects else C + G, K + N, linear


def _transfer(h: FrfResult) -> list[_Row]:
    M, D, S, linear = _of_forces(h)
    value = ref.frf(M, D, S, linear.F, linear.L, h.omega, h.kind)
    rows = []
    for o, out in enumerate(h.outputs):
        for i, name in enumerate(h.inputs):
            core, other = h.value[o, i], value[o, i]
            usable = np.isfinite(core)
            rows.append(_row(f"{h.kind} {name} to {out}", "", core[usable], other[usable]))
    return rows


def _response(found: ResponseResult) -> list[_Row]:
    M, D, S, linear = _of_forces(found)
    assert found.history is not None and found.start is not None
    y, rate = ref.response(M, D, S, linear.F, found.t, found.history.u, *found.start)
    pairs = (("displacement", found.displacement, y), ("velocity", found.velocity, rate))
    return [
        _row(f"{kind} of {out}", "", core[o], other @ linear.L[o])
        for kind, core, other in pairs
        for o, out in enumerate(found.outputs)
    ]


def _steady(found: SteadyMotion) -> list[_Row]:
    sys = _system(found.linearization.snapshot.tables, found.linearization.n)
    lin, torque = ref.steady_motion(sys, found.speed, without=found.linearization.without)
    names = [name for name in sys.coordinates if name in found.speed]
    # a torque that vanishes is nothing beside the stiffness over a radian
    size = float(np.abs(lin.S).max(initial=0.0))
    core = np.array([found.torque[name] for name in names])
    return [_row("torque or force of the drives", "N m, N", core, torque, size)] + _places(sys, lin.state, found.poses)


def _places(sys: Any, state: Any, poses: Any) -> list[_Row]:
    """Positions of the bodies' origins, and rotations."""
    n = len(poses["position"])
    arm = np.einsum("nij,nj->ni", state.R[:n].real, np.array([b.com for b in sys.bodies[:n]]).reshape(-1, 3))
    return [
        _row("position", "m", poses["position"], state.r[:n].real - arm, sys.length),
        _row("rotation matrix", "1", poses["rotation"], state.R[:n].real),
    ]


def _equilibrium(found: Equilibrium) -> list[_Row]:
    lin = found.linearization
    sys = _system(lin.snapshot.tables, lin.n)
    start = _state(sys, lin) if not sys.flexible else None
    state, lam, _ = ref.equilibrium(sys, start, without=lin.without)
    rows = _places(sys, state, lin.poses)
    wrenches = ref.reactions(sys, state, lam)
    names = [name for name, wrench in found.reactions.items() if name in wrenches and np.size(wrench) == 6]
    if names:
        core, other = (np.array([np.asarray(side[name]) for name in names]) for side in (found.reactions, wrenches))
        force = float(np.abs(other[:, :3]).max(initial=0.0))
        rows.append(_row("reaction force", "N", core[:, :3], other[:, :3]))
        # a moment that vanishes is nothing beside the forces at the length of the model
        rows.append(_row("reaction moment", "N m", core[:, 3:], other[:, 3:], force * sys.length))
    return rows


def _periodic(found: PeriodicSolution) -> list[_Row]:
    if found.system is None or found.force is None or not hasattr(found.system, "elements"):
        raise ModelError("this solution does not hold its matrices and force; compare a result of mb.harmonic_balance")
    _check_size(found.system.n)
    harmonics = [h for h in found.harmonics if h > 0]
    columns = [0, *(i for h in harmonics for i in (2 * h - 1, 2 * h))]
    given = found.X[:, columns]
    terms = found.force.items() if isinstance(found.force, Mapping) else [(1, found.force)]
    if not any(np.any(np.asarray(f)) for h, f in terms if h > 0):
        X, omega = hbm_balance.limit_cycle(found.system, found.force, found.omega, harmonics, found.n_samples, given)
        return [
            _row("Fourier coefficients", "m, rad", given, X),
            _row("frequency of the cycle", "rad/s", found.omega, omega),
        ]
    X = hbm_balance.harmonic_balance(
        found.system, found.force, found.omega, harmonics, found.n_samples, given, found.subharmonic
    )
    return [_row("Fourier coefficients", "m, rad", given, X)]


def _torus(found: QuasiPeriodicSolution) -> list[_Row]:
    system = found.system
    if system is None or not all("force" in source for source in found.forces):
        raise ModelError("a quasi-periodic solution of a MechanicalSystem is compared; this one is of a model's ports")
    _check_size(system.n)
    indices = np.asarray(found.indices)
    terms = np.zeros((len(indices) + 1, system.n), complex)
    terms[0] = 0.0 if found.static is None else found.static
    for i, source in enumerate(found.forces):
        place = np.flatnonzero(np.all(indices == np.eye(len(found.omega), dtype=int)[i], axis=1))
        terms[1 + place[0]] = source["force"]
    n_samples = found.n_samples or 4 * np.abs(indices).max(axis=0) + 2
    X = hbm_balance.quasi_periodic(system, terms, found.omega, indices, n_samples, found.X)
    return [_row("Fourier coefficients", "m, rad", found.X, X)]


def _ends_and_middle(curve: FrequencyResponse | QuasiPeriodicResponse) -> list[_Row]:
    one = _periodic if isinstance(curve, FrequencyResponse) else _torus
    chosen = sorted({0, len(curve) // 2, len(curve) - 1})
    return [
        replace(row, name=f"{row.name}, point {i}")
        for i in chosen
        for row in one(curve.point(i))  # type: ignore[arg-type]
    ]


def _motion(traj: Trajectory) -> list[_Row]:
    sys = _system(traj.snapshot.tables, traj.rate.shape[1])
    if sys.flexible:
        raise ModelError("motions of flexible bodies are not compared: mb.compare(mb.modes(m)) checks their matrices")
    for link in (*sys.elements, *sys.joints):
        if any(law.n_memory for law in link.laws):
            raise ModelError(
                f"{link.name!r} has a law that slips; SciPy steps over its changes, so that its motion is not compared: mb.compare of "
                "mb.harmonic_balance checks the law"
            )
    start = traj.state(float(traj.t[0]))
    state = _state_at(sys, traj.snapshot.system.bodies(start.q, start.rate))
    chosen = np.unique(np.linspace(0, len(traj.t) - 1, _TIMES + 1).astype(int))
    history = ref.simulate(sys, state, traj.t[chosen][1:] - traj.t[0], rtol=_RTOL)
    ends = [with_rates(sys, instant.motion.state, instant.motion.rate) for instant in history.instants]
    arms = np.array([b.com for b in sys.bodies]).reshape(-1, 3)
    place = np.array([s.r - np.einsum("nij,nj->ni", s.R, arms) for s in ends])
    core = np.array([traj.position(name)[chosen] for name in traj.bodies]).swapaxes(0, 1)
    turned = np.array([traj.rotation(name)[chosen] for name in traj.bodies]).swapaxes(0, 1)
    rotation = np.array([s.R for s in ends])
    return [_row("position", "m", core, place, sys.length), _row("rotation matrix", "1", turned, rotation)]


_KINDS: list[tuple[type, Callable[[Any], list[_Row]]]] = [
    (Linearization, _linearization),
    (ModalResult, _modes),
    (FrfResult, _transfer),
    (ResponseResult, _response),
    (Equilibrium, _equilibrium),
    (SteadyMotion, _steady),
    (PeriodicSolution, _periodic),
    (QuasiPeriodicSolution, _torus),
    (FrequencyResponse, _ends_and_middle),
    (QuasiPeriodicResponse, _ends_and_middle),
    (Trajectory, _motion),
]
