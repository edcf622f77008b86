"""The numbers of every kind of object of a model, declared once: name, shape, role, default, flag, place.

Constructors, checks, addresses, TOML, Tables, docs/tables.md and the offsets of the Rust core (`mbrs.model.layout`) come from
these tables. A `Block` is a row of numbers in the vector x of Tables; a `Kind` is a type of object that has such a block, such as
a revolute joint. A new element is one `Kind` here, one constructor in `mbrs.model.forces` and its law in the core.
"""

from __future__ import annotations

import builtins
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

Role = Literal[
    "point", "position", "length", "angle", "direction", "orientation", "mass", "inertia", "velocity", "angular velocity",
    "acceleration", "stiffness", "damping", "force", "ratio", "offset", "integral",
    "density",
]  # fmt: skip
Form = Literal[
    "text", "numbers", "points", "direction", "pose", "law", "motion", "load", "modal body", "shape", "wind", "data", "function",
]  # fmt: skip
Check = Literal["", "positive", "not negative"]

# Units of roles that do not depend on a coordinate. Directions and orientations are varied by a rotation vector.
UNITS = {
    "point": "m",
    "position": "m",
    "length": "m",
    "angle": "rad",
    "direction": "rad",
    "orientation": "rad",
    "mass": "kg",
    "inertia": "kg m2",
    "velocity": "m/s",
    "angular velocity": "rad/s",
    "acceleration": "m/s2",
    "density": "kg/m3",
}
_FORCE = {"t": "N", "r": "N m"}
_MOTION = {"t": "m", "r": "rad"}
# What an object checks together when one of them changes.
CHECKED_ROLES = frozenset({"point", "length", "angle", "direction", "orientation", "mass", "inertia"})
COORDINATE_ROLES = frozenset({"stiffness", "damping", "force"})
IDENTITY = (1.0, 0.0, 0.0, 0.0)
SIX = ("x", "y", "z", "rx", "ry", "rz")

# A drawing less accurate than this share of its size (or angle, rad) is a mistake: with more, any two points coincide. Pinned by the
# tests of the tolerance.
LARGEST_TOLERANCE = 0.1
# Relative accuracy of a drawing where the model does not say: lengths over those of their loop, angles in radians. Larger: loops that are
# locked by a small angle move. Smaller: linkages drawn with eight digits are locked. Pinned by
# tests/invariance/test_tilted_four_bar.py (much and little tilt).
DRAWING_TOLERANCE = 1e-7
# Bits of joint_flags and element_flags.
FLAGS = {"HAS_K": 1, "HAS_C": 2, "HAS_PRELOAD": 4, "FRAME_FROM_ORIENTATION": 8, "LENGTH_GIVEN": 16}


@dataclass(frozen=True)
class Field:
    """Some numbers of an object that have one name.

    Attributes
    ----------
    name, shape
        "k", (6, 6); () is one number, "m" the number of modal coordinates of a flexible body.
    role
        What the numbers are; it decides their unit.
    default
        What Tables hold where nothing is given (one number for all, or all of them).
    flag
        Name of the bit in ``*_flags`` that is set where it is given, or "".
    listed
        "always": has an address; "given": only where it is given; "never".
    replaced_by
        A flag that takes the field out of use: ``axis`` where the frame comes from ``orientation``.
    check
        What each of its numbers must be.
    types
        The types of object that use it; () is all of them.
    note
        For docs/tables.md.
    """

    name: str
    shape: tuple[int | str, ...]
    role: Role
    default: float | tuple[float, ...] = 0.0
    flag: str = ""
    listed: Literal["always", "given", "never"] = "always"
    replaced_by: str = ""
    check: Check = ""
    types: tuple[str, ...] = ()
    note: str = ""

    @cached_property
    def bit(self) -> int:
        """The value of its flag, 0 without one."""
        return FLAGS.get(self.flag, 0)

    @cached_property
    def neutral(self) -> tuple[float, ...]:
        """The numbers where nothing is given."""
        n = size_of(self.shape)(0)
        return self.default if isinstance(self.default, tuple) else (self.default,) * n


