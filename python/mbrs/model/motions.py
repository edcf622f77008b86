"""Prescribed functions of time, for drives and for loads: `Ramp`, `Sine`, `Polynomial`, `Table`, or a Python function.

The built-in ones give value, rate and acceleration exactly, in the core; their numbers may be parameter expressions and have
addresses ("motor.amplitude"). A Python function is the slow path: the core calls it at every evaluation.
"""

from __future__ import annotations

import importlib
import itertools
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import UNFIT
from ..errors import MbrsError, ModelError
from .aliases import Scalar, TimeFunctionLike
from .book import Group, Item
from .names import problem, shown
from .numbers import Number, array, scalar, shape_of
from .schema import (
    CUBIC_TABLE,
    FUNCTION,
    LINEAR_TABLE,
    MOTIONS,
    POLYNOMIAL,
    RAMP,
    SINE,
    SINE_HZ,
    MotionKind,
    motion_unit,
)

if TYPE_CHECKING:
    from .aliases import Matrix, Scalar, Vector

# Differences over seven points this far apart (s) stand for the derivatives of a function that does not give them.
_STEP = 1e-3


class Motion:
    """Base of the motions: ``code`` and ``entries`` are what the core reads, ``declared`` is its line of the schema."""

    declared: MotionKind

    def __init__(self, *groups: Any) -> None:
        self.groups = groups

    @property
    def code(self) -> int:
        """Code of the kind in the Tables."""
        return self.declared.code

    @property
    def layout(self) -> tuple[tuple[str, int | None], ...]:
        """Name of each group of numbers and how many it has: 1, or any number."""
        return tuple((g.rstrip("*"), None if g.endswith("*") else 1) for g in self.declared.groups)

    def entries(self, where: str) -> list[list[Number]]:
        """The numbers of each named group, checked; ``where`` heads messages."""
        out = []
        for (name, size), given in zip(self.layout, self.groups, strict=True):
            address = f"{where}.{name}"
            if size == 1:
                out.append([scalar(given, address)])
                continue
            shape = shape_of(given)
            if len(shape) != 1 or shape[0] < 1:
                raise problem(address, f"must be a list of numbers, got {shown(given)}")
            out.append(array(given, shape, address))
        return out

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{n}={g}' for (n, _), g in zip(self.layout, self.groups, strict=True))})"


class Ramp(Motion):
    """offset + rate (t - start) from ``start`` (s) on, offset before: with ``start=0`` a steady rate.

    Parameters
    ----------
    rate
        Per second: rad/s or m/s for a drive, N/s or N m/s for a load.
    offset
        Value until the start.
    start
        s. The rate jumps there; a driven model then takes the jump as an impact.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.Ramp(2.0)
    Ramp(rate=2.0, offset=0.0, start=0.0)
    """

    declared = RAMP

    def __init__(self, rate: Scalar, offset: Scalar = 0.0, start: Scalar = 0.0) -> None:
        super().__init__(rate, offset, start)


class Sine(Motion):
    """offset + amplitude sin(omega t + phase).

    Parameters
    ----------
    amplitude
        rad, m, N or N m.
    omega, frequency
        rad/s or Hz: exactly one of them.
    phase
        rad.
    offset
        As the amplitude.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.Sine(0.1, frequency=5.0)
    Sine(amplitude=0.1, frequency=5.0, phase=0.0, offset=0.0)
    """

    declared = SINE

    def __init__(
        self,
        amplitude: Scalar,
        omega: Scalar | None = None,
        *,
        frequency: Scalar | None = None,
        phase: Scalar = 0.0,
        offset: Scalar = 0.0,
    ) -> None:
        if (omega is None) == (frequency is None):
            raise ModelError("Sine takes exactly one of omega= (rad/s) and frequency= (Hz)")
        if omega is None:
            self.declared = SINE_HZ
        super().__init__(amplitude, frequency if omega is None else omega, phase, offset)


class Polynomial(Motion):
    """c_0 + c_1 t + c_2 t^2 + ...; t in s.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.Polynomial([0.0, 1.0, -0.5])
    Polynomial(coefficients=[0.0, 1.0, -0.5])
    """

    declared = POLYNOMIAL

    def __init__(self, coefficients: Vector | Matrix) -> None:
        super().__init__(coefficients)


