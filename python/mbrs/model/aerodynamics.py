"""Air around the blades of a model: wind, sections with their polars, and how velocities are induced."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from .._lib.monotone import cubic_pieces
from .._lib.rotations import quaternion_matrix
from .air_schema import AIR, SECTION, UNSTEADY
from .aliases import Axis, Scalar
from .attached_lift import attached_line, lift_at
from .bodies import Body
from .book import Book, Group, Item
from .flexible import FlexibleBody
from .names import not_found, problem, shown
from .numbers import Number, scalar
from .numbers import axis as direction
from .numbers import numbers as floats
from .schema import Kind
from .section_loads import interpolated, line_of

INFLOWS = ("none", "bem", "dynamic-inflow", "prescribed-wake", "free-wake")
# Those whose induced velocities advance with steps of their own.
STEPPED = INFLOWS[3:]
COUPLINGS = ("loose", "tight")
# What a blade is as plain data; (n,) lists but for the first five.
BLADE = (
    "body", "root", "first", "last", "line", "place", "width", "chord", "twist", "aerodynamic_center", "polar", "second_polar", "share",
)  # fmt: skip
_SINGLE = BLADE[:5]
_POLAR = ("name", "angle", "lift", "drag", "moment", "thickness", "interpolation")
# A section may lie beyond the end of a body's line by this share of its length: rounding of places that were computed from both
# ends. Larger: loads beside the body. Smaller: sections at the tip are refused. Pinned by the tests of bad input.
_BEYOND = 1e-9


class SteadyWind(Protocol):
    """A wind of `mbrs.aero.wind`."""

    def velocity(self, point: np.ndarray, /) -> np.ndarray:
        """(..., 3) m/s at points (..., 3) m."""


class Aerodynamics(Item):
    """Handle of the air around blades; see `Model.aerodynamics`."""

    __slots__ = ("attached", "blades", "coupling", "inflow", "options", "polars", "sections", "stalls")
    store = "air"
    kind = "aerodynamics"
    inflow: str
    coupling: str
    attached: bool
    stalls: bool
    blades: list[dict[str, Any]]
    polars: list[dict[str, Any]]
    options: dict[str, Any]
    sections: Sections

    @property
    def table(self) -> Kind:
        return AIR

    def counts(self) -> list[int]:
        """Sections of each blade."""
        return [len(blade["place"]) for blade in self.blades]

    def blade(self, name: str) -> int:
        """Number of the blade that a body carries."""
        bodies = [blade["body"] for blade in self.blades]
        if name not in bodies:
            raise not_found(f"{self.name}: no blade", name, bodies)
        return bodies.index(name)

    def fields(self) -> dict[str, Group]:
        momentum = self.inflow in ("bem", "dynamic-inflow")
        sheared = self.values("shear")[0] != 0.0
        unused = {"axis"} if not momentum else set()
        unused |= set() if sheared else {"reference_height", "ground"}
        unused |= set() if self.stalls else {"stall"}
        return {name: group for name, group in super().fields().items() if name not in unused}

    def unsteady(self) -> int:
        """Bits of the laws with states that act at its sections."""
        acting = {"inflow": self.inflow == "dynamic-inflow", "attached": self.attached, "stall": self.stalls}
        return sum(UNSTEADY[name] for name, acts in acting.items() if acts)

    def described(self) -> dict[str, Any]:
        """The arguments that would make it again."""
        wind: dict[str, Any] = {"speed": self.entries("speed")[0], "direction": self.entries("direction")}
        if self.values("shear")[0] != 0.0:
            wind |= {name: self.entries(name)[0] for name in ("shear", "reference_height", "ground")}
            wind["up"] = self.entries("up")
        table: dict[str, Any] = {"name": self.name, "density": self.entries("density")[0], "wind": wind}
        table |= {"inflow": self.inflow, "coupling": self.coupling, "axis": self.entries("axis")}
        if repr(self.entries("pitch")[0]) != "0.0":
            table["pitch"] = self.entries("pitch")[0]
        if self.attached:
            table["attached"] = True
        if self.stalls:
            table["stall"] = self.entries("stall")[0]
        if self.options:
            table["options"] = self.options
        return {**table, "blades": self.blades, "polars": self.polars}


class Sections(Item):
    """The numbers of all sections of an `Aerodynamics`, blade by blade."""

    __slots__ = ("places",)
    places: list[tuple[int, int]]  # body and node of each
    store = "section"
    kind = "sections"

    @property
    def size(self) -> int:
        return len(self.places) * SECTION.size()

    def check(self, values: Sequence[float]) -> None:
        """`aerodynamics` has checked them."""

    def _range(self, name: str) -> tuple[int, int]:
        return self.start, self.size


def polar_tables(
    airs: Sequence[Aerodynamics],
) -> tuple[dict[tuple[int, str], int], list[list[float]], list[list[float]]]:
    """Numbers of the polars of all airs by air and name; their angles; their cubics, (n - 1, 4, 3) each as one row."""
    number: dict[tuple[int, str], int] = {}
    angles: list[list[float]] = []
    pieces: list[list[float]] = []
    for air in airs:
        for polar in air.polars:
            number[air.index, polar["name"]] = len(angles)
            a = np.array(polar["angle"])
            y = np.stack([polar["lift"], polar["drag"], polar["moment"]], axis=1)
            circle = bool(a[0] == -np.pi and a[-1] == np.pi)
            cubics = cubic_pieces(a, y, polar.get("interpolation", "pchip"), circle)
            angles.append(a.tolist())
            pieces.append(np.ascontiguousarray(cubics.transpose(1, 0, 2)).ravel().tolist())
    return number, angles, pieces


def with_inflow(model: Any, inflow: str) -> Any:
    """A copy of a model whose air has another inflow wherever it has a later one of `INFLOWS`, without the options of that one."""
    made = model.copy()
    for air in made.airs:
        if INFLOWS.index(air.inflow) > INFLOWS.index(inflow):
            air.inflow, air.options = inflow, {}
    made.changed_structure()
    return made


# --- from arguments to numbers -----


def _plain_blades(name: str, blades: Any, polars: Any) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Blades and polars as plain data, from blades of `mbrs.aero` or from a file."""
    if not isinstance(blades, Sequence) or isinstance(blades, str) or not blades:
        raise problem(name + ".blades", f"must be a list of what mb.aero.blade gives, got {shown(blades)}")
    known = [dict(p) for p in polars or ()]
    made = []
    for blade in blades:
        plain = getattr(blade, "plain", None)
        if plain is not None:
            made.append(plain(known))
        elif isinstance(blade, Mapping):
            made.append(dict(blade))
        else:
            raise problem(name + ".blades", f"must be what mb.aero.blade gives, got {shown(blade)}")
    for polar in known:
        if missing := [key for key in _POLAR[:5] if key not in polar]:
            raise problem(name + ".polars", f"lack {', '.join(missing)}")
    for blade in made:
        _check_blade(name, blade, {p["name"] for p in known})
    return made, known