@dataclass(frozen=True)
class Size:
    """A count of numbers: constant + linear m + quadratic m^2, with m modal coordinates."""

    constant: int = 0
    linear: int = 0
    quadratic: int = 0

    def __call__(self, m: int) -> int:
        return self.constant + self.linear * m + self.quadratic * m * m

    def __add__(self, other: Size) -> Size:
        return Size(self.constant + other.constant, self.linear + other.linear, self.quadratic + other.quadratic)


def size_of(shape: Sequence[int | str]) -> Size:
    """Number of numbers of a shape."""
    counts, power = 1, 0
    for n in shape:
        counts, power = (counts, power + 1) if isinstance(n, str) else (counts * n, power)
    return Size(*(counts if power == i else 0 for i in range(3)))


class Block:
    """Fields one after the other in x. ``block.place("mass")`` is the offset of a field."""

    def __init__(self, name: str, fields: Sequence[Field], note: str = "") -> None:
        self.name, self.note = name, note
        self.fields = {f.name: f for f in fields}
        self.starts: dict[str, Size] = {}
        self.total = Size()
        for f in fields:
            self.starts[f.name] = self.total
            self.total += size_of(f.shape)
        # without modal coordinates, as of most objects
        self._slices = {f.name: self._slice(f.name, 0) for f in fields}

    def __iter__(self) -> Iterator[Field]:
        return iter(self.fields.values())

    def place(self, name: str, m: int = 0) -> int:
        """Offset of a field from the start of the object's numbers."""
        return self.starts[name](m)

    def slice(self, name: str, m: int = 0) -> slice:
        """Slice of the numbers of a field, from the start of the object's numbers."""
        return self._slice(name, m) if m else self._slices[name]

    def _slice(self, name: str, m: int) -> builtins.slice:
        start = self.place(name, m)
        return slice(start, start + size_of(self.fields[name].shape)(m))

    def size(self, m: int = 0) -> int:
        """Number of numbers of the object."""
        return self.total(m)


@dataclass(frozen=True)
class Argument:
    """One argument of a constructor, and one key of a file."""

    name: str
    form: Form = "numbers"
    required: bool = False


@dataclass(frozen=True)
class Kind:
    """A type of object.

    Attributes
    ----------
    heading
        Its table in a file and the stem of its keys in Tables: "joint".
    type
        "revolute"; the method of `Model` that makes it.
    code
        In the column ``*_type`` of Tables.
    block
        Its numbers.
    arguments
        Of its constructor, in order; a file has them in the order of ``written``.
    free, coordinates
        Its free coordinates or, of an element, those on which it acts: "t" along, "r" about; and their names.
    points
        How many points ``at`` may be: "one", "two", "either".
    axes
        Directions without which the object is not defined.
    nonholonomic
        It constrains velocities.
    """

    heading: str
    type: str
    block: Block
    arguments: tuple[Argument, ...]
    code: int = 0
    free: str = ""
    coordinates: tuple[str, ...] = ()
    points: Literal["one", "two", "either"] = "one"
    axes: tuple[str, ...] = ()
    nonholonomic: bool = False

    @cached_property
    def fields(self) -> tuple[Field, ...]:
        """Fields of the block that this type uses."""
        return tuple(f for f in self.block if not f.types or self.type in f.types)

    @cached_property
    def checked(self) -> tuple[tuple[Field, slice], ...]:
        """Fields with a rule of their own, and where they are."""
        ruled = (f for f in self.fields if f.check or f.role in ("direction", "orientation"))
        return tuple((f, self.block.slice(f.name)) for f in ruled)

    @property
    def known(self) -> tuple[str, ...]:
        """Names of all arguments."""
        return tuple(a.name for a in self.arguments)

    @cached_property
    def required(self) -> tuple[str, ...]:
        """Names of the arguments that must be given."""
        return tuple(a.name for a in self.arguments if a.required)

    def form(self, name: str) -> Form:
        """Form of an argument."""
        return next(a.form for a in self.arguments if a.name == name)

    def units(self, f: Field, shape: tuple[int, ...]) -> tuple[str, ...]:
        """Unit of each number of a field that was given in some shape."""
        if f.role not in COORDINATE_ROLES:
            return (UNITS.get(f.role, ""),) * size_of(f.shape)(0)
        n = len(self.free)
        if shape == (n, n) and len(f.shape) == 2:
            return tuple(coordinate_unit(f.role, a, b) for a in self.free for b in self.free)
        return tuple(coordinate_unit(f.role, a, a) for a in self.free)


