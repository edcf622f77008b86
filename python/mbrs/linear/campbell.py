"""Campbell diagram: natural frequencies over the speed of rotation, and critical speeds."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import each, rising
from .._lib.progress import Progress
from ..errors import ModelError
from ..results import Result, Stats, derived, quantity, result
from .critical_speeds import (
    CriticalSpeed,
    CriticalSpeeds,
    Matrices,
    SpeedPencil,
    crossing,
    forward_share,
    orbit_rows,
    turning_rows,
    whirl_of,
)
from .modes import modes
from .steady import SteadyMotion, steady_motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from .._lib.text import Block
    from ..model.aliases import ItemLike
    from ..model.model import Model
    from .critical_speeds import Crossing

# A mode whirls where the area of its orbits is at least this part of that of circles.
_WHIRLS = 0.02
# Two roots of the pencil are one where they differ by less, relative to the speed.
_SAME = 1e-7


@result
class CampbellResult(Result):
    """Modes over speed; columns follow one mode each.

    Attributes
    ----------
    speed
        (n_s,) rad/s.
    frequency
        (n_s, n) damped natural frequency |Im s|/2pi, Hz, in the axes ``frame``.
    damping
        (n_s, n) -Re s/|s|; negative where unstable.
    eigenvalue
        (n_s, n) complex, rad/s.
    whirl
        (n_s, n): +1 forward, -1 backward, 0 neither, of the orbits of all bodies, weighed by their mass.
    critical
        `CriticalSpeeds`: where order x speed is the frequency of a mode, with whirl, r/min, Hz, and whether unbalance excites it.
    frame
        Axes that the frequencies belong to, see `SteadyMotion.frame`: what is seen at f in turning axes an observer sees at
        f +- speed/2pi.
    error
        (n_s, n) estimated relative error of each eigenvalue.
    status
        "converged", or "unresolved" where the modes at a speed are.
    """

    speed: np.ndarray = quantity(dims=("speed",), unit="rad/s")
    frequency: np.ndarray = quantity(dims=("speed", "mode"), unit="Hz", label="damped natural frequency")
    damping: np.ndarray = quantity(dims=("speed", "mode"), unit="1")
    eigenvalue: np.ndarray = quantity(dims=("speed", "mode"), unit="rad/s")
    whirl: np.ndarray = quantity(dims=("speed", "mode"))
    critical: CriticalSpeeds
    joint: str
    frame: str = "fixed"
    unit: str = "rad/s"

    row: ClassVar[str] = "speed"
    error_dims: ClassVar[tuple[str, ...]] = ("speed", "mode")
    largest_error: ClassVar[float] = np.inf  # of rigid modes a frequency: the status is that of the modes at each speed

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "joint": self.joint, "frame": self.frame}

    @property
    @derived(dims=("critical",), unit="rad/s", label="critical speed")
    def critical_speed(self) -> np.ndarray:
        """(n_c,) speeds of ``critical``."""
        return np.array([c.speed for c in self.critical], dtype=float)

    @property
    @derived(dims=("critical",), label="mode at the critical speed")
    def critical_mode(self) -> np.ndarray:
        """(n_c,) columns, from 0."""
        return np.array([c.mode for c in self.critical], dtype=int)

    @property
    @derived(dims=("critical",), unit="1", label="order at the critical speed")
    def critical_order(self) -> np.ndarray:
        """(n_c,) multiples of the speed."""
        return np.array([c.order for c in self.critical], dtype=float)

    @property
    @derived(dims=("critical",), label="whirl at the critical speed")
    def critical_whirl(self) -> np.ndarray:
        """(n_c,) +1 forward, -1 backward, 0 neither."""
        return np.array([c.whirl for c in self.critical], dtype=int)

    @property
    @derived(dims=("critical",), unit="1", label="damping at the critical speed")
    def critical_damping(self) -> np.ndarray:
        """(n_c,) damping ratios."""
        return np.array([c.damping for c in self.critical], dtype=float)

    @property
    @derived(dims=("critical",), unit="1", label="share of unbalance at the critical speed")
    def critical_unbalance(self) -> np.ndarray:
        """(n_c,) `CriticalSpeed.unbalance`; nan where unbalance does not act."""
        return np.array([np.nan if c.unbalance is None else c.unbalance for c in self.critical], dtype=float)

    def heading(self) -> str:
        return f"Campbell diagram of {self.joint!r}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: up to 12 speeds and 8 modes."""
        n = min(8, self.frequency.shape[1])
        pick = np.unique(np.linspace(0, len(self.speed) - 1, min(12, len(self.speed))).astype(int))
        return ["speed rad/s", *(f"mode {j + 1} Hz" for j in range(n))], [
            [float(self.speed[i]), *(f"{self.frequency[i, j]:.5g}{_ARROW[int(self.whirl[i, j])]}" for j in range(n))]
            for i in pick
        ]

    def notes(self) -> list[str]:
        return [f"+ forward whirl, - backward whirl; {self.frame} axes"]

    def blocks(self) -> list[Block]:
        """Frequencies over the speed, then the critical speeds."""
        return [*super().blocks(), self.critical.block()]

    def plot(
        self,
        *,
        orders: tuple[float, ...] = (1.0, 2.0),
        most: int = 16,
        ax: Axes | None = None,
        label: str | None = None,
    ) -> Figure:
        """Frequencies over the speed; returns the figure, see `mbrs.plot.campbell`."""
        from ..plot import campbell as draw

        return draw(self, orders=orders, most=most, ax=ax, label=label)


