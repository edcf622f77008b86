"""The methods of a model that add springs and loads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from .attached_laws import NewLaws, add_laws
from .forces import HAS_C, HAS_K, HAS_PRELOAD, LENGTH_GIVEN, LOAD_FRAMES, SIX, Element, Load
from .motions import FUNCTION, Motion, MotionItem, TimeFunction
from .names import problem, shown
from .numbers import Number, array, is_pair, point_pair, scalar, shape_of, vector
from .numbers import axis as direction
from .rotations import quaternion

if TYPE_CHECKING:
    from .model import Model
    from .section_loads import SectionLoad

_L = TypeVar("_L", bound=Load)


def _coefficient(e: Element, field: str, value: Any) -> Number:
    if value is None:
        return 0.0
    e.shapes[field] = ()
    return scalar(value, f"{e.name}.{field}")


def _six_by_six(e: Element, field: str, value: Any) -> list[Number]:
    flat: list[Number] = [0.0] * 36
    if value is None:
        return flat
    where, shape = f"{e.name}.{field}", shape_of(value)
    if shape == (6,):
        flat[::7] = array(value, (6,), where)
    elif shape == (6, 6):
        flat = array(value, (6, 6), where)
    else:
        raise problem(where, f"must be 6 numbers (x y z rx ry rz) or a 6 x 6 matrix, got {shown(value)}")
    e.shapes[field] = shape
    return flat


def _new_element(
    model: Model, type_: str, name: Any, a: Any, b: Any, at: Any, k: Any, c: Any, preload: Any, law: Any
) -> tuple[Element, Any]:
    e = Element(model, model.new_name("element", name))
    e.type, e.shapes, e.one_point = type_, {}, False
    at = model.connect(e, f"{type_} {name!r}", a, b, at)
    if k is None and c is None and preload is None and law is None:
        raise problem(name, f"does nothing: give the {type_} at least one of k=, c=, preload=, law=")
    e.flags = HAS_K * (k is not None) + HAS_C * (c is not None) + HAS_PRELOAD * (preload is not None)
    return e, at


def _finish(e: Element, entries: list[Number], laws: NewLaws) -> Element:
    e.put(entries)
    e.index = len(e.model.elements)
    laws.commit(e.index)
    e.model.register(e, e.model.elements)
    return e


class ElementMethods:
    """The springs and loads of a model. Forces are preload + k e + c e', against the elongation e (docs/tables.md)."""

    def spring_damper(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        k: Any = None,
        c: Any = None,
        length: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Element:
        """A spring and damper between two points: tension f = preload + k (d - L0) + c d', d the distance of the
        points.

        Parameters
        ----------
        name
            Unique in the model.
        a, b
            Bodies, or ground.
        at
            ``(P_a, P_b)``, world coordinates as drawn (m), the first fixed in a, the second in b; they must differ.
        k, c, preload
            N/m, N s/m, N (tension); numbers or expressions. At least one of these or ``law``.
        length
            Natural length L0 (m). Without it L0 is the drawn distance, also when the points are moved.
        law
            A nonlinear law of (d - L0, d'), or a list of them, added to the above.

        Returns
        -------
        Element

        Raises
        ------
        ModelError
            Coincident points, wrong shapes, numbers that are not finite, an element that does nothing.

        Notes
        -----
        Cost O(1).

        Examples
        --------
        >>> import mbrs as mb
        >>> m = mb.Model("drop"); p = m.body("ball", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 1))
        >>> m.spring_damper("string", m.ground, p, at=((0, 0, 2), (0, 0, 1)), k=100.0)
        <element 'string' of 'drop'>
        """
        e, at = _new_element(self, "spring_damper", name, a, b, at, k, c, preload, law)
        at_a, at_b = point_pair(at, name + ".at")
        entries = [
            *at_a,
            *at_b,
            _coefficient(e, "k", k),
            _coefficient(e, "c", c),
            0.0 if length is None else scalar(length, name + ".length"),
            _coefficient(e, "preload", preload),
        ]
        e.flags |= LENGTH_GIVEN * (length is not None)
        return _finish(e, entries, add_laws(e, law, 1, ("u",)))

    def bushing(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        k: Any = None,
        c: Any = None,
        orientation: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Element:
        """A six-component spring and damper: f = preload + k e + c e', e = (displacement, rotation vector) of b, frame
        of a.

        ``at``: a point (3,) or two (P_a, P_b), world, m. ``k``, ``c``: (6,) or (6, 6), translation first (N/m, N m/rad;
        N s/m, N m s/rad). ``orientation``: of its frame as drawn (world axes by default), carried along by a.
        ``preload``: (6,) N, N m. ``law``: six laws or None, or {"x": law, "rz": law}.

        >>> import mbrs as mb
        >>> m = mb.Model("mount"); p = m.body("plate", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
        >>> m.bushing("rubber", m.ground, p, at=(0, 0, 0), k=(1e4, 1e4, 1e4, 10, 10, 10)).name
        'rubber'
        """
        e, at = _new_element(self, "bushing", name, a, b, at, k, c, preload, law)
        e.one_point = not is_pair(at)
        at_a, at_b = (vector(at, name + ".at"),) * 2 if e.one_point else point_pair(at, name + ".at")
        if preload is not None:
            e.shapes["preload"] = (6,)
        entries = [
            *(*at_a, *at_b, *quaternion(orientation, name + ".orientation")),
            *_six_by_six(e, "k", k),
            *_six_by_six(e, "c", c),
            *((0.0,) * 6 if preload is None else array(preload, (6,), name + ".preload")),
        ]
        return _finish(e, entries, add_laws(e, law, 6, SIX))

    def torsion(  # type: ignore[misc]
        self: Model,
        name: str,
        a: Any,
        b: Any,
        *,
        at: Any = None,
        axis: Any,
        k: Any = None,
        c: Any = None,
        angle: Any = None,
        preload: Any = None,
        law: Any = None,
    ) -> Element:
        """A torsion spring about ``axis`` (fixed in a): moment preload + k (phi - angle) + c phi', phi = 0 as drawn.

        ``at``: one point (3,), world, where it is drawn; the moment does not depend on it. ``angle``: unstretched
        angle, rad. ``k``, ``c``, ``preload``: N m/rad, N m s/rad, N m.
        """
        e, at = _new_element(self, "torsion", name, a, b, at, k, c, preload, law)
        if is_pair(at):
            raise problem(name + ".at", "must be one point (3,): a torsion spring has no second one")
        entries = [
            *vector(at, name + ".at"),
            *direction(axis, name + ".axis"),
            _coefficient(e, "k", k),
            _coefficient(e, "c", c),
            0.0 if angle is None else scalar(angle, name + ".angle"),
            _coefficient(e, "preload", preload),
        ]
        return _finish(e, entries, add_laws(e, law, 1, ("angle",)))

    def force(  # type: ignore[misc]
        self: Model, name: str, body: Any, *, at: Any = None, value: Any, frame: str = "world", on: Any = None
    ) -> Load:
        """A force ``value`` (3,), N, at the world point ``at`` of the body (its origin by default).

        ``frame="world"``: keeps its direction; ``"body"``: turns with the body (a follower), value in world axes as
        drawn. A component may be a motion (`Ramp`, `Sine`, `Polynomial`, `Table`) or a function of t (s); ``value`` may be one
        function that returns (3,). Their numbers have addresses such as "pull.x_amplitude". Linear analyses take t = 0.

        >>> import mbrs as mb
        >>> m = mb.Model("shaken"); p = m.body("plate", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
        >>> m.force("shaker", p, value=(mb.Sine(5.0, frequency=10.0), 0, 0))
        <load 'shaker' of 'shaken'>

        Of a flexible body the load acts at a node, or with ``on="frame"`` on its floating frame, moving no shape.
        """
        return _add_load(self, "force", name, body, at, value, frame, on)

    def torque(  # type: ignore[misc]
        self: Model, name: str, body: Any, *, value: Any, frame: str = "world", on: Any = None
    ) -> Load:
        """A torque ``value`` (3,), N m; ``frame``, ``on`` and what varies in time as for `force`."""
        return _add_load(self, "torque", name, body, None, value, frame, on)

    def modal_force(self: Model, name: str, body: Any, *, mode: int, value: Any) -> Load:  # type: ignore[misc]
        """A force on modal coordinate ``mode`` (from 1) of a flexible body, a number, a motion or a function of t (s).

        Its power is value times the rate of ``body.q<mode>``: N for coordinates in metres.

        >>> import mbrs as mb
        >>> m = mb.Model("one"); rod = m.flexible_body("rod", mb.flexible.beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=4.0))
        >>> m.modal_force("push", rod, mode=1, value=mb.Sine(0.1, frequency=0.5))
        <load 'push' of 'one'>
        """
        from .section_loads import add_modal_force

        return add_modal_force(self, name, body, mode, value)

    def section_load(  # type: ignore[misc]
        self: Model,
        body: Any,
        stations: Any,
        table: Any,
        *,
        times: Any = None,
        frame: str = "body",
        name: str | None = None,
        kind: str = "cubic",
    ) -> SectionLoad:
        """A load per length along a flexible body, such as tabulated aerodynamic forces of the sections of a blade.

            F = int f dx,   M = int r x f + m dx,   Q_k = int f . phi_k + m . theta_k dx

        Parameters
        ----------
        body
            A flexible body.
        stations
            (n_s,) m, increasing: distance along the body's line (a beam's x). The load is linear between them, zero beyond.
        table
            (n_s, 3) force per length, N/m, or (n_s, 6) with moment per length, N m/m; with ``times`` one axis (n_t) more
            in front.
        times
            (n_t,) s, increasing; between them a curve of the given ``kind`` ("cubic" or "linear"), the end values outside.
        frame
            "body": components along the axes of the body's frame, in which they turn: a follower force and torque on the
            frame and one force on each modal coordinate. "world": the load keeps its direction, and is shared between
            neighbouring nodes.
        name
            Heads the names of the loads that are made, ``name-force`` and so on; "body-load" by default.

        Returns
        -------
        SectionLoad
            The names of its loads and their resultants.

        Raises
        ------
        ModelError
            No flexible body, wrong shapes, stations beyond the body, nodes that do not reach over a load in world axes.

        Notes
        -----
        Neglected with ``frame="body"``: that the line of action moves with the deflection (f acts at r, not at r + phi q) and
        that f turns with its section. With ``frame="world"`` nodes carry the load along; forces between nodes bend
        the body as their shares would, an error O(spacing^2). Cost O((n_s + n_line) m n_t).

        Examples
        --------
        >>> import numpy as np, mbrs as mb
        >>> m = mb.Model("wing"); beam = mb.flexible.beam(2.0, mass=1.0, EI_flap=10.0, EI_edge=40.0, modes=3)
        >>> wing = m.flexible_body("wing", beam)
        >>> lift = m.section_load(wing, [0.0, 2.0], [[0, 0, 5.0], [0, 0, 1.0]])
        >>> lift.force, lift.moment
        (array([0., 0., 6.]), array([ 0.        , -4.66666667,  0.        ]))
        """
        from .section_loads import add_section_load

        return add_section_load(self, body, stations, table, times, frame, name, kind)


def parted(load: Load, value: Any) -> tuple[list[Number], dict[int, list[Number]]]:
    """The constant part of a load's value, and the numbers of the motions of its components."""
    where = load.name + ".value"
    load.motions = []
    if isinstance(value, Motion):
        raise problem(where, "must be three components: put the motion into one, such as (motion, 0, 0)")
    whole = None
    if callable(value):
        whole = TimeFunction(value, where, 3)
        whole(0.0)
        value = (whole,) * 3
    varying: dict[int, list[Number]] = {}
    constant = list(value) if isinstance(value, (list, tuple)) else value
    if isinstance(constant, list) and len(constant) == 3:
        for i, one in enumerate(constant):
            if not (isinstance(one, Motion) or callable(one)):
                continue
            item = MotionItem(load.model, load.name)
            item.owner, item.component = load, i
            if whole is None:
                varying[i] = item.take(one, f"{load.name}.{'xyz'[i]}", 1)
            else:
                item.code, item.groups, item.function, varying[i] = FUNCTION, (), whole, []
            item.check(item.evaluated(varying[i]))
            load.motions.append(item)
            constant[i] = 0.0
    return vector(constant, where), varying


def entered(load: _L, numbers: list[Number], varying: dict[int, list[Number]]) -> _L:
    """A checked load, its numbers and those of its motions put into the model."""
    model = load.model
    load.put(numbers)
    for item in load.motions:
        item.place = len(model.motions)
        item.put(varying[item.component])
        model.motions.append(item)
    model.register(load, model.loads)
    return load


def _add_load(model: Model, type_: str, name: Any, body: Any, at: Any, value: Any, frame: Any, on: Any) -> Load:
    load = Load(model, model.new_name("load", name))
    load.type = type_
    where = name + ".at"
    if on is None:
        load.body, load.node, at = model.load_place(f"{type_} {name!r}", body, at if type_ == "force" else None, where)
    elif isinstance(on, str) and on == "frame":
        load.body, load.node = model.find_body(body, f"{type_} {name!r}"), -1
        at = model.bodies[load.body].entries(0, 3) if at is None else at
    else:
        raise problem(name + ".on", f"must be 'frame' (of a flexible body) or left out, got {shown(on)}")
    if load.body < 0:
        raise problem(name, f"is a {type_} on ground, which does not move; name the body it acts on")
    if not isinstance(frame, str) or frame not in LOAD_FRAMES:
        raise problem(name + ".frame", f"must be 'world' or 'body' (a follower), got {shown(frame)}")
    load.frame = frame
    if at is not None and is_pair(at):
        raise problem(where, "must be one point (3,): a force acts at one")
    point = vector((0.0, 0.0, 0.0) if type_ == "torque" else at, where)
    constant, varying = parted(load, value)
    return entered(load, [*point, *constant], varying)