def _check_blade(name: str, blade: dict[str, Any], polars: set[str]) -> None:
    what = f"{name}.blades"
    if missing := [key for key in BLADE if key not in blade]:
        raise problem(what, f"lack {', '.join(missing)}")
    if not isinstance(blade["body"], str):
        raise problem(what, "name no body that carries them; give body= to mb.aero.blade")
    n = len(blade["place"])
    for key in BLADE[5:]:
        if len(blade[key]) != n:
            raise problem(what, f"have {len(blade[key])} entries of {key} for {n} sections")
    for key in ("polar", "second_polar"):
        if unknown := [p for p in blade[key] if p not in polars]:
            raise problem(what, f"refer to a polar {unknown[0]!r} that is not among the polars")
    arrays = [np.asarray(blade[key], dtype=float) for key in (*_SINGLE[1:], *BLADE[5:10], "share")]
    if not all(np.all(np.isfinite(a)) for a in arrays):
        raise problem(what, "hold numbers that are not finite")
    for key in ("width", "chord"):
        if np.any(np.asarray(blade[key]) <= 0.0):
            k = int(np.argmax(np.asarray(blade[key]) <= 0.0))
            raise problem(
                what, f"of {blade['body']!r} have the {key} {blade[key][k]:g} m at section {k + 1}; it must be positive"
            )
    if np.any(np.diff(blade["place"]) <= 0.0):
        k = int(np.argmax(np.diff(blade["place"]) <= 0.0)) + 1
        raise problem(
            what,
            f"of {blade['body']!r} have sections whose place does not increase: section {k + 1} is at {blade['place'][k]:g} m",
        )