_ARROW = {1: "+", -1: "-", 0: ""}


def campbell(
    m: Model,
    joint: ItemLike | None = None,
    *,
    speed: ArrayLike | Mapping[Any, ArrayLike],
    n: int | None = None,
    orders: Sequence[float] = (1.0,),
    without: Sequence[str] = (),
) -> CampbellResult:
    """Natural frequencies, damping and whirl of a rotating model over its speed, and its critical speeds.

        det(s^2 M + s (C + G) + K + N) = 0 at every speed W;   critical: s = sigma + i n W

    Parameters
    ----------
    m
        The model.
    joint
        What turns: a joint, body or coordinate, as in `mb.steady_motion`. Of several in ``speed`` the one that the diagram is
        drawn over, the first by default.
    speed
        (n_s,) rad/s, ascending; each steady motion starts from the one before. A dict of several, equally long: the speeds of
        all of them, point by point; numbers stay the same.
    n
        How many modes, the lowest at the first speed; all by default. Rigid modes (the turning itself) are left out.
    orders
        Multiples of the speed whose crossings with the modes are located. Unbalance acts at order 1 in fixed axes, and at order 0,
        which is added, in turning ones.
    without
        Effects to leave out, such as "gyroscopic".

    Returns
    -------
    CampbellResult

    Raises
    ------
    ModelError
        Speeds that are not finite or do not ascend; no steady motion (see `mb.steady_motion`).

    Notes
    -----
    Equations: docs/theory.md (8.6).
    Modes are followed by the correlation of their shapes in the state (y, s y), so that curves may cross. Critical speeds are
    eigenvalues of the pencil S(W) + i n W D(W) - n^2 W^2 M(W), polynomials of second degree in W through three speeds, refined
    by Newton's method on s = sigma + i n W; where the motion deflects with the speed the matrices there are computed afresh (F. C.
    Nelson, Rotor dynamics without equations, Int. J. COMADEM 10 (2007), for the direct method). Cost n_s steady motions and
    eigen-solutions, O(dof^3) for every order.

    Examples
    --------
    >>> import mbrs as mb, numpy as np
    >>> found = mb.campbell(mb.examples.rotor(), "shaft", speed=np.linspace(0, 300, 5))
    >>> [(round(c.speed, 1), c.whirl, c.excited) for c in found.critical]
    [(194.5, -1, False), (226.8, 1, True)]
    """
    start = time.perf_counter()
    run = _Run.of(m, joint, speed, without)
    rows: list[_Row] = []
    with Progress("Campbell diagram", run.speeds.size) as progress:
        for one in run.speeds:
            row = _Row.of(run.motion(float(one)))
            rows.append(row if not rows else row.following(rows[-1]))
            progress.advance()
    # modes that are rigid at one speed (a precession at rest) are kept, those that are so at all speeds are not
    columns = np.flatnonzero(np.any([row.moves for row in rows], axis=0))
    first = np.abs(np.array([rows[0].s[j] for j in columns]))
    columns = columns[np.argsort(first, kind="stable")][:n]
    frame = run.motions[float(run.speeds[-1])].frame
    wanted = sorted({float(o) for o in orders} | ({0.0} if frame == "rotating" else set()))
    critical = [c for order in wanted for c in _critical(run, rows, columns, order, frame)]
    eigenvalue = np.array([row.s[columns] for row in rows])
    size = np.abs(eigenvalue)
    return CampbellResult(
        speed=run.speeds,
        frequency=np.abs(eigenvalue.imag) / (2 * np.pi),
        damping=np.divide(-eigenvalue.real, size, out=np.zeros_like(size), where=size > 0.0),
        eigenvalue=eigenvalue,
        whirl=np.array([row.whirl[columns] for row in rows]),
        critical=CriticalSpeeds(sorted(critical, key=lambda c: (c.speed, c.mode))),
        joint=run.name,
        frame=frame,
        stats=Stats(
            time.perf_counter() - start,
            {"steady motions": len(run.motions), "eigensolutions": len(rows), "critical speeds": len(critical)},
            (),
            "tracked",
        ),
        error=np.array([row.error[columns] for row in rows]),
        status="converged" if all(row.resolved for row in rows) else "unresolved",
    )