def coordinate_unit(role: str, row: str, column: str) -> str:
    """Unit of a force on a coordinate "t" or "r", or of its derivative by (the rate of) another."""
    if role == "force":
        return _FORCE[row]
    return f"{_FORCE[row]}{' s' if role == 'damping' else ''}/{_MOTION[column]}"


def _arguments(required: str, optional: str = "", **forms: Form) -> tuple[Argument, ...]:
    texts = {"name", "a", "b", "body", "joint", "first", "second", "frame", "on", "coordinate"}
    texts |= {"first_coordinate", "second_coordinate", "nodes"}
    known: dict[str, Form] = {
        "axis": "direction",
        "axis2": "direction",
        "law": "law",
        "pose": "pose",
        "shape": "shape",
        **forms,
    }

    def one(name: str, must: bool) -> Argument:
        return Argument(name, "text" if name in texts else known.get(name, "numbers"), must)

    return tuple([one(n, True) for n in required.split()] + [one(n, False) for n in optional.split()])


# --- bodies, markers, first guesses, gravity ------------------------------------------------------------------

_AT = Field("at", (3,), "point", note="world, as drawn")
_TURN = Field("orientation", (4,), "orientation", IDENTITY)
_BODY = Block(
    "body",
    [
        Field("at", (3,), "point", note="origin, world"),
        _TURN,
        Field("com", (3,), "position", note="centre of mass from the origin, body axes"),
        Field("mass", (), "mass"),
        Field(
            "inertia", (6,), "inertia", note="xx yy zz xy xz yz about the centre of mass, body axes, sign of the tensor"
        ),
        Field("velocity", (3,), "velocity", note="of the origin, world"),
        Field("angular_velocity", (3,), "angular velocity", note="world"),
    ],
)
_FRAMED = "at orientation pose velocity angular_velocity"
BODY = Kind(
    "body", "body", _BODY, _arguments("name mass inertia", "at com orientation pose velocity angular_velocity shape")
)
FLEXIBLE_BODY = Kind(
    "body",
    "flexible_body",
    _BODY,
    _arguments("name modal_body", f"{_FRAMED} modes nodes shape", modal_body="modal body"),
)
MARKER = Kind("marker", "marker", Block("marker", [_AT, _TURN]), _arguments("name body", "at orientation"))
POSE = Kind(
    "pose",
    "pose",
    Block("pose", [_AT, _TURN], "first guesses for assembly, of bodies that were given one (`pose=`)"),
    (),
)
GRAVITY = Kind("gravity", "gravity", Block("gravity", [Field("gravity", (3,), "acceleration", note="world")]), ())

# --- joints ---------------------------------------------------------------------------------------------------