def _place(air: Aerodynamics, owner: Body, blade: dict[str, Any]) -> tuple[list[int], np.ndarray]:
    """Nodes of a flexible body at the sections (-1 of a rigid one), and their places (n, 3) in body axes."""
    along = np.array(blade["place"]) - blade["root"]
    if not isinstance(owner, FlexibleBody):
        return [-1] * len(along), np.stack([along, 0 * along, 0 * along], axis=1)
    distance, points = line_of(f"{air.name}.blades", owner.modal)
    length = distance[-1]
    if along[0] < -_BEYOND * length or along[-1] > (1.0 + _BEYOND) * length:
        raise problem(
            f"{air.name}.blades",
            f"have sections from {along[0]:.6g} to {along[-1]:.6g} m of the body {shown(owner.name)}, "
            f"whose line goes from 0 to {length:.6g} m; "
            "give mb.aero.blade(root=), the distance of the body's origin from the axis, or a body that reaches the stations",
        )
    where = np.clip(along, 0.0, length)
    shapes = interpolated(distance, owner.modal.line_shape, where)
    second = interpolated(distance, owner.modal.line_quadratic, where)
    points = interpolated(distance, points, where)
    names = [f"{air.name}{i + 1}" for i in range(len(along))]
    return owner.add_nodes(names, points, shapes, second), points


def _numbers(blade: dict[str, Any], at: np.ndarray, n_blades: int, cone: float) -> np.ndarray:
    """(n, size) numbers of sections; ``cone`` is the cosine of the blade's angle to the rotor's plane."""
    chord, place = np.array(blade["chord"]), np.array(blade["place"])
    out = np.zeros((len(chord), SECTION.size()))

    def put(field: str, value: Any) -> None:
        out[:, SECTION.slice(field)] = np.reshape(value, (len(chord), -1))

    radius = place * cone
    put("position", at)
    put("width", blade["width"])
    put("chord", chord)
    put("twist", blade["twist"])
    put("centre", (blade["line"] - np.array(blade["aerodynamic_center"])) * chord)
    put("rear", (blade["line"] - 0.75) * chord)
    put("share", blade["share"])
    put("solidity", n_blades * chord / (2.0 * np.pi * radius) if np.all(radius > 0.0) else 0.0 * chord)
    tip = 0.5 * n_blades * (blade["last"] - place) / place if np.all(place > 0.0) else 0.0 * place
    hub = 0.5 * n_blades * (place - blade["first"]) / blade["first"] if blade["first"] > 0.0 else 0.0 * place
    put("loss", np.stack([tip, hub], axis=1))
    put("radius", np.full(len(place), blade["last"] * cone))
    put("span", place / blade["last"] if blade["last"] > 0.0 else 0.0 * place)
    return out


