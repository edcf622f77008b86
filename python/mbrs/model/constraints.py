"""Constraints that are functions of motions: Phi(t, u) = 0 of positions, D(t, u) u' + d(t, u) = 0 of velocities."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .._lib.checks import members
from .book import Book, Group, Item
from .drives import coordinate_of, find_joint
from .expressions import Program
from .function_calls import FunctionCall
from .joint import Joint
from .joints import free
from .law_items import SavedFunction
from .motions import FunctionName, UserFunction, name_of, resolve
from .names import problem, shown
from .numbers import Number, scalar
from .ports import Port, as_port
from .schema import CONSTRAINT, SIX, VELOCITY_CONSTRAINT, Kind
from .tracing import program_lines, read_program, trace_rows

Function = Callable[..., Any]
MotionOf = Joint | Port | str | tuple[Joint | str, str]


class Constraint(Item):
    """Handle of a constraint; see `Model.constraint` and `Model.velocity_constraint`.

    ``body`` is its program (nodes, roots) or the `ConstraintCall` of the slow path; ``motions`` are pairs (joint, coordinate).
    """

    __slots__ = ("body", "motions", "n", "n_rows", "of_velocities")
    body: Any
    motions: list[tuple[int, int]]
    n: int
    n_rows: int
    of_velocities: bool
    store = "constraint"
    kind = "constraint"

    @property
    def table(self) -> Kind:
        return VELOCITY_CONSTRAINT if self.of_velocities else CONSTRAINT

    @property
    def size(self) -> int:
        return self.n

    def _range(self, name: str) -> tuple[int, int]:
        return self.start, self.n

    def check(self, values: Sequence[float]) -> None:
        """A function has no rule for the numbers that it uses."""

    def fields(self) -> dict[str, Group]:
        """``p[i]``: the numbers of the model that the function uses."""
        slots = tuple((self.start + i,) for i in range(self.n))
        return {"p": Group(slots, (self.n,), ("",) * self.n, checked=False)} if slots else {}

    def described(self) -> dict[str, Any]:
        """The table of a file."""
        joints = self.model.joints
        names = [f"{joints[j].name}.{joints[j].table.coordinates[k]}" for j, k in self.motions]
        head = {"name": self.name, "motions": names}
        if isinstance(self.body, ConstraintCall):
            return {**head, **self.body.described()}
        return {**head, "fun": {"type": "function", "program": program_lines(*self.body), "values": self.entries()}}


class ConstraintCall(FunctionCall):
    """The functions of a constraint that is given with its derivatives, checked: values and slopes of each result as one list."""

    def __init__(self, function: Any, derivatives: Any, m: int, where: str, of_velocities: bool, d: Any = None) -> None:
        super().__init__(function, derivatives, m, where)
        self.of_velocities, self.d = of_velocities, d

    def check_callable(self) -> None:
        super().check_callable()
        if isinstance(self.d, FunctionName):
            raise self.d.not_imported(self.where)

    def try_now(self) -> None:
        """Call all once, so that a mistake in them is seen early."""
        if not any(isinstance(f, FunctionName) for f in (self.function, self.derivatives, self.d)):
            self(0.0, [0.0] * self.m)

    def rows(self) -> int:
        """Number of its rows, found by a call where the bodies are drawn; one where only the names of the functions are known."""
        if any(isinstance(f, FunctionName) for f in (self.function, self.d)):
            return 1
        return len(self._values(0.0, self._given([0.0] * self.m)))

    def _given(self, u: list[float]) -> Any:
        return u[0] if self.m == 1 else np.array(u)

    def _values(self, t: float, u: Any) -> np.ndarray:
        """Phi (r, 1), or D beside d (r, m + 1)."""
        made = np.asarray(self._result("function", self.function, t, u), dtype=float)
        if not self.of_velocities:
            return made.reshape(-1, 1)
        left = made.reshape(-1, self.m)
        right = np.zeros(len(left)) if self.d is None else self._result("d", self.d, t, u)
        return np.hstack([left, np.asarray(right, dtype=float).reshape(-1, 1)])

    def __call__(self, t: float, u: list[float], v: Any = None) -> list[float]:
        """Values and slopes of the results, one after the other: (1,), (1 + m,) by t and u, and (1 + m, 1 + m) of positions."""
        self.check_callable()
        given, n = self._given(u), 1 + self.m
        values = self._values(t, given)
        slopes = self._result("derivatives", self.derivatives, t, given)
        shape = (*values.shape, n)
        if self.of_velocities:
            parts = [self._checked("derivatives", slopes, shape)]
        else:
            if not isinstance(slopes, tuple | list) or len(slopes) != 2:
                raise problem(self.where, f"has derivatives that must return (first, second), got {shown(slopes)}")
            parts = [self._checked("derivatives", s, (*shape, *(n,) * k)) for k, s in enumerate(slopes)]
        value = self._checked("function", values, values.shape)
        rows = [np.reshape(part, (len(value), -1)) for part in (value, *parts)]
        return [float(x) for x in np.hstack(rows).ravel()]

    def described(self) -> dict[str, UserFunction]:
        """The functions as a file and a table want them."""
        parts = {"fun": self.function, "derivatives": self.derivatives, "d": self.d}
        return {key: UserFunction(f, self.where, "t, u") for key, f in parts.items() if f is not None}

    def __reduce__(self) -> tuple[Any, ...]:
        made: list[Any] = [self.function, self.derivatives, self.d]
        if not isinstance(self.function, FunctionName):
            made = [None if f is None else name_of(f, self.where) for f in made]
        return _restored, (*made, self.m, self.where, self.of_velocities)


def _restored(function: Any, derivatives: Any, d: Any, m: int, where: str, of_velocities: bool) -> ConstraintCall:
    f, g, h = (resolve(one) if isinstance(one, str) else one for one in (function, derivatives, d))
    return ConstraintCall(f, g, m, where, of_velocities, h)


def _motions(book: Book, name: str, motions: Any) -> list[tuple[int, int]]:
    """(joint, coordinate) of each motion; motions of bodies and markers by a free joint to ground."""
    wanted = members(motions)
    if not wanted:
        raise problem(
            f"{name}.motions", f"must be a list of motions such as ['bob.motion.x', 'hinge.rz'], got {shown(motions)}"
        )
    found = [_motion(book, name, motion) for motion in wanted]
    if len(set(found)) < len(found):
        raise problem(f"{name}.motions", f"names a motion twice: {shown(motions)}")
    return found


def _motion(book: Book, name: str, motion: Any) -> tuple[int, int]:
    joint, coordinate = motion, None
    if isinstance(motion, str) and "." in motion:
        joint, _, coordinate = motion.rpartition(".")
        if not isinstance(book.items.get(joint), Joint) and motion.count(".") != 1:
            motion = as_port(book, motion)
    elif isinstance(motion, tuple) and len(motion) == 2:
        joint, coordinate = motion
    if isinstance(motion, Port):
        return _of_body(book, name, as_port(book, motion))
    if not isinstance(motion, str | tuple | Joint):
        raise problem(f"{name}.motions", f"must be motions of bodies or coordinates of joints, got {shown(motion)}")
    found = find_joint(book, joint, name, "motions")
    return found.index, coordinate_of(found, coordinate, name, "motions")


def _of_body(book: Book, name: str, port: Port) -> tuple[int, int]:
    """A coordinate of the free joint between ground and the point of the port, which is there already or is made."""
    axis = [i for i, x in enumerate(port.direction) if x == 1.0]
    if port.kind != "motion" or len(axis) != 1:
        raise problem(
            f"{name}.motions",
            f"must be motions along x, y, z, rx, ry or rz of a body, got {shown(port.name)}; for other directions use the coordinates of "
            "m.free(name, m.ground, body, at=point, orientation=...)",
        )
    owner: Any = book[port.marker or port.body]  # type: ignore[index]
    at = list(owner.entries("at") if port.point is None else port.point)
    coordinate = SIX[axis[0] + 3 * port.is_rotation]
    for joint in book.joints:
        if joint.type == "free" and _is_frame_of(joint, book, port.body, at):
            return joint.index, joint.table.coordinates.index(coordinate)
    made = free(book, _new_name(book, owner.name), "ground", port.body, at=at)
    return made.index, made.table.coordinates.index(coordinate)


def _is_frame_of(joint: Joint, book: Book, body: str, at: list[Number]) -> bool:
    """Has this free joint the axes of the world, from ground to a point of a body?"""
    names = (book.body_name(joint.a), book.frame_name(joint.b, joint.b_node))
    if joint.has("orientation") or joint.values("axis") != [0.0, 0.0, 1.0] or names != ("ground", body):
        return False
    ends = [joint.entries(key) for key in ("at_a", "at_b")]
    return all(p is q or p == q for end in ends for p, q in zip(end, at, strict=True))


def _new_name(book: Book, owner: str) -> str:
    name, k = f"{owner} motion", 1
    while name in book.items or name in book.space.names:
        k += 1
        name = f"{owner} motion {k}"
    return name


def _add(book: Book, name: Any, fun: Any, motions: Any, d: Any, derivatives: Any, of_velocities: bool) -> Constraint:
    made = Constraint(book, book.new_name("constraint", name))
    made.of_velocities = of_velocities
    where = f"{name}.fun"
    counts = len(book.joints)
    try:
        made.motions = _motions(book, name, motions)
        entries = _body(made, fun, d, derivatives, where)
        _check_finite(made, entries, where)
    except BaseException:
        _forget_joints(book, counts)
        raise
    made.put(entries)
    book.register(made, book.constraints)
    return made


def _forget_joints(book: Book, count: int) -> None:
    """Take back the free joints of a constraint that was refused."""
    for joint in book.joints[count:]:
        del book.items[joint.name]
        del book.stores["joint"].x[joint.start :]
        book.stores["joint"].driven = {k: v for k, v in book.stores["joint"].driven.items() if k < joint.start}
    del book.joints[count:]
    book.changed_structure()


def _body(made: Constraint, fun: Any, d: Any, derivatives: Any, where: str) -> list[Number]:
    """The program of its functions, or the call of the slow path; the numbers of the model that they use."""
    m = len(made.motions)
    numbers: Sequence[Any]
    if isinstance(fun, SavedFunction):
        program, numbers = read_program(fun.lines, m if m > 1 else 0, len(fun.values), where, rates=False), fun.values
    elif derivatives is not None:
        for key, value in (("fun", fun), ("derivatives", derivatives)):
            if not callable(value) and not isinstance(value, FunctionName):
                raise problem(f"{made.name}.{key}", f"must be a function of (t, u), got {shown(value)}")
        made.body = ConstraintCall(fun, derivatives, m, where, made.of_velocities, d)
        made.body.try_now()
        made.n, made.n_rows = 0, made.body.rows()
        return []
    else:
        for key, one in (("fun", fun), ("d", d)):
            if not callable(one) and (key == "fun" or one is not None):
                raise problem(f"{made.name}.{key}", f"must be a function of (t, u), got {shown(one)}")
        functions: list[Callable[..., Any]] = [fun] if d is None else [fun, d]
        program, numbers = trace_rows(
            functions, m if m > 1 else 0, m if made.of_velocities else 1, where, made.of_velocities
        )
    each = m + 1 if made.of_velocities else 1
    if not program.roots or len(program.roots) % each:
        raise problem(where, f"has a program of {len(program.roots)} results, which are not rows of {each}")
    _check_felt(made, program, each, where)
    made.body, made.n_rows = (program.nodes, program.roots), len(program.roots) // each
    entries = [scalar(v, where) for v in numbers]
    made.n = len(entries)
    made.evaluated(entries)
    return entries


def _check_felt(made: Constraint, program: Program, each: int, where: str) -> None:
    """A row without any motion constrains nothing."""
    from .. import _core

    for i in range(0, len(program.roots), each):
        row = program.roots[i : i + each]
        if made.of_velocities:
            felt = any(program.nodes[root] != (None, 0.0) for root in row[:-1])
        else:
            felt = any(_core.Program(program.nodes, row).uses()[1 : 1 + len(made.motions)])
        if not felt:
            raise problem(
                where, f"has row {i // each + 1}, which does not depend on any of its motions and constrains nothing"
            )


def _check_finite(made: Constraint, entries: Sequence[Number], where: str) -> None:
    """A function that is not a number where the bodies are drawn constrains nothing."""
    if isinstance(made.body, ConstraintCall):
        return
    from .. import _core

    values = _core.Program(*made.body).values(
        [0.0] * (1 + len(made.motions)) + [float(v) for v in made.evaluated(entries)]
    )
    found = [values[root] for root in made.body[1]]
    if not np.all(np.isfinite(found)):
        raise problem(
            where,
            f"is {shown([float(v) for v in found])} as drawn (t = 0, all motions 0); write it so that it is finite there: motions are "
            "displacements from the drawn place, to which places have to be added",
        )


# --- methods of `Model` -----


def constraint(
    self: Book, name: str, fun: Function, motions: Sequence[MotionOf], *, derivatives: Function | None = None
) -> Constraint:
    """A constraint of positions: Phi(t, u) = 0, u the motions that it names.

    Parameters
    ----------
    name
        Unique in the model.
    fun
        ``fun(t, u)``, t in s, returns a number or an array (r,): r rows. u is a number for one motion, else an array (m,). Motions count
        from the drawn place. It is called once with symbols, as `mb.FunctionLaw`; parameters of the model that it uses stay parameters.
    motions
        Motions of bodies and markers along the axes of the world ("bob.motion.x", ``bob.motion("rz")``: m, or a component of the
        rotation vector in rad), and free coordinates of joints ("hinge", "plane.rz", ``(hinge, "rz")``). Motions of a body are those of
        a free joint between ground and the point, which is made as "bob motion" unless there is one.
    derivatives
        ``derivatives(t, u) -> (first, second)``, arrays (r, 1 + m) and (r, 1 + m, 1 + m) by t and u. With them ``fun`` is called by
        every evaluation and not traced: the slow path, refused by derivatives by parameters.

    Returns
    -------
    Constraint

    Raises
    ------
    ModelError
        A function that cannot be traced or is not finite as drawn, motions that are none.

    Notes
    -----
    The row J = Phi_u u_q enters every analysis as that of a joint (docs/theory.md (3.12)). Assembly closes it by the smallest change.
    Rows are free of units: Phi over its change for a natural unit of its motions. Linear analyses and equilibrium take t = 0 and
    Phi_t = 0, as for a drive. Cost: m + 1 evaluations of the program for a gradient.

    Examples
    --------
    A bead on a parabola keeps three rotations and one way.

    >>> import mbrs as mb
    >>> m = mb.Model("bead", gravity=(0, 0, -9.81))
    >>> b = m.body("bead", mass=0.1, inertia=(1e-5, 1e-5, 1e-5), at=(0, 0, 0))
    >>> m.constraint("wire", lambda t, u: [u[1], u[2] - 0.5 * u[0] ** 2], ["bead.motion.x", "bead.motion.y", "bead.motion.z"])
    <constraint 'wire' of 'bead'>
    >>> mb.System(m).dof
    4
    """
    return _add(self, name, fun, motions, None, derivatives, False)


def velocity_constraint(
    self: Book,
    name: str,
    fun: Function,
    motions: Sequence[MotionOf],
    *,
    d: Function | None = None,
    derivatives: Function | None = None,
) -> Constraint:
    """A constraint of velocities: D(t, u) u' + d(t, u) = 0, nonholonomic unless it comes from positions.

    Parameters
    ----------
    name, motions
        As in `constraint`.
    fun
        ``fun(t, u)`` returns D, an array (m,) for one row or (r, m); for one motion a number will do.
    d
        ``d(t, u)``, a number or (r,); zero by default.
    derivatives
        ``derivatives(t, u)`` returns (r, m + 1, 1 + m): of D_1 ... D_m and d of each row by t and u. With them the functions are called
        by every evaluation: the slow path.

    Returns
    -------
    Constraint

    Raises
    ------
    ModelError
        As `constraint`.

    Notes
    -----
    It acts on velocities alone, as the rows of a knife edge do, and belongs to the effect "nonholonomic": assembly does not move anything
    for it, it takes one velocity each and no position. A coefficient D that vanishes where the bodies start leaves a row without effect.

    Examples
    --------
    >>> import numpy as np
    >>> import mbrs as mb
    >>> m = mb.Model("skate"); s = m.body("skate", mass=1.0, inertia=(1, 1, 1))
    >>> plane = m.planar("ice", m.ground, s, at=(0, 0, 0), axis="z")
    >>> m.velocity_constraint("edge", lambda t, u: [-np.sin(u[2]), np.cos(u[2]), 0.0], ["ice.x", "ice.y", "ice.rz"])
    <constraint 'edge' of 'skate'>
    """
    return _add(self, name, fun, motions, d, derivatives, True)