_ENDS = (
    Field("at_a", (3,), "point", note="world, as drawn, fixed in a"),
    Field("at_b", (3,), "point", note="fixed in b"),
)
_FRAME = "FRAME_FROM_ORIENTATION"
_JOINT = Block(
    "joint",
    [
        *_ENDS,
        Field(
            "axis", (3,), "direction", (0.0, 0.0, 1.0), replaced_by=_FRAME,
            types=(
                "revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "free", "knife_edge", "rolling_disc", "screw",
                "point_on_line",
            ),
        ),
        Field("axis2", (3,), "direction", replaced_by=_FRAME, types=("universal", "rolling_disc")),
        Field("orientation", (4,), "orientation", IDENTITY, flag=_FRAME, listed="given"),
        Field("k", (6,), "stiffness", flag="HAS_K", listed="given", note="of the free coordinates, in their order"),
        Field("c", (6,), "damping", flag="HAS_C", listed="given"),
        Field("preload", (6,), "force", flag="HAS_PRELOAD", listed="given"),
        Field("length", (), "length", flag="LENGTH_GIVEN", check="not negative", types=("distance",)),
        Field("radius", (), "length", check="positive", types=("rolling_disc",)),
        Field("pitch", (), "length", types=("screw",), note="m per radian, negative: left-handed"),
    ],
)  # fmt: skip
_SPRUNG = "k c preload law"


def _joint(code: int, type_: str, free: str, coordinates: str, optional: str, **more: object) -> Kind:
    given = _arguments("name a b", optional, at="points")
    return Kind(
        "joint",
        type_,
        _JOINT,
        given,
        code,
        free,
        tuple(coordinates.split()),
        **{"points": "either", **more},  # type: ignore[arg-type]
    )


_Z = ("axis",)
JOINTS = {
    kind.type: kind
    for kind in (
        _joint(0, "fixed", "", "", "at orientation"),
        _joint(1, "revolute", "r", "rz", f"at axis orientation {_SPRUNG}", axes=_Z),
        _joint(2, "prismatic", "t", "z", f"at axis orientation {_SPRUNG}", axes=_Z),
        _joint(3, "cylindrical", "tr", "z rz", f"at axis orientation {_SPRUNG}", axes=_Z),
        _joint(4, "universal", "rr", "rz rx", f"at axis axis2 orientation {_SPRUNG}", axes=("axis", "axis2")),
        _joint(5, "spherical", "rrr", "rx ry rz", f"at axis orientation {_SPRUNG}"),
        _joint(6, "planar", "ttr", "x y rz", f"at axis orientation {_SPRUNG}", axes=_Z),
        _joint(7, "free", "tttrrr", "x y z rx ry rz", f"at axis orientation {_SPRUNG}"),
        _joint(8, "distance", "", "", "at length", points="two"),
        _joint(9, "knife_edge", "", "", "at axis orientation", axes=_Z, nonholonomic=True),
        _joint(
            10,
            "rolling_disc",
            "",
            "",
            "at axis axis2 orientation radius",
            points="two",
            axes=("axis", "axis2"),
            nonholonomic=True,
        ),
        _joint(11, "screw", "r", "rz", f"at axis orientation pitch {_SPRUNG}", axes=_Z),
        _joint(12, "point_on_line", "t", "z", f"at axis orientation {_SPRUNG}", axes=_Z),
    )
}

# --- elements -------------------------------------------------------------------------------------------------


def _coefficients(shape: tuple[int, ...], preload: tuple[int, ...]) -> tuple[Field, Field, Field]:
    note = "6 x 6, row-major" if shape else ""
    return (
        Field("k", shape, "stiffness", flag="HAS_K", listed="given", note=note),
        Field("c", shape, "damping", flag="HAS_C", listed="given"),
        Field("preload", preload, "force", flag="HAS_PRELOAD", listed="given"),
    )