class Table(Motion):
    """A curve through points: the natural cubic spline (acceleration continuous), or straight lines; the end values outside.

    Parameters
    ----------
    t
        (n,) s, increasing; n >= 2.
    value
        (n,).
    kind
        "cubic" or "linear". The rate of straight lines jumps at every point: a driven model takes that as an impact.

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.Table([0.0, 1.0, 2.0], [0.0, 0.5, 0.0])
    Table(t=[0.0, 1.0, 2.0], value=[0.0, 0.5, 0.0])
    """

    declared = CUBIC_TABLE

    def __init__(self, t: Vector, value: Vector | Matrix, kind: str = "cubic") -> None:
        if kind not in ("cubic", "linear"):
            raise ModelError(f"Table: kind= is 'cubic' or 'linear', got {shown(kind)}")
        if kind == "linear":
            self.declared = LINEAR_TABLE
        super().__init__(t, value)

    def entries(self, where: str) -> list[list[Number]]:
        """Times and values, as many of one as of the other."""
        t, value = super().entries(where)
        if len(t) < 2 or len(t) != len(value):
            raise problem(where, f"needs as many times as values, at least two; got {len(t)} and {len(value)}")
        return [t, value]


class FunctionName:
    """The name "module:function" in a file that was read as data: nothing was imported."""

    def __init__(self, name: str) -> None:
        check_function_name(name)
        self.name = name

    def not_imported(self, where: str) -> MbrsError:
        """The error of a call of it; ``where`` names its owner."""
        return problem(
            where,
            f"is the Python function {shown(self.name)}, which was not imported: a file is read as data. If you trust it, "
            "load it with functions=True (in a shell: --functions)",
        )


_FUNCTION_NAME = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*(\.[^\W\d]\w*)*")


def check_function_name(name: str) -> None:
    """Raise where a text does not read like "module:function"."""
    if not _FUNCTION_NAME.fullmatch(name):
        raise ModelError(f"{shown(name)} does not name a function; write 'module:function'")


class UserFunction:
    """A function of the user on paper: a file needs the name by which it comes back, a table shows what there is."""

    def __init__(self, function: Callable[..., Any] | FunctionName, where: str, arguments: str) -> None:
        self.function, self.where, self.arguments = function, where, arguments

    @property
    def name(self) -> str:
        """``module:name``, by which the function comes back from a file."""
        return name_of(self.function, self.where)

    def __str__(self) -> str:
        """The name, also of one that a file cannot hold."""
        if isinstance(self.function, FunctionName):
            return self.function.name
        return f"{getattr(self.function, '__name__', type(self.function).__name__)}({self.arguments})"


class TimeFunction(UserFunction):
    """A Python function of t with what the core needs: floats, checked, and errors that name their owner.

    ``outputs``: 0 for a drive (value, or value, rate and acceleration), 1 for one number, 3 for a vector.
    """

    def __init__(self, function: Callable[[float], Any] | FunctionName, where: str, outputs: int) -> None:
        super().__init__(function, where, "t")
        self.outputs = outputs

    def check_callable(self) -> None:
        """Raise where only the name of the function is known."""
        if isinstance(self.function, FunctionName):
            raise self.function.not_imported(self.where)

    def try_now(self) -> None:
        """Call it once, so that a mistake in it is seen early."""
        if not isinstance(self.function, FunctionName):
            self(0.0)

    def __call__(self, t: float) -> list[float]:
        """Numbers at t: [value, rate, acceleration] of a drive."""
        made = self._numbers(t)
        if self.outputs or len(made) == 3:
            return made
        before, after = ([self._numbers(t + s * k * _STEP)[0] for k in (1, 2, 3)] for s in (-1, 1))
        odd, even = ([a + s * b for a, b in zip(after, before, strict=True)] for s in (-1, 1))
        rate = (45 * odd[0] - 9 * odd[1] + odd[2]) / (60 * _STEP)
        acceleration = (270 * even[0] - 27 * even[1] + 2 * even[2] - 490 * made[0]) / (180 * _STEP**2)
        return [made[0], rate, acceleration]

    def _numbers(self, t: float) -> list[float]:
        self.check_callable()
        try:
            made = self.function(t)  # type: ignore[operator]
        except BaseException as raised:
            trace = raised.__traceback__
            if isinstance(raised, TypeError) and trace and trace.tb_next is None:  # the call itself, not the function
                raise problem(
                    self.where, f"has a function that cannot be called with the time alone: {raised}"
                ) from None
            raised.add_note(f"raised at t = {t:.9g} s by the function of {self.where}")
            raise
        try:
            flat = np.asarray(made, dtype=float).ravel()
        except UNFIT:
            raise problem(self.where, f"has a function that returned {shown(made)} at t = {t:.9g} s") from None
        allowed = (self.outputs,) if self.outputs else (1, 3)
        if flat.size not in allowed:
            need = " or ".join(map(str, allowed))
            raise problem(self.where, f"has a function that must return {need} numbers, got {shown(made)}")
        if not np.all(np.isfinite(flat)):
            raise problem(self.where, f"has a function that returned {shown(made)} at t = {t:.9g} s; it must be finite")
        return [float(v) for v in flat]

    def __reduce__(self) -> tuple[Any, ...]:
        if isinstance(self.function, FunctionName):
            return TimeFunction, (self.function, self.where, self.outputs)
        return _restored, (self.name, self.where, self.outputs)

    def __deepcopy__(self, memo: Any) -> TimeFunction:
        return self