def _attached_lines(name: str, blade: dict[str, Any], polars: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """(n, 2) slope and angle of no lift of each section in attached flow."""
    table = {p["name"]: p for p in polars}
    share = np.array(blade["share"])

    def lift(angle: np.ndarray) -> np.ndarray:
        first, second = (
            np.stack([lift_at(table[p], angle[:, k]) for k, p in enumerate(blade[key])], axis=1)
            for key in ("polar", "second_polar")
        )
        return np.asarray(first + share * (second - first))

    return np.stack(attached_line(lift, len(share)), axis=1)


def _wind(name: str, wind: Any) -> list[Number]:
    """speed, shear, reference height, direction, up, ground."""
    where = name + ".wind"
    keys = ("speed", "direction", "shear", "reference_height", "up", "ground")
    if isinstance(wind, Mapping):
        if unknown := [key for key in wind if key not in keys]:
            raise problem(where, f"has no entry {shown(unknown[0])}; known: {', '.join(keys)}")
        given = dict(wind)
    elif all(hasattr(wind, key) for key in keys):
        given = {key: getattr(wind, key) for key in keys}
    else:
        raise problem(where, f"must be what mb.aero.wind gives, got {shown(wind)}")
    shear, height = given.get("shear", 0.0), given.get("reference_height")
    if height is None and repr(shear) not in ("0", "0.0"):
        raise problem(where, "has shear and no reference_height, the height in m at which the wind has its speed")
    return [
        scalar(given.get("speed"), where + ".speed"),
        scalar(shear, where + ".shear"),
        scalar(1.0 if height is None else height, where + ".reference_height"),
        *direction(given.get("direction", "x"), where + ".direction"),
        *direction(given.get("up", "z"), where + ".up"),
        scalar(given.get("ground", 0.0), where + ".ground"),
    ]


def aerodynamics(
    self: Book,
    name: str,
    blades: Sequence[Any],
    wind: Mapping[str, Any] | SteadyWind,
    density: Scalar = 1.225,
    inflow: str = "none",
    coupling: str = "loose",
    *,
    axis: Axis | None = None,
    pitch: Scalar = 0.0,
    attached: bool = False,
    stall: Scalar = 0.0,
    polars: Sequence[Mapping[str, Any]] | None = None,
    options: Mapping[str, Any] | None = None,
) -> Aerodynamics:
    """Let the air act upon blades: forces of sections that move and bend with their bodies.

        F = rho c b |u| (cl lift + cd drag) / 2,   u = wind + induced - velocity at three quarters of the chord

    Each strip of a blade is a point of its body; on a flexible body it moves with the body's shapes, and its force comes to the modal
    coordinates by the transpose of what gives its velocity, so that the power of the coordinates is that of the strips to rounding.

    Parameters
    ----------
    name
        Unique in the model.
    blades
        What `mbrs.aero.blade` gives, each with ``body=``. Body axes: x outwards, y to the leading edge of an untwisted section, z to the
        side that lift pushes to (down the wind on a turbine).
    wind
        What `mbrs.aero.wind` gives, or a table of its arguments; height counts from its ground.
    density
        kg/m^3.
    inflow
        Where the induced velocity comes from. "none"; "bem": blade elements and momentum, solved at every section whenever forces are
        evaluated, for blades as drawn about ``axis``; "dynamic-inflow": the same behind two lags, four states z of each section,

            t1 Y' = .4 W - Y,   t2 V' = Y + .6 W - V,   t1 = 1.1 / (1 - 1.3 a) R / U,   t2 = (.39 - .26 (r/R)^2) t1

        W is the velocity that balances, V the one that acts, along the annulus's axis and around it; U is the wind along that axis.
    coupling
        Of wakes with the structure: "loose" or "tight".
    axis
        World, down the wind: axis of the rotor's annuli as drawn; the wind's direction by default.
    pitch
        rad, added to the twist of all sections.
    attached
        Lift lags behind the angle of attack in attached flow, two states z_i of each section (Jones' form of Wagner's function),

            z_i' = 2 b_i |u| / c (w - z_i),   w_eff = w + sum A_i (z_i - w)

        w is the wind across the chord, w_eff what lift and drag see; a section that turns about the span carries air along, the force
        pi rho c^2 b |u| w_span / 4 at three quarters of the chord. Not beside wakes, which hold the vorticity that is shed.
    stall
        Oeye's dynamic stall, one state of each section: chords of the flow over which the attached part f of the chord lags behind the
        one of the static polar, as ``lag`` of `mbrs.aero.dynamic_stall` (4 is usual); 0 for static polars.
    polars
        Tables that ``blades`` as plain data refer to; a file has them.
    options
        Of wakes: those of `mbrs.aero.rotor_wake`.

    Returns
    -------
    Aerodynamics
        ``air.density``, ``air.speed``, ``air.pitch`` and the others have addresses.

    Raises
    ------
    ModelError
        Blades without a body, sections beyond it, nan, a negative wind; ``attached`` beside a wake.

    Notes
    -----
    States are part of the motion, of every time scheme, and of linear analyses (`mb.modes`, `mb.frf`, `mb.response`); equilibria and
    K, C, G, N of a linearisation hold them at rest. S. Oeye, in H. Snel and J. G. Schepers, ECN-C--94-107 (1995), and ETSU-N-118 (1991);
    R. T. Jones, NACA Report 681 (1940); T. Theodorsen, NACA Report 496 (1935); M. O. L. Hansen, "Aerodynamics of Wind Turbines".

    Neglected: flow along the span, the mass of air that a section accelerates, and how annuli change as blades
    deflect (radius, solidity and losses are those drawn).
    Cost O(sections) per evaluation, twelve times that with a tangent.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> m = mb.Model("vane"); arm = m.body("arm", mass=2.0, inertia=(0.1, 1.0, 1.0), at=(0, 0, 0))
    >>> hinge = m.revolute("hinge", m.ground, arm, at=(0, 0, 0), axis="x")
    >>> a = np.radians([-180.0, -90.0, 0.0, 90.0, 180.0])
    >>> flat = mb.aero.polar(a, np.sin(2 * a), 0.02 + np.sin(a) ** 2, name="flat")
    >>> vane = mb.aero.blade([0.2, 1.0], chord=0.2, twist=0.3, polar=flat, body="arm", sections=4)
    >>> m.aerodynamics("air", [vane], wind={"speed": 5.0, "direction": "z"})
    <aerodynamics 'air' of 'vane'>
    """
    air = Aerodynamics(self, self.new_name("aerodynamics", name))
    _check_ways(name, inflow, coupling, options, attached)
    air.inflow, air.coupling, air.options = inflow, coupling, dict(options or {})
    air.attached, air.stalls = attached, repr(stall) not in ("0", "0.0")
    air.blades, air.polars = _plain_blades(name, blades, polars)
    speed, shear, height, *vectors, ground = _wind(name, wind)
    along = vectors[:3] if axis is None else direction(axis, f"{name}.axis")
    values = [
        scalar(density, name + ".density"), speed, shear, height, *vectors, *along, scalar(pitch, name + ".pitch"),
        ground, scalar(stall, name + ".stall") if air.stalls else 4.0,
    ]  # fmt: skip
    owners = [self.find_body(blade["body"], f"{name}.blades") for blade in air.blades]
    if any(i < 0 for i in owners):
        raise problem(f"{name}.blades", "must be on bodies, not on ground")
    air.check(air.evaluated(values))
    unit = np.array(floats(along)) / np.linalg.norm(floats(along))
    placed = [_sections_of(air, name, blade, i, unit) for blade, i in zip(air.blades, owners, strict=True)]
    air.put(values)
    air.sections = Sections(self, name)
    air.sections.places = [place for places, _ in placed for place in places]
    air.sections.put(np.concatenate([rows for _, rows in placed]).ravel().tolist())
    self.register(air, self.airs)
    return air


def _check_ways(name: str, inflow: str, coupling: str, options: Any, attached: Any) -> None:
    """Inflow, coupling and attached flow that exist and go together."""
    for what, value, known in (("inflow", inflow, INFLOWS), ("coupling", coupling, COUPLINGS)):
        if value not in known:
            raise problem(f"{name}.{what}", f"must be one of {', '.join(known)}, got {shown(value)}")
    if options and inflow not in STEPPED:
        raise problem(
            f"{name}.options",
            f"belong to inflows with steps of their own, got {', '.join(options)} with {shown(inflow)}",
        )
    if not isinstance(attached, bool):
        raise problem(f"{name}.attached", f"must be True or False, got {shown(attached)}")
    if attached and inflow in STEPPED:
        raise problem(
            f"{name}.attached", f"must be False beside the wake {shown(inflow)}, which holds the vorticity that is shed"
        )


def _sections_of(
    air: Aerodynamics, name: str, blade: Any, i: int, axis: np.ndarray
) -> tuple[list[tuple[int, int]], np.ndarray]:
    """Body and node of each section of a blade on body ``i``, and the sections' numbers."""
    owner = air.model.bodies[i]
    nodes, at = _place(air, owner, blade)
    outwards = quaternion_matrix(np.array(owner.values("orientation")))[:, 0]
    cone = float(np.sqrt(1.0 - (outwards @ axis) ** 2))
    rows = _numbers(blade, at, len(air.blades), cone)
    if air.inflow == "dynamic-inflow" and not (cone > 0.0 and blade["place"][0] > 0.0):
        raise problem(
            f"{name}.blades", f"need sections outwards from the axis for annuli; those of {blade['body']!r} are not"
        )
    if air.stalls:
        lines = _attached_lines(name, blade, air.polars)
        rows[:, SECTION.slice("slope")], rows[:, SECTION.slice("zero")] = lines[:, :1], lines[:, 1:]
    return [(i, node) for node in nodes], rows