_K, _C, _PRELOAD = _coefficients((), ())
_TENSION = Field(
    "length", (), "length", flag="LENGTH_GIVEN", check="not negative", note="natural; else added to the drawn one"
)
ELEMENTS = {
    kind.type: kind
    for kind in (
        Kind(
            "element",
            "spring_damper",
            Block("spring_damper", [*_ENDS, _K, _C, _TENSION, _PRELOAD]),
            _arguments("name a b", "at k c length preload law", at="points"),
            0,
            "t",
            ("u",),
            "two",
        ),
        Kind(
            "element",
            "bushing",
            Block("bushing", [*_ENDS, _TURN, *_coefficients((6, 6), (6,))]),
            _arguments("name a b", "at k c orientation preload law", at="points"),
            1,
            "tttrrr",
            SIX,
            "either",
        ),
        Kind(
            "element",
            "torsion",
            Block(
                "torsion",
                [
                    _AT,
                    Field("axis", (3,), "direction"),
                    _K,
                    _C,
                    Field("angle", (), "angle", note="unstretched"),
                    _PRELOAD,
                ],
            ),
            _arguments("name a b axis", "at k c angle preload law", at="points"),
            2,
            "r",
            ("angle",),
            axes=_Z,
        ),
    )
}

# --- loads, couplers, constraints -----------------------------------------------------------------------------

_LOAD = Block("load", [Field("at", (3,), "point", types=("force",)), Field("value", (3,), "force")])
LOADS = {
    kind.type: kind
    for kind in (
        Kind("load", "force", _LOAD, _arguments("name body value", "at frame on", value="load"), 0, "ttt", SIX[:3]),
        Kind("load", "torque", _LOAD, _arguments("name body value", "frame on", value="load"), 1, "rrr", SIX[3:]),
        Kind("load", "modal_force", _LOAD, _arguments("name body mode value", value="load"), 2),
    )
}
LOAD_FRAMES = {"world": 0, "body": 1}
DRIVE = Kind("drive", "drive", Block("drive", []), _arguments("name joint motion", "coordinate", motion="motion"))
COUPLER = Kind(
    "coupler",
    "coupler",
    Block("coupler", [Field("ratio", (), "ratio"), Field("offset", (), "offset")]),
    _arguments("name first second ratio", "first_coordinate second_coordinate offset"),
)
CONSTRAINT = Kind(
    "constraint",
    "constraint",
    Block("constraint", []),
    _arguments("name fun motions", "derivatives", fun="function", motions="data", derivatives="motion"),
)
VELOCITY_CONSTRAINT = Kind(
    "velocity_constraint",
    "velocity_constraint",
    Block("velocity_constraint", []),
    _arguments("name fun motions", "d derivatives", fun="function", motions="data", d="motion", derivatives="motion"),
)

# --- flexible bodies ------------------------------------------------------------------------------------------

SHAPES = Kind(
    "flexible",
    "flexible",
    Block(
        "flexible",
        [
            Field("S", (3, "m"), "integral", listed="never"),
            Field("P1", ("m", 3, 3), "integral", listed="never", note="k, row, column"),
            Field("P2", ("m", "m", 3, 3), "integral", listed="never", note="k, l, row, column"),
            Field("K", ("m", "m"), "integral"),
            Field("C", ("m", "m"), "integral"),
            Field("KG", (12, "m", "m"), "integral", listed="never"),
        ],
        "integrals of the shapes of m modal coordinates, about the body's origin, body axes",
    ),
    (),
)
NODE = Block(
    "node",
    [
        Field("position", (3,), "position", note="body axes, from the origin"),
        Field("shape", (6, "m"), "integral", note="displacement, rotation"),
    ],
)
# Behind the numbers of each node where a node of the body has some.
QUADRATIC = Block(
    "quadratic",
    [Field("displacement", (3, "m", "m"), "integral", note="psi in phi_k q_k + psi_kl q_k q_l / 2, body axes")],
    "second-order displacement of a node (`flexible_node_quadratic`)",
)
# Numbers of a body that the integrals of its shapes depend on: they are not varied alone.
FIXED_BY_SHAPES = ("com", "mass", "inertia")

# --- laws and motions: lists of numbers of any length ---------------------------------------------------------