class _Run:
    """Steady motions over one speed, kept by that speed."""

    def __init__(self, m: Any, name: str, speeds: np.ndarray, others: Mapping[str, np.ndarray], without: Sequence[str]):
        self.model, self.name, self.speeds, self.others, self.without = m, name, speeds, others, without
        self.motions: dict[float, SteadyMotion] = {}

    @classmethod
    def of(cls, m: Any, joint: Any, speed: Any, without: Sequence[str]) -> _Run:
        if not isinstance(speed, Mapping):
            if joint is None:
                raise ModelError("campbell: name what turns, such as mb.campbell(m, 'shaft', speed=...)")
            return cls(m, str(getattr(joint, "name", joint)), _speeds(speed), {}, without)
        given = {str(getattr(key, "name", key)): value for key, value in speed.items()}
        name = str(getattr(joint, "name", joint)) if joint is not None else next(iter(given), "")
        if name not in given:
            raise ModelError(f"campbell: speed= has no speeds of {name!r}; it has {', '.join(map(repr, given))}")
        main = _speeds(given.pop(name))
        others = {}
        for key, value in given.items():
            others[key] = each(f"campbell: speed= of {key!r}", value, main.size, f"speeds of {name!r}")
        return cls(m, name, main, others, without)

    def motion(self, speed: float) -> SteadyMotion:
        """The steady motion at a speed, from the nearest one that is known; other joints linear between their points."""
        if speed not in self.motions:
            nearest = min(self.motions, key=lambda known: abs(known - speed), default=None)
            at = None if nearest is None else self.motions[nearest]
            every = {self.name: speed}
            every.update({key: float(np.interp(speed, self.speeds, value)) for key, value in self.others.items()})
            self.motions[speed] = steady_motion(self.model, every, at=at, without=self.without)
        return self.motions[speed]

    def matrices(self, speed: float) -> Matrices:
        """M, D and S there."""
        lin = self.motion(speed).linearization
        zero = np.zeros_like(lin.M)
        D = (zero if lin.C is None else lin.C) + (zero if lin.G is None else lin.G)
        return Matrices(lin.M, D, lin.K + (zero if lin.N is None else lin.N))


def _speeds(speed: Any) -> np.ndarray:
    return rising("campbell: speed=", speed, 1, "speeds in rad/s, such as np.linspace(0, 300, 60),")


@dataclass(frozen=True)
class _Row:
    """All modes at one speed: eigenvalues, state shapes (2 dof, n) of unit length, whirl, errors, which are not rigid, and whether
    all of them are resolved."""

    s: np.ndarray
    shape: np.ndarray
    whirl: np.ndarray
    error: np.ndarray
    moves: np.ndarray
    resolved: bool

    @classmethod
    def of(cls, motion: SteadyMotion) -> _Row:
        lin = motion.linearization
        found = modes(lin)
        s, shape = found.eigenvalue, np.asarray(found.shape, dtype=complex)
        state = np.vstack([shape * np.maximum(np.abs(s), 1.0), shape * s])
        state /= np.linalg.norm(state, axis=0)
        whirl, axis = np.zeros(len(s), dtype=int), _axis(lin)
        if axis is not None:
            rows = orbit_rows(lin)
            whirl = np.array([whirl_of(rows, column, axis, _WHIRLS) for column in shape.T], dtype=int)
        resolved = found.status == "converged"
        return cls(s, state, whirl, np.asarray(found.error), found.kind != "rigid", resolved)

    def following(self, before: _Row) -> _Row:
        """The same modes in the order of the row before."""
        from scipy.optimize import linear_sum_assignment

        likeness = np.abs(before.shape.conj().T @ self.shape)
        # closeness of the eigenvalues decides between modes of the same shape
        distance = np.abs(before.s[:, None] - self.s[None, :]) / (
            np.abs(before.s)[:, None] + np.abs(self.s)[None, :] + 1e-300
        )
        _, order = linear_sum_assignment(-likeness + distance)
        s, shape, whirl, error = self.s[order], self.shape[:, order], self.whirl[order], self.error[order]
        return _Row(s, shape, whirl, error, self.moves[order], self.resolved)


