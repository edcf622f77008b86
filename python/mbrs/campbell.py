"""Campbell diagram: natural frequencies over the speed of rotation, tracked from speed to speed."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .errors import ModelError
from .modal import modes
from .progress import Progress
from .results import Result, Stats, quantity, result
from .steady import steady_motion

if TYPE_CHECKING:
    from .model import Model

# A mode whirls where the area of its orbit is at least this part of that of a circle.
_WHIRLS = 0.02
_ACROSS = 1e-8


@result
class CampbellResult(Result):
    """Modes over speed; columns follow one mode each.

    Attributes
    ----------
    speed
        (n_s,) rad/s.
    frequency
        (n_s, n) damped natural frequency |Im s|/2pi, Hz.
    damping
        (n_s, n) -Re s/|s|; negative where unstable.
    eigenvalue
        (n_s, n) complex, rad/s.
    whirl
        (n_s, n): +1 forward, -1 backward, 0 neither, from the orbit of the body that moves most.
    critical
        Rows (speed in rad/s, mode, order): where order x speed excites mode, located on the modes themselves.
    error
        (n_s, n) estimated relative error of each eigenvalue.
    """

    speed: np.ndarray = quantity(dims=("speed",), unit="rad/s")
    frequency: np.ndarray = quantity(dims=("speed", "mode"), unit="Hz", label="damped natural frequency")
    damping: np.ndarray = quantity(dims=("speed", "mode"), unit="1")
    eigenvalue: np.ndarray = quantity(dims=("speed", "mode"), unit="rad/s")
    whirl: np.ndarray = quantity(dims=("speed", "mode"))
    critical: tuple[tuple[float, int, float], ...]
    joint: str
    unit: str = "rad/s"

    row: ClassVar[str] = "speed"
    error_dims: ClassVar[tuple[str, ...]] = ("speed", "mode")

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "joint": self.joint}

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
        found = [
            f"critical speed {s:.6g} rad/s: {order:g}x excites mode {mode + 1}" for s, mode, order in self.critical
        ]
        return ["+ forward whirl, - backward whirl", *found]

    def plot(self, *, ax: Any = None, **options: Any) -> Any:
        """Frequencies over the speed; returns the figure, see `mbrs.plot.campbell`."""
        from .plot import campbell as draw

        return draw(self, ax=ax, **options)


_ARROW = {1: "+", -1: "-", 0: ""}


def campbell(
    m: Model,
    joint: Any,
    *,
    speed: Any,
    n: int | None = None,
    orders: Sequence[float] = (1.0,),
    without: Sequence[str] = (),
) -> CampbellResult:
    """Natural frequencies, damping and whirl of a rotating model over its speed.

    Parameters
    ----------
    m
        The model.
    joint
        What turns: a joint, body or coordinate, as in `mb.steady_motion`.
    speed
        (n_s,) rad/s, ascending; each steady motion starts from the one before.
    n
        How many modes, the lowest at the first speed; all by default. Rigid modes (the turning itself) are left out.
    orders
        Multiples of the speed whose crossings with the modes are located.
    without
        Effects to leave out, such as "gyroscopic".

    Returns
    -------
    CampbellResult

    Raises
    ------
    ModelError
        Speeds that are not finite or do not ascend.

    Notes
    -----
    Modes are followed by the correlation of their shapes in the state (y, s y), so that curves may cross. Critical
    speeds are the
    crossings order x speed = |Im s|, refined by bisection on new steady motions. Cost n_s eigen-solutions.

    Examples
    --------
    >>> import mbrs as mb, numpy as np
    >>> mb.campbell(mb.examples.rotor(), "shaft", speed=np.linspace(0, 100, 5)).frequency.shape[0]
    5
    """
    start = time.perf_counter()
    speeds = np.asarray(speed, dtype=float)
    if speeds.ndim != 1 or speeds.size == 0 or not np.all(np.isfinite(speeds)) or np.any(np.diff(speeds) <= 0.0):
        raise ModelError("speed= must be ascending finite speeds in rad/s, such as np.linspace(0, 300, 60)")
    name = str(getattr(joint, "name", joint))
    rows: list[_Row] = []
    state = None
    with Progress("Campbell diagram", speeds.size) as progress:
        for one in speeds:
            state, row = _at(m, name, float(one), state, without)
            rows.append(row if not rows else row.following(rows[-1]))
            progress.advance()
    keep = slice(None, n)
    critical = [c for order in orders for c in _crossings(m, name, speeds, rows, order, keep, without)]
    eigenvalue = np.array([row.s for row in rows])[:, keep]
    size = np.abs(eigenvalue)
    return CampbellResult(
        speed=speeds,
        frequency=np.abs(eigenvalue.imag) / (2 * np.pi),
        damping=np.divide(-eigenvalue.real, size, out=np.zeros_like(size), where=size > 0.0),
        eigenvalue=eigenvalue,
        whirl=np.array([row.whirl for row in rows])[:, keep],
        critical=tuple(sorted(critical)),
        joint=name,
        stats=Stats(
            time.perf_counter() - start,
            {"eigensolutions": len(speeds), "critical speeds": len(critical)},
            (),
            "tracked",
        ),
        error=np.array([row.error for row in rows])[:, keep],
    )


@dataclass(frozen=True)
class _Row:
    """The vibrating modes at one speed: eigenvalues, state shapes (2 dof, n) of unit length, whirl, errors."""

    s: np.ndarray
    shape: np.ndarray
    whirl: np.ndarray
    error: np.ndarray

    def following(self, before: _Row) -> _Row:
        """The same modes in the order of the row before."""
        from scipy.optimize import linear_sum_assignment

        likeness = np.abs(before.shape.conj().T @ self.shape)
        # closeness of the eigenvalues decides between modes of the same shape
        distance = np.abs(before.s[:, None] - self.s[None, :]) / (
            np.abs(before.s)[:, None] + np.abs(self.s)[None, :] + 1e-300
        )
        _, order = linear_sum_assignment(-likeness + distance)
        return _Row(self.s[order], self.shape[:, order], self.whirl[order], self.error[order])


def _at(m: Any, name: str, speed: float, start: Any, without: Sequence[str]) -> tuple[Any, _Row]:
    motion = steady_motion(m, {name: speed}, at=start, without=without)
    found = modes(motion.linearization)
    use = found.kind != "rigid"
    s, shape = found.eigenvalue[use], np.asarray(found.shape, dtype=complex)[:, use]
    state = np.vstack([shape * np.maximum(np.abs(s), 1.0), shape * s])
    state /= np.linalg.norm(state, axis=0)
    return motion, _Row(s, state, _whirl(motion, shape, name), np.asarray(found.error)[use])


def _whirl(motion: Any, shape: np.ndarray, name: str) -> np.ndarray:
    """Sense of the orbit about the axis of rotation: sign of the area swept by the origin or the tilt of the body
    that moves most.
    """
    lin = motion.linearization
    omega = lin.poses["angular_velocity"]
    if not np.any(omega):
        return np.zeros(shape.shape[1], dtype=int)
    axis = omega[int(np.argmax(np.linalg.norm(omega, axis=1)))]
    axis = axis / np.linalg.norm(axis)
    out = np.zeros(shape.shape[1], dtype=int)
    for j in range(shape.shape[1]):
        twist = (lin.T @ shape[:, j]).reshape(-1, 2, 3)
        best = max(twist.reshape(-1, 3), key=lambda v: float(np.linalg.norm(v - axis * (axis @ v))))
        across = best - axis * (axis @ best)
        size = float(np.linalg.norm(across)) ** 2
        # torsion and axial motion leave only rounding across the axis
        if size < _ACROSS * float(np.linalg.norm(twist)) ** 2:
            continue
        area = float(axis @ np.cross(across.real, -across.imag))
        if size > 0.0 and abs(area) > _WHIRLS * size / 2:
            out[j] = 1 if area > 0 else -1
    return out


def _crossings(
    m: Any, name: str, speeds: np.ndarray, rows: Sequence[_Row], order: float, keep: slice, without: Sequence[str]
) -> list[tuple[float, int, float]]:
    found = []
    for mode in range(len(rows[0].s))[keep]:
        gap = np.array([abs(row.s[mode].imag) - order * speed for row, speed in zip(rows, speeds, strict=True)])
        for i in np.flatnonzero(gap[:-1] * gap[1:] < 0.0).tolist():
            found.append(
                (_locate(_gap_at(m, name, rows[i], mode, order, without), speeds[i], speeds[i + 1]), mode, order)
            )
    return found


def _gap_at(m: Any, name: str, near: _Row, mode: int, order: float, without: Sequence[str]) -> Callable[[float], float]:
    def gap(speed: float) -> float:
        _, row = _at(m, name, speed, None, without)
        return float(abs(row.following(near).s[mode].imag) - order * speed)

    return gap


def _locate(gap: Callable[[float], float], low: float, high: float) -> float:
    from scipy.optimize import brentq

    try:
        return float(brentq(gap, low, high, xtol=1e-12 * max(1.0, high), rtol=1e-12))
    except ValueError:
        # the mode found inside the interval is another one: its ends are all that is known
        return 0.5 * (low + high)