@dataclass(frozen=True)
class LawKind:
    """A force law of one coordinate: its codes in Tables, and what its force depends on.

    ``rate_codes``: those of its codes whose force depends on the rate. ``state``: "map" where the state follows the displacement
    whatever the time between (sliders), "rate" where z' = g(u, u', z). ``polynomial`` in u and u'. ``smooth``: without kinks.
    ``phase``: the force follows the phase of the excitation.
    """

    name: str
    codes: tuple[int, ...]
    numbers: str
    effect: Literal["", "friction", "contact"] = ""
    rate_codes: tuple[int, ...] = ()
    state: Literal["", "map", "rate"] = ""
    polynomial: bool = False
    smooth: bool = True
    phase: bool = False


LAWS = {
    law.name: law
    for law in (
        LawKind("Cubic", (0,), "k3", polynomial=True),
        LawKind("Polynomial1D", (1, 2), "c_0, c_1, ... of u; code 2: as many of u'", rate_codes=(2,), polynomial=True),
        LawKind("Gap", (3, 4), "k, gap, smoothing; code 4: on both sides", "contact", smooth=False),
        LawKind("CoulombTanh", (5,), "force_limit, v_ref", "friction", (5,)),
        LawKind("Hertz", (6,), "k, exponent, gap", "contact", smooth=False),
        LawKind("TableLaw", (7,), "u_i, then f_i", smooth=False),
        LawKind("VanDerPol", (8,), "mu", rate_codes=(8,), polynomial=True),
        LawKind("Jenkins", (9,), "k, f_slip", "friction", state="map", smooth=False),
        LawKind("Iwan", (10,), "k_i, f_i in turn", "friction", state="map", smooth=False),
        LawKind("VaryingStiffness", (11,), "k, order, phase", polynomial=True, phase=True),
        LawKind("Maxwell", (12,), "k_i, tau_i in turn", rate_codes=(12,), state="rate"),
        LawKind("BoucWen", (13,), "k, alpha, beta, gamma, n", rate_codes=(13,), state="rate", smooth=False),
        LawKind("LuGre", (14,), "f_c, f_s, v_s, s0, s1, s2", "friction", rate_codes=(14,), state="rate", smooth=False),
    )
}
# A function is a program of its own, in other columns of the Tables; it has no code.
FUNCTION_LAW = LawKind("FunctionLaw", (), "the expressions of parameters that it uses", smooth=False)
LAW_OF_CODE = {code: law for law in LAWS.values() for code in law.codes}


@dataclass(frozen=True)
class MotionKind:
    """A function of time: its code in Tables and its groups of numbers; "*" marks a list of any length."""

    name: str
    code: int
    groups: tuple[str, ...]
    note: str = ""


RAMP = MotionKind("Ramp", 0, ("rate", "offset", "start"))
SINE = MotionKind("Sine", 1, ("amplitude", "omega", "phase", "offset"))
SINE_HZ = MotionKind("Sine", 2, ("amplitude", "frequency", "phase", "offset"), "frequency in Hz")
POLYNOMIAL = MotionKind("Polynomial", 3, ("coefficients*",), "c_0, c_1, ...")
CUBIC_TABLE = MotionKind("Table", 4, ("t*", "value*"), "natural cubic spline")
LINEAR_TABLE = MotionKind("Table", 5, ("t*", "value*"), "straight lines")
FUNCTION = MotionKind("function", 6, (), "`functions[motion_function]`, from its output `motion_output` on")
MOTIONS = {m.code: m for m in (RAMP, SINE, SINE_HZ, POLYNOMIAL, CUBIC_TABLE, LINEAR_TABLE, FUNCTION)}


def motion_unit(name: str, unit: str) -> str:
    """Unit of a group of numbers of a motion of something in ``unit``."""
    fixed = {"start": "s", "t": "s", "omega": "rad/s", "frequency": "Hz", "phase": "rad"}
    return fixed.get(name, f"{unit}/s" if name == "rate" and unit else "" if name == "coefficients" else unit)
