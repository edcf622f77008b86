"""The model: names, units and numbers as the user gives them. `mbrs.model.tables` makes Tables of it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from .._lib.checks import is_word
from .._lib.formats import find
from .._lib.text import counted
from ..errors import ModelError
from ..view.scene import SceneGeometry
from . import aerodynamics as _aerodynamics
from . import bodies as _bodies
from . import constraints as _constraints
from . import drives as _drives
from . import flexible as _flexible
from . import force_laws as _force_laws
from . import forces as _forces
from . import joints as _joints
from . import restraints as _restraints
from . import section_loads as _section_loads
from .addresses import Target, assign, read, target
from .aerodynamics import Aerodynamics
from .aliases import Matrix, Vector, Vector3
from .bodies import Body, Ground, Marker
from .book import STORES, Book, Item, Store
from .constraints import Constraint
from .drives import Coupler, Drive
from .expressions import Program, Symbol, rebuild_all
from .forces import Element, Load
from .joint import Joint
from .names import GROUND, check_name, not_found, shown
from .numbers import vector
from .parameters import ArrayParameter
from .scene import scene_from_tables
from .schema import (
    BODY,
    DRAWING_TOLERANCE,
    ELEMENTS,
    FLEXIBLE_BODY,
    GRAVITY,
    JOINTS,
    LARGEST_TOLERANCE,
    LOADS,
    MARKER,
    UNITS,
    Kind,
)
from .tables import tables
from .units import accepting, converted, has_quantity, labelled, refuse

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..view.modes import Viewer

# What `dir(model)` leaves out: attributes that the package uses and a user does not.
_INTERNAL = frozenset(vars(Book("names"))) | {name for name in vars(Book) if not name.startswith("_")}
_PUBLIC = frozenset(
    {
        "name",
        "bodies",
        "joints",
        "elements",
        "loads",
        "drives",
        "couplers",
        "constraints",
        "markers",
        "airs",
        "tolerance",
        "units",
    }
)


ViewLike = Literal["xy", "xz", "yz"] | tuple[float, float] | None


class Gravity(Item):
    """The three numbers of gravity."""

    __slots__ = ()
    store = "gravity"
    kind = "gravity"

    @property
    def table(self) -> Kind:
        return GRAVITY


class Model(Book):
    """A spatial multibody system as the user describes it: bodies, joints, springs, loads, parameters.

    Parameters
    ----------
    name
        Any string; it heads the tables and pages made from the model.
    gravity
        Acceleration (3,), m/s2, world; None (and nothing is computed for it) by default.
    tolerance
        Accuracy of what was drawn: of lengths over the characteristic length, and of angles (rad). 0 < tolerance < 0.1.
    units
        "SI": numbers of objects, parameters and `set` may be texts with a unit, such as "100 N/mm" or "30 deg", which pint (extra
        ``units``) converts to SI when they are typed. None: any consistent units, and numbers only.

    Raises
    ------
    ModelError
        A wrong argument, here and in every method; the message names the object and the remedy.

    Notes
    -----
    World coordinates of the drawn configuration locate everything, SI units, radians. Adding an object costs O(1). The constructors of
    objects are defined beside their handles, in `mbrs.model.bodies`, ``joints``, ``forces``, ``drives``, ``flexible``, ``section_loads``.

    Examples
    --------
    >>> import mbrs as mb
    >>> m = mb.Model("pendulum", gravity=(0, 0, -9.81))
    >>> length = m.parameter("length", 1.0)
    >>> rod = m.body("rod", mass=2.0, inertia=(0.2, 0.2, 0.01), at=(0, 0, -length / 2))
    >>> m.revolute("hinge", m.ground, rod, at=(0, 0, 0), axis="x")
    <joint 'hinge' of 'pendulum'>
    >>> m.set({"length": 1.5}); m.value("rod.at")
    array([ 0.  ,  0.  , -0.75])
    """

    bodies: list[Body]
    joints: list[Joint]
    elements: list[Element]
    loads: list[Load]
    drives: list[Drive]
    couplers: list[Coupler]
    constraints: list[Constraint]
    markers: list[Marker]
    airs: list[Aerodynamics]

    def __init__(
        self,
        name: str,
        gravity: Vector3 | None = None,
        tolerance: float = DRAWING_TOLERANCE,
        units: Literal["SI"] | None = None,
    ) -> None:
        super().__init__(name)
        if units is not None and not is_word(units, ("SI",)):
            raise ModelError(f"units= must be 'SI' or None, got {shown(units)}")
        self.units = units
        self.ground = Ground(self, GROUND)
        self.tolerance = tolerance
        if gravity is not None:
            self.gravity = gravity

    body = accepting(_bodies.body, BODY)
    flexible_body = accepting(_flexible.flexible_body, FLEXIBLE_BODY)
    marker = accepting(_bodies.marker, MARKER)

    fixed = accepting(_joints.fixed, JOINTS)
    revolute = accepting(_joints.revolute, JOINTS)
    prismatic = accepting(_joints.prismatic, JOINTS)
    cylindrical = accepting(_joints.cylindrical, JOINTS)
    screw = accepting(_joints.screw, JOINTS)
    universal = accepting(_joints.universal, JOINTS)
    spherical = accepting(_joints.spherical, JOINTS)
    planar = accepting(_joints.planar, JOINTS)
    free = accepting(_joints.free, JOINTS)
    distance = accepting(_restraints.distance, JOINTS)
    knife_edge = accepting(_restraints.knife_edge, JOINTS)
    rolling_disc = accepting(_restraints.rolling_disc, JOINTS)
    point_on_line = accepting(_restraints.point_on_line, JOINTS)

    spring_damper = accepting(_forces.spring_damper, ELEMENTS)
    bushing = accepting(_forces.bushing, ELEMENTS)
    force_law = _force_laws.force_law
    torsion = accepting(_forces.torsion, ELEMENTS)
    force = accepting(_forces.force, LOADS)
    torque = accepting(_forces.torque, LOADS)
    modal_force = _section_loads.modal_force
    section_load = _section_loads.section_load

    aerodynamics = _aerodynamics.aerodynamics

    drive = _drives.drive
    coupler = _drives.coupler
    constraint = _constraints.constraint
    velocity_constraint = _constraints.velocity_constraint

    @overload
    def parameter(self, name: str, value: float | np.floating[Any] | np.integer[Any], unit: str = "") -> Symbol: ...
    @overload
    def parameter(self, name: str, value: Sequence[Any] | np.ndarray, unit: str = "") -> ArrayParameter: ...
    def parameter(self, name: str, value: Any, unit: str = "") -> Symbol | ArrayParameter:
        """A design variable, to be used wherever a number is expected.

        Parameters
        ----------
        name
            Unique in the model, without ``.``, ``[`` and ``]``.
        value
            A number, or an array of any shape.
        unit
            A label such as "N/m" for tables and plots; nothing is converted but a text such as "100 N/mm" as ``value``, in models
            with ``units="SI"``.

        Returns
        -------
        An expression, or an array of them. Arithmetic, indexing and NumPy functions give expressions with exact derivatives.

        Examples
        --------
        >>> import mbrs as mb
        >>> m = mb.Model("one"); V = m.parameter("V", [[1.0, 2.0], [3.0, 4.0]])
        >>> (2 * V[0, 1] + 1).value
        5.0
        """
        if isinstance(name, str) and name == "gravity":
            raise ModelError("a parameter must not be called 'gravity': that is the address of the model's gravity")
        check_name("parameter", name, self.items)
        if name in self.space.names:
            check_name("parameter", name, self.space.names)
        if not isinstance(unit, str):
            raise ModelError(f"the unit of parameter {shown(name)} must be text such as 'N/m', got {shown(unit)}")
        if has_quantity(value):
            refuse(self, name, value)
            if isinstance(value, str):
                value, unit = labelled(value, unit, name)
            else:
                value = converted(value, (unit,), name)
        made = self.space.add(name, value, unit)
        self.structure_version += 1
        return made

    @property
    def tolerance(self) -> float:
        """Accuracy of what was drawn: of lengths over the characteristic length, and of angles (rad)."""
        return self._tolerance

    @tolerance.setter
    def tolerance(self, value: float) -> None:
        number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
        if not number or not 0.0 < value < LARGEST_TOLERANCE:
            raise ModelError(
                f"the tolerance of model {shown(self.name)} must be a number between 0 and {LARGEST_TOLERANCE:g} (a share of its size), "
                f"got {shown(value)}"
            )
        self._tolerance = float(value)
        self.changed_structure()

    @property
    def gravity(self) -> np.ndarray | None:
        """Acceleration of gravity (3,), m/s2, world, or None. Assigning it replaces it."""
        return None if self.gravity_item is None else np.array(self.gravity_item.values())

    @gravity.setter
    def gravity(self, value: Vector3) -> None:
        old, self.stores["gravity"] = self.stores["gravity"], Store()
        item = Gravity(self, "gravity")
        try:
            if has_quantity(value):
                refuse(self, "gravity", value)
                value = converted(value, (UNITS["acceleration"],), "gravity")
            item.put(vector(value, "gravity"))
        except Exception:
            self.stores["gravity"] = old
            raise
        self.gravity_item = item
        self.changed_structure()

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of all parameters, in the order of definition (that of V)."""
        return tuple(self.space.names)

    def __getitem__(self, name: str) -> Any:
        """The handle of a name: a body, joint, element, load, marker or parameter."""
        if not isinstance(name, str):
            raise ModelError(f"model {shown(self.name)} is indexed by names, got {shown(name)}")
        if name == GROUND:
            return self.ground
        if name in self.items:
            return self.items[name]
        if name in self.space.names:
            return self.space.handle(name)
        raise not_found(f"nothing in model {shown(self.name)}", name, [*self.items, *self.space.names])

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (name in self.items or name in self.space.names)

    def value(self, address: str) -> float | np.ndarray:
        """The number(s) at an address now: a float, or an array for an address without an index.

        >>> import mbrs as mb
        >>> mb.Model("one", gravity=(0, 0, -9.81)).value("gravity[2]")
        -9.81
        """
        found: float | np.ndarray = read(self, target(self, address))
        return found

    def set(self, changes: Mapping[str, float | Vector | Matrix]) -> None:
        """Change numbers by address, keeping what was compiled: ``{"k_leg": 2e5, "payload.mass": 21.0}``.

        All changes are made or, where one is impossible, none. Numbers that a parameter drives change through the
        parameter. Setting the ``length`` of a spring gives it a natural length of its own. A new axis or orientation is
        set whole. Cost: O(changed numbers), plus one pass over the expressions where parameters change.

        Raises
        ------
        NameNotFoundError
            An unknown address; the message proposes the nearest.
        ModelError
            A value that fits the address in shape or sense no better than it would in the constructor.
        """
        if not isinstance(changes, Mapping):
            raise ModelError(f"m.set takes a mapping of addresses to values, got {shown(changes)}")
        found = [(target(self, address), value) for address, value in changes.items()]
        restructured = assign(self, [(one, self._in_si(one, value)) for one, value in found])
        if restructured:
            self.changed_structure()
        self.values_version += 1

    def _in_si(self, one: Target, value: Any) -> Any:
        """A new value of an address, texts with units converted."""
        if not has_quantity(value):
            return value
        refuse(self, one.address, value)
        if one.group is None:
            return converted(value, (self.space.unit_of(one.components[0]),), one.address)
        return converted(value, [one.group.units[i] for i in one.components], one.address)

    def file_text(self) -> str:
        """The text of the file that `save` writes."""
        from .toml import dumps

        return dumps(self)

    def save(self, path: str | Path) -> Path:
        """Save as the ending says and return the path.

        ``.toml``: `load` brings back a model with identical Tables, expressions stay expressions. Other endings are formats of other
        programs (docs/files.md); an `OmissionWarning` names by object what they cannot hold.

        Raises
        ------
        ModelError
            An unknown ending, or a model that the format cannot hold.
        """
        write = find(path, "model", "write").write
        return write(self, Path(path))  # type: ignore[misc]

    @staticmethod
    def load(path: str | Path, functions: bool = False) -> Model:
        """A model from a file of any known format, by its ending: TOML, URDF, MJCF (docs/files.md).

        Parameters
        ----------
        path
            Of a file that `save` wrote, that was written by hand, or that another program wrote.
        functions
            A file may name Python functions of time, "module:name". True: import their modules, which runs their code; do so only with
            files that you trust. By default a file is data: the names are kept as text; the model prints, changes and saves,
            and an analysis of it raises a ModelError.

        Raises
        ------
        ModelError
            An unknown ending, or what is wrong, with file, line and column.

        Warns
        -----
        OmissionWarning
            What another program's file has and a model has not, by object.
        """
        read = find(path, "model", "read").read
        return read(Path(path), functions=functions)  # type: ignore[misc,no-any-return]

    @property
    def scene(self) -> SceneGeometry:
        """Bodies, springs, joints and loads to draw, as drawn; a `ModelError` for a model without bodies."""
        return scene_from_tables(tables(self), self)

    def plot(self, *, view: ViewLike = None, names: bool | None = None, ax: Axes | None = None) -> Figure:
        """Draw the model as it was drawn, computing nothing: joints by their kind with axes, springs, dampers, gaps, ground, loads.

        Parameters
        ----------
        view
            "xy", "xz", "yz", or (azimuth, elevation) in rad of the eye; by default a flat model squarely, others from above.
        names
            Write the names of objects; by default where there are few.
        ax
            Axes of matplotlib to draw into; a figure of its own by default.

        Returns
        -------
        matplotlib.figure.Figure

        Examples
        --------
        >>> import mbrs as mb
        >>> figure = mb.examples.four_bar().plot()
        """
        from ..plot.scenes import scene

        return scene(self.scene, f"model {shown(self.name)}", view=view, names=names, ax=ax)

    def animate(self, path: str | Path | None = None, *, title: str | None = None) -> Path | Viewer:
        """The same as `plot` in space, on one self-contained page to turn and zoom, with names under the pointer.

        Returns the path of the page, or a `mbrs.view.modes.Viewer` that notebooks show. Nothing is computed.
        """
        from ..view.still import still

        return still(self.scene, path, title=title or f"Model {self.name}")

    def copy(self) -> Model:
        """An independent copy."""
        return copy.deepcopy(self)

    def __getstate__(self) -> dict[str, Any]:
        state = {k: v for k, v in self.__dict__.items() if k not in ("cache", "stores")}
        places = [(kind, i) for kind, store in self.stores.items() for i in store.driven]
        program = Program([self.stores[kind].driven[i] for kind, i in places])
        state["saved_numbers"] = {kind: store.x.tobytes() for kind, store in self.stores.items()}
        state["saved_expressions"] = (places, program.nodes, program.roots)
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        saved, (places, nodes, roots) = state.pop("saved_numbers"), state.pop("saved_expressions")
        self.__dict__.update(state)
        self.cache = {}
        self.stores = {kind: Store() for kind in STORES}
        for kind, data in saved.items():
            self.stores[kind].x.frombytes(data)
        for (kind, i), node in zip(places, rebuild_all(self.space, nodes, roots), strict=True):
            self.stores[kind].driven[i] = node

    def __dir__(self) -> list[str]:
        return [name for name in object.__dir__(self) if name in _PUBLIC or name not in _INTERNAL]

    def __repr__(self) -> str:
        counts: Sequence[tuple[int, str]] = (
            (len(self.bodies), "body"),
            (len(self.joints), "joint"),
            (len(self.elements), "spring or damper"),
            (len(self.loads), "load"),
            (len(self.space.names), "parameter"),
        )
        return f"Model({self.name!r}: " + ", ".join(counted(n, what) for n, what in counts) + ")"

    def __str__(self) -> str:
        """Tables of everything that was given; a large model's are cut."""
        from .listing import blocks

        return "\n\n".join(block.text() for block in blocks(self))

    def _repr_html_(self) -> str:
        from .listing import blocks

        return "\n".join(block.html() for block in blocks(self))
