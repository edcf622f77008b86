"""A curve of periodic solutions: points, stability and events of a branch, as a table, a figure, labelled data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.text import Block, table
from ..errors import ModelError
from ..results import Result, derived, quantity, result
from . import balance
from .branch_points import MEANING, Event, checked_event
from .displacement import displacement_coefficients, label, weigh, weights
from .options import point_number, points
from .periodic import PeriodicSolution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .displacement import Displacement


@dataclass(frozen=True, eq=False)
class Part:
    """Points that share a set of harmonics: the core's unknowns ``y`` (n, size) and where they hold."""

    setup: balance.Setup
    omega: np.ndarray
    level: np.ndarray
    y: np.ndarray
    value: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.omega)

    def expanded(self, i: int) -> np.ndarray:
        """(dof, 2H+1) of one point."""
        value = None if self.value is None else float(self.value[i])
        return self.setup.expand(self.y[i], float(self.omega[i]), float(self.level[i]), value)


@result
class FrequencyResponse(Result):
    """A branch of periodic solutions, point by point along the curve.

    Attributes
    ----------
    omega, level
        (n,) excitation frequency in rad/s and factor on the forces.
    stable
        (n,) bool; None where stability was not asked for; numbers with nan where it cannot be told (laws with memory, contacts
        within the error of the motion, exponents whose sign the harmonics that were left out decide). Where the estimated error
        of the motion may turn an exponent, a motion with twice as many harmonics tells (``.stats.counts["refinements"]``).
    exponents
        (n, 2 dof) Floquet exponents in 1/s, or None; of large systems those of a reduced model, filled up with nan.
    events
        Folds, branch points, Neimark-Sacker and period-doubling points, solved for.
    error
        (n,) estimate from the omitted harmonics relative to the largest coefficient.
    status
        "converged": the end of the range was reached; "max-points", "left-at-start" (the branch came back), "stopped" (the
        step became too small; ``reason`` says why), "unresolved" (the end was reached, but an error exceeds the tolerance, or the
        harmonics that were left out decide about a stability or an event; ``reason`` says which).
    over
        "frequency" (Hz) or "omega" (rad/s): what the range was given in, and figures show.
    """

    omega: np.ndarray = quantity(dims=("point",), unit="rad/s")
    level: np.ndarray = quantity(dims=("point",), unit="1")
    stable: np.ndarray | None = quantity(dims=("point",))
    exponents: np.ndarray | None
    events: tuple[Event, ...]
    parts: tuple[Part, ...] = field(repr=False)
    system: Any = field(default=None, repr=False)
    force: Any = field(default=None, repr=False)
    branch: Any = field(default=None, repr=False)
    reason: str = ""
    over: str = "frequency"

    row: ClassVar[str] = "point"
    axes: ClassVar[Mapping[str, str]] = {"coordinate": "coordinates", "coefficient": "coefficient_names"}
    error_dims: ClassVar[tuple[str, ...]] = ("point",)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(str(name) for name in getattr(self.system, "coordinates", range(self.X.shape[1])))

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """a0, a1, b1, a2, ..."""
        return ("a0", *(f"{part}{h}" for h in range(1, self.X.shape[2] // 2 + 1) for part in "ab"))

    def labelled(self) -> dict[str, tuple[tuple[str, ...], Any, str, str]]:
        events = {
            "event_kind": (np.array([e.kind for e in self.events], dtype=str), ""),
            "event_omega": (np.array([e.omega for e in self.events], dtype=float), "rad/s"),
            "event_level": (np.array([e.level for e in self.events], dtype=float), "1"),
            "event_status": (np.array([e.status for e in self.events], dtype=str), ""),
        }
        named = {name: (("event",), value, unit, name.replace("_", " ")) for name, (value, unit) in events.items()}
        return {**super().labelled(), **named}

    def attributes(self) -> dict[str, Any]:
        return {**super().attributes(), "meaning": MEANING.get(self.status.split(":")[0], "")}

    def blocks(self) -> list[Block]:
        return [Block(*self.rows(), title=self.heading(), footer="amplitudes of the first harmonic", digits=7)]

    @property
    @derived(dims=("point",), unit="Hz")
    def frequency(self) -> np.ndarray:
        """Excitation frequency, Hz."""
        return self.omega / (2 * np.pi)

    def __len__(self) -> int:
        return len(self.omega)

    @property
    @derived(dims=("point", "coordinate", "coefficient"))
    def X(self) -> np.ndarray:
        """(n, dof, 2H+1) coefficients [a0, a1, b1, ...], zero-padded to the largest H; built at the first use."""
        if "X" not in self._cache:
            top = max(part.setup.harmonics[-1] for part in self.parts)
            out = np.zeros((len(self), self.system.n, 2 * top + 1))
            for at in range(len(self)):
                part, i = self._part_of(at)
                X = part.expanded(i)
                out[at, :, : X.shape[1]] = X
            self._cache["X"] = out
        return self._cache["X"]

    @property
    def varies(self) -> str:
        """Quantity that varies along the curve: "frequency" or "level"."""
        return "level" if len(self) > 1 and np.ptp(self.omega) == 0 else "frequency"

    def axis(self) -> tuple[np.ndarray, str]:
        """Abscissa of the curve, (n,), and its name."""
        if self.varies == "level":
            return self.level, "force level"
        return (self.omega, "omega [rad/s]") if self.over == "omega" else (self.frequency, "f [Hz]")

    def place(self, event: Event) -> float:
        """Abscissa of an event."""
        checked_event(event)
        if self.varies == "level":
            return event.level
        return event.omega if self.over == "omega" else event.frequency

    @property
    def connected(self) -> bool:
        """True if the points follow each other on one branch; a list of frequencies only gives single solutions."""
        return self.stats.counts.get("single solutions", 0) == 0

    @property
    @derived(dims=("point", "exponent"), unit="1", name="multiplier")
    def multipliers(self) -> np.ndarray | None:
        """(n, 2 dof) Floquet multipliers exp(s T) over one period of the motion, or None."""
        if self.exponents is None:
            return None
        order = self.parts[0].setup.subharmonic if self.parts else self._cache.get("subharmonic", 1)
        period = 2 * np.pi * order / self.omega
        return np.exp(self.exponents * period[:, None])

    def label(self, dof: Displacement = 0) -> str:
        """Name of a displacement."""
        return label(self.system, dof, self.system.n)

    def _rows_of(self, dof: Any) -> np.ndarray:
        """(n, 2H+1) of one displacement, without the memory that all of ``X`` would take."""
        key = f"row {dof!r}"
        if key not in self._cache:
            if "X" in self._cache:
                self._cache[key] = displacement_coefficients(self.X, self.system, dof)
            else:
                top = max(part.setup.harmonics[-1] for part in self.parts)
                out, at = np.zeros((len(self), 2 * top + 1)), 0
                row = weights(self.system, dof, self.system.n)
                for part in self.parts:
                    for i in range(len(part)):
                        x = weigh(part.expanded(i), row)
                        out[at, : len(x)] = x
                        at += 1
                self._cache[key] = out
        return self._cache[key]

    def coefficient(self, dof: Displacement = 0, harmonic: int = 1) -> np.ndarray:
        """(n,) complex amplitudes a - i b of one harmonic of one displacement.

        ``dof``: number or name of a coordinate, or, of a model, a motion such as ``body.motion("z")``.
        """
        x = self._rows_of(dof)
        if balance.whole("harmonic", harmonic) == 0:
            return x[:, 0].astype(complex)
        if harmonic > (x.shape[1] - 1) // 2:
            return np.zeros(len(self), complex)
        return x[:, 2 * harmonic - 1] - 1j * x[:, 2 * harmonic]

    def amplitude(self, dof: Displacement = 0, harmonic: int | None = 1, n_t: int = 256) -> np.ndarray:
        """(n,) magnitude of one harmonic of one displacement; ``harmonic=None``: largest |x| over ``n_t`` instants of
        a period."""
        if harmonic is not None:
            return np.abs(self.coefficient(dof, harmonic))
        return _largest(self._rows_of(dof), n_t)

    def event_amplitude(self, event: Event, dof: Displacement = 0, harmonic: int | None = 1) -> float:
        """The same of the motion at an event."""
        x = displacement_coefficients(checked_event(event).X, self.system, dof)
        if harmonic is None:
            return float(_largest(x[None, :], 256)[0])
        if 2 * balance.whole("harmonic", harmonic) >= len(x):
            return 0.0
        return float(abs(x[0]) if harmonic == 0 else np.hypot(x[2 * harmonic - 1], x[2 * harmonic]))

    def point(self, i: int) -> PeriodicSolution:
        """The solution number ``i`` by itself."""
        i = point_number(i, len(self))
        part, k = self._part_of(i)
        return self._solution(
            part.setup, float(self.omega[i]), float(self.level[i]), part.expanded(k), float(self.error[i])
        )

    def at(self, event: Event) -> PeriodicSolution:
        """The motion at an event, as a solution by itself."""
        if event not in self.events:
            raise ModelError(f"{event} is not an event of this curve")
        setup = self._part_of(min(event.index, len(self) - 1))[0].setup
        error = setup.estimate(setup.start(event), event.omega, event.level, event.value)
        one = self._solution(setup, event.omega, event.level, event.X, error)
        return one if event.status == "converged" else one.replaced(status=event.status)

    def peak(self, dof: Displacement = 0, harmonic: int | None = 1) -> PeriodicSolution:
        """The solution where the amplitude of one harmonic, or with None the largest displacement, is largest: solved for
        (d amplitude / d arclength = 0) from the largest point of the curve, along its tangent, so also where that is a fold.
        ``dof`` as for `amplitude`: a coordinate, condensed or not, or a motion of the model. Only for curves over frequency."""
        i = int(np.argmax(self.amplitude(dof, harmonic)))
        part, k = self._part_of(i)
        setup = part.setup
        if np.ptp(self.omega) == 0:
            raise ModelError("peak() needs a curve over frequency; this one runs over the force level")
        level = float(part.level[k])
        row = weights(self.system, dof, self.system.n)
        if isinstance(row, int):
            row = np.eye(1, self.system.n, row)[0]
        omega, y = setup.peak(part.y[k], float(self.omega[i]), level, row, harmonic, self._tangent(i))
        X = setup.expand(y, omega, level)
        return self._solution(setup, omega, float(self.level[i]), X, setup.estimate(y, omega, level))

    def _tangent(self, i: int) -> np.ndarray | None:
        """[dy, domega] from the point before to the point behind, in the unknowns of the point i; None where there is no branch."""
        near = [k for k in (i - 1, i + 1) if 0 <= k < len(self)]
        if not self.connected or not near:
            return None
        size = self._part_of(i)[0].y.shape[1]

        def place(at: int) -> np.ndarray:
            other, own = self._part_of(at)
            z = np.zeros(size + 1)
            n = min(size, other.y.shape[1])  # sets of harmonics only grow, and keep their order
            z[:n], z[-1] = other.y[own][:n], other.omega[own]
            return z

        ends = (
            (place(near[0]), place(near[-1])) if len(near) == 2 else sorted_ends(place(i), place(near[0]), near[0] > i)
        )
        step = ends[1] - ends[0]
        return step if np.any(step) else None

    def _solution(self, setup: Any, omega: float, level: float, X: np.ndarray, error: float) -> PeriodicSolution:
        force = balance.scaled_force(self.force, level)
        return PeriodicSolution(
            X,
            omega,
            setup.harmonics,
            setup.subharmonic,
            setup.n_samples,
            self.system,
            force,
            error=error,
            stats=self.stats,
            status="converged" if error <= setup.fourier.limit() else "unresolved",
        )

    def _part_of(self, i: int) -> tuple[Part, int]:
        i = range(len(self))[i]
        for part in self.parts:
            if i < len(part):
                return part, i
            i -= len(part)
        raise IndexError(i)

    def resume(self, max_points: int = 1000) -> FrequencyResponse:
        """The same branch with up to ``max_points`` more points; also of a curve that was saved (not as ``.nc``) and loaded,
        from its last point on."""
        if self.branch is None:
            raise ModelError("this curve has no branch to go on with: a set of frequencies has none; give a range")
        started = perf_counter()
        self.branch.follow(len(self.branch.chunks) + points(max_points), None)
        made: FrequencyResponse = self.branch.curve(perf_counter() - started + self.stats.wall_time)
        return made

    def plot(
        self,
        dof: Displacement = 0,
        harmonic: int | None = 1,
        ax: Axes | None = None,
        label: str | None = None,
        over: str = "",
    ) -> Figure:
        """Amplitude over frequency (or level), unstable parts dashed, events marked; returns the matplotlib figure.

        ``ax``, ``label``: axes to draw into, for several curves in one picture, and a name of this one. ``over``: "frequency"
        (Hz) or "omega" (rad/s).
        """
        from ..plot.nonlinear import curve

        return curve(self, dof, harmonic, ax=ax, label=label, over=over)

    def plot_multipliers(self) -> Figure:
        """Floquet multipliers in the complex plane, and the largest along the curve; returns the figure."""
        from ..plot.nonlinear import multipliers

        return multipliers(self)

    def table(self, *dofs: Displacement) -> str:
        """The table of ``print(curve)`` for other displacements, such as ``curve.table(body.motion("z"))``."""
        return table(*self.rows(dofs), title=self.heading(), footer="amplitudes of the first harmonic", digits=7)

    def rows(self, dofs: Sequence[Displacement] = ()) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table: ends, largest amplitudes and events, in the order of the curve.

        ``dofs``: displacements to show; by default the three of those that are driven or touched by nonlinear elements that move
        most, or of all coordinates.
        """
        shown = list(dofs) or self._main_coordinates()
        picks: list[tuple[float, str, Any]] = [(0, "first", None), (len(self) - 1, "last", None)]
        for i in shown:
            picks.append((int(np.argmax(self.amplitude(i))), f"largest {self.label(i)}", None))
        picks += [(e.index - 0.5, e.kind, e) for e in self.events]
        along, name = self.axis()
        over_frequency = name in ("f [Hz]", "omega [rad/s]")
        along, name = (self.frequency, "f [Hz]") if over_frequency else (along, name)
        heads = ["point", "", *(["omega"] if over_frequency else []), name]
        heads += [*(f"|{self.label(i)}|" for i in shown), "error", "stable"]
        rows = []
        for place, what, event in sorted(dict.fromkeys(picks), key=lambda pick: pick[0]):
            i = min(int(np.ceil(place)), len(self) - 1)
            row: list[Any] = ["" if event else i, what]
            if over_frequency:
                row.append(float(event.omega if event else self.omega[i]))
            at_event = event and (event.frequency if over_frequency else self.place(event))
            row.append(float(at_event if event else along[i]))
            row += [float(self.event_amplitude(event, d) if event else self.amplitude(d)[i]) for d in shown]
            doubt = event.status if event and event.status != "converged" else ""
            rows.append([*row, *(["", doubt] if event else [_error_text(self.error[i]), self._stable_word(i)])])
        return heads, rows

    def _main_coordinates(self) -> list[int]:
        size = self._size()
        force = np.asarray(self.force) if isinstance(self.force, np.ndarray | list | tuple) else np.zeros(len(size))
        concerned = (
            np.abs(force.reshape(len(size), -1)).sum(axis=1) > 0.0 if force.size % max(len(size), 1) == 0 else size > 0
        )
        for one in getattr(self.system, "elements", ()):
            if one.w is not None and one.directions.shape[1] == len(size):
                concerned = concerned | np.any(one.directions != 0.0, axis=0)
        ranked = [int(i) for i in np.argsort(-size, kind="stable")]
        return [i for i in ranked if concerned[i]][:3] or ranked[:3]

    def _size(self) -> np.ndarray:
        """Amplitude of each coordinate at the largest motion, (dof,)."""
        if not self.parts:
            return np.linalg.norm(self.X[int(np.argmax(np.linalg.norm(self.X, axis=(1, 2)))), :, 1:], axis=1)
        i = int(np.argmax([float(np.linalg.norm(y)) for part in self.parts for y in part.y]))
        part, k = self._part_of(i)
        return np.linalg.norm(part.expanded(k)[:, 1:], axis=1)

    def _stable_word(self, i: int) -> str:
        if self.stable is None or np.isnan(float(self.stable[i])):
            return "-"
        return "yes" if self.stable[i] else "no"

    def heading(self) -> str:
        word = self.status.split(":")[0]
        text = (
            f"{type(self).__name__}: {self.status} ({MEANING.get(word, '')}), {len(self)} points, "
            f"{self._span()}, largest estimated error "
            f"{np.nanmax(self.error):.1e}, {self.stats.wall_time * 1e3:.3g} ms"
        )
        if self.stable is not None and not np.any(np.isnan(np.asarray(self.stable, float))):
            text += f", {int(np.sum(~np.asarray(self.stable, bool)))} points unstable"
        return text if not self.reason else f"{text}; {self.reason}"

    def _span(self) -> str:
        where = f"{self.frequency.min():.6g} to {self.frequency.max():.6g} Hz"
        if self.over == "omega":
            where = f"{self.omega.min():.6g} to {self.omega.max():.6g} rad/s"
        if self.varies == "level":
            return f"{self.frequency[0]:.6g} Hz, level {self.level.min():.6g} to {self.level.max():.6g}"
        return where

    @property
    def _cache(self) -> dict[str, Any]:
        return self.__dict__.setdefault("_built", {})


def sorted_ends(here: np.ndarray, other: np.ndarray, behind: bool) -> tuple[np.ndarray, np.ndarray]:
    """Two neighbours in the order of the curve."""
    return (here, other) if behind else (other, here)


def _error_text(error: float) -> str:
    """Below the rounding of numbers an estimate says nothing more."""
    return "<1e-16" if error < 1e-16 else f"{error:.1e}"


def _largest(x: np.ndarray, n_t: int) -> np.ndarray:
    """Largest |x| over a period, from coefficients (n, 2H+1)."""
    top = (x.shape[1] - 1) // 2
    phase = np.outer(np.arange(1, top + 1), np.linspace(0, 2 * np.pi, n_t, endpoint=False))
    return np.max(np.abs(x[:, :1] + x[:, 1::2] @ np.cos(phase) + x[:, 2::2] @ np.sin(phase)), axis=1)


def known_stability(column: np.ndarray, asked: bool) -> np.ndarray | None:
    """Flags where all are known, numbers with nan where some are not, None where nobody asked."""
    if not asked:
        return None
    return column if np.any(np.isnan(column)) else column.astype(bool)