def name_of(function: Any, where: str) -> str:
    """``module:name`` of a function that can be imported by it; ``where`` heads the error of others."""
    if isinstance(function, FunctionName):
        return function.name
    module, name = getattr(function, "__module__", None), getattr(function, "__qualname__", None)
    try:
        found = module != "__main__" and resolve(f"{module}:{name}") is function
    except ModelError:
        found = False
    if not found:
        raise problem(
            where,
            f"has the function {shown(function)}, which cannot be saved: it is not importable by name; define it at the top level of a "
            "module",
        )
    return f"{module}:{name}"


def _restored(name: str, where: str, outputs: int) -> TimeFunction:
    return TimeFunction(resolve(name), where, outputs)


def resolve(name: str) -> Callable[[float], Any]:
    """The function that ``module:name`` means."""
    check_function_name(name)
    module, _, path = name.partition(":")
    try:
        found: Any = importlib.import_module(module)
        for part in path.split("."):
            found = getattr(found, part)
    except Exception as reason:  # also what the module itself raises
        raise ModelError(f"the function {shown(name)} cannot be imported: {shown(str(reason))}") from None
    if not callable(found):
        raise ModelError(f"{shown(name)} is not callable")
    return found  # type: ignore[no-any-return]


class MotionItem(Item):
    """A motion as a model keeps it: its kind, its numbers or its function, whom it moves."""

    __slots__ = ("code", "component", "function", "groups", "owner", "place")
    code: int
    component: int  # of the load that owns it; -1 of a drive
    function: TimeFunction | None
    groups: tuple[tuple[str, int, bool], ...]  # name, how many numbers, one number rather than a list
    owner: Any
    place: int  # among the motions of the model
    store = "motion"
    kind = "motion"

    @property
    def size(self) -> int:
        return sum(n for _, n, _ in self.groups)

    def _range(self, name: str) -> tuple[int, int]:
        return self.start, self.size

    def take(self, motion: Any, where: str, outputs: int) -> list[Number]:
        """Read a motion, a function or a number; returns the numbers to be put."""
        self.function = None
        if isinstance(motion, Motion):
            entries = motion.entries(where)
            self.code = motion.code
            self.groups = tuple(
                (name, len(e), size == 1) for (name, size), e in zip(motion.layout, entries, strict=True)
            )
            return [v for group in entries for v in group]
        if callable(motion) or isinstance(motion, FunctionName):
            self.code, self.groups = FUNCTION.code, ()
            self.function = TimeFunction(motion, where, outputs)
            self.function.try_now()
            return []
        return self.take(Polynomial([scalar(motion, where)]), where, outputs)

    def check(self, values: Sequence[float]) -> None:
        if self.code in (CUBIC_TABLE.code, LINEAR_TABLE.code):
            t = values[: self.size // 2]
            if any(not b > a for a, b in itertools.pairwise(t)):
                raise problem(self.name + ".t", f"must increase from point to point, got {shown(list(t))}")

    def motion_fields(self, prefix: str = "", unit: str = "") -> dict[str, Group]:
        """Addresses of the numbers."""
        out, start = {}, self.start
        for name, n, one in self.groups:
            slots = tuple((start + i,) for i in range(n))
            shape, units = () if one else (n,), (motion_unit(name, unit),) * n
            out[prefix + name] = Group(slots, shape, units, store="motion", checked=name == "t")
            start += n
        return out

    def described(self) -> Any:
        """Data for a file: {type, numbers}, or the function."""
        if self.function is not None:
            return self.function
        table: dict[str, Any] = {"type": MOTIONS[self.code].name}
        start, entries = 0, self.entries()
        for name, n, one in self.groups:
            table[name] = entries[start] if one else entries[start : start + n]
            start += n
        if self.code == LINEAR_TABLE.code:
            table["kind"] = "linear"
        return table


TYPES: dict[str, type[Motion]] = {"Ramp": Ramp, "Sine": Sine, "Polynomial": Polynomial, "Table": Table}

MotionLike = Motion | TimeFunctionLike | Scalar