def _axis(lin: Any) -> np.ndarray | None:
    omega = lin.poses["angular_velocity"]
    if not np.any(omega):
        return None
    return np.asarray(omega[int(np.argmax(np.linalg.norm(omega, axis=1)))])


def _critical(run: _Run, rows: Sequence[_Row], columns: np.ndarray, order: float, frame: str) -> list[CriticalSpeed]:
    """The crossings of one order in the range of speeds."""
    out: list[tuple[Crossing, CriticalSpeed]] = []
    for pencil, low, high, exact in _pencils(run):
        kept = _kept(run, order)
        starts = pencil.roots(order, kept)
        # damping moves the roots of the pencil off the axis: where they start from is their real part
        near = starts.real[(np.abs(starts.imag) <= 0.5 * np.abs(starts.real)) & (starts.real > 0.0)]
        room = 0.05 * (high - low)
        for begin in np.sort(near[(near >= low - room) & (near <= high + room)]):
            found = crossing(float(begin), order, pencil, None if exact else lambda w: run.matrices(float(w)), kept)
            if found is None or not run.speeds[0] <= found.speed <= run.speeds[-1]:
                continue
            row, column = _column(run, rows, columns, found)
            if column is None:
                continue
            same = [c for c, made in out if abs(c.speed - found.speed) <= _SAME * found.speed and made.mode == column]
            if not same:
                out.append((found, _described(run, found, order, column, frame, row)))
    return [made for _, made in out]


def _pencils(run: _Run) -> list[tuple[SpeedPencil, float, float, bool]]:
    """One pencil where the matrices are polynomials of the speed, else one between every two speeds."""
    speeds = run.speeds
    if len(speeds) < 2:
        return []

    def through(low: float, high: float) -> SpeedPencil:
        at = (low, 0.5 * (low + high), high)
        return SpeedPencil(at, [run.matrices(w) for w in at])

    whole = through(float(speeds[0]), float(speeds[-1]))
    tested = float(speeds[0] + 0.2886751 * (speeds[-1] - speeds[0]))
    if whole.agrees(tested, run.matrices(tested)):
        return [(whole, float(speeds[0]), float(speeds[-1]), True)]
    return [(through(a, b), a, b, False) for a, b in zip(speeds[:-1].tolist(), speeds[1:].tolist(), strict=True)]


def _kept(run: _Run, order: float) -> np.ndarray:
    """Coordinates of the pencil: at order 0 without those that are driven, whose rigid turning would be a root at any speed."""
    motion = next(iter(run.motions.values()))
    names = motion.linearization.coordinates
    driven = set(motion.speed) if order == 0.0 else set()
    return np.array([i for i, name in enumerate(names) if name not in driven], dtype=int)


def _column(run: _Run, rows: Sequence[_Row], columns: np.ndarray, found: Crossing) -> tuple[int, int | None]:
    """The nearest speed and the mode of the diagram there that a crossing belongs to, or None where that is not shown."""
    i = int(np.argmin(np.abs(run.speeds - found.speed)))
    row, s = rows[i], found.s
    state = np.concatenate([found.shape * max(abs(s), 1.0), found.shape * s])
    state /= np.linalg.norm(state)
    likeness = np.abs(row.shape.conj().T @ state)
    distance = np.abs(row.s - s) / (np.abs(row.s) + abs(s) + 1e-300)
    best = int(np.argmin(np.where(row.moves, distance - likeness, np.inf)))
    place = np.flatnonzero(columns == best)
    return i, int(place[0]) if len(place) else None


def _described(run: _Run, found: Crossing, order: float, column: int, frame: str, row: int) -> CriticalSpeed:
    lin = run.motions[float(run.speeds[row])].linearization
    axis = _axis(run.motions[float(run.speeds[-1])].linearization)
    whirl, share = 0, None
    if axis is not None:
        whirl = whirl_of(orbit_rows(lin), found.shape, axis, _WHIRLS)
        if frame == "rotating":
            share = 1.0 if order == 0.0 else None
        elif order == 1.0:
            at = run.motions[float(run.speeds[-1])].linearization
            share = forward_share(turning_rows(at), found.left, axis)
    size = abs(found.s)
    return CriticalSpeed(
        speed=found.speed,
        mode=column,
        order=order,
        whirl=whirl,
        damping=float(-found.s.real / size) if size > 0.0 else 0.0,
        unbalance=share,
        error=found.error,
    )
