"""Tapered, twisted beams as modal bodies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.checks import choice, count, flag, names, shown, sized_array
from ..errors import ModelError
from ._elements import Mesh, Section, mesh
from ._integrals import inertial_stiffness, rigid_body, second_order, shape_integrals, turned_stiffness
from ._parameters import Channel, channels, driven, plain, stretched_nodes
from ._reduction import reduced_shapes
from .modal_body import ModalBody

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from .aliases import Along

__all__ = ["beam", "modal_damping"]

Array = np.ndarray
THEORIES = ("euler-bernoulli", "timoshenko")
# Places along a beam that differ by less of its length are one. Larger: short parts are left out. Smaller: elements of no length.
_SAME_PLACE = 1e-9
# Smallest stiffness or mass, over the largest, by which the taper of an interval is measured. Larger: tips have too few elements. Smaller:
# pointed ones have elements without end.
_POINTED = 1e-3
# Shapes of a finer beam beyond twice those of the beam: one in both planes of bending, a torsion and a stretching, for beams of few shapes.
_MORE_SHAPES = 4


def beam(
    length: Along,
    *,
    E: Along | None = None,
    G: Along | None = None,
    rho: Along | None = None,
    area: Along | None = None,
    I_flap: Along | None = None,
    I_edge: Along | None = None,
    J: Along | None = None,
    mass: Along | None = None,
    EI_flap: Along | None = None,
    EI_edge: Along | None = None,
    GJ: Along | None = None,
    EA: Along | None = None,
    GA_flap: Along | None = None,
    GA_edge: Along | None = None,
    inertia_flap: Along | None = None,
    inertia_edge: Along | None = None,
    shear_factor: float = 5 / 6,
    twist: Along = 0.0,
    elements: int = 60,
    modes: int = 6,
    theory: str = "euler-bernoulli",
    stiffening: bool = True,
    damping: ArrayLike | None = None,
    nodes: Mapping[str, float] | None = None,
    attach: Sequence[str] = (),
    fixed: str | None = "root",
) -> ModalBody:
    """A straight beam along body x, from x = 0 (``"root"``) to x = L (``"tip"``), as a `ModalBody`.

        K: 1/2 int EI_edge (v" c + w" s)^2 + EI_flap (w" c - v" s)^2 + GJ rx'^2 + EA u'^2 dx,   c, s of the twist
        M: 1/2 int rho' (u'^2 + v'^2 + w'^2) dx + rotary inertia of the sections,   K phi = M phi omega^2

    Axes: without twist edgewise displacement v is along body y and flapwise w along body z; ``twist`` turns both
    principal axes about x, y towards z. Sections have their centres of mass and of shear on the x axis.

    Parameters
    ----------
    length
        L (m), or the places x (n,) of stations, 0 first and increasing. Every property is a number, or (n,) values at
        the stations between which it is linear.
    E, G, rho, area, I_flap, I_edge, J
        Material (Pa, Pa, kg/m3) and section (m2; m4 for bending flapwise and edgewise; m4 torsion constant): short for
        what follows, mass = rho area, EI = E I, GJ = G J, EA = E area, GA = shear_factor G area, inertia = rho I.
    mass, EI_flap, EI_edge
        kg/m and N m2. What is given directly wins over what the material makes.
    GJ, EA
        N m2 and N. Without them the beam neither twists nor stretches. GJ needs rotary inertia.
    GA_flap, GA_edge
        N, shear stiffness (Timoshenko only).
    inertia_flap, inertia_edge
        kg m: rotary inertia of the sections, int rho s^2 dA with s along the flap and the edge axis; 0 by default.
    twist
        rad.
    elements
        How many at least; every station interval has one or more.
    modes
        Fixed-interface modes, those of the lowest frequencies.
    theory
        "euler-bernoulli" (with rotary inertia where it is given) or "timoshenko" (shear, too).
    stiffening
        Displacements of second order: foreshortening, by which axial forces of inertial fields and weight
        (`ModalBody.KG`) and at nodes (`ModalBody.node_quadratic`) stiffen or buckle the beam, and bending that torsion
        turns to the side (lateral buckling).
    damping
        Ratio of critical damping of all modes, or (m,) of each; none by default.

        Every property but ``twist`` and ``shear_factor`` may be a parameter of a model, or hold some: E=m.parameter("E",
        2.1e11). The body then follows them, on the shapes of the present values. ``length`` may be one where properties
        are constant along the beam; nodes keep their share of it, section loads and air are refused then.
    nodes
        Names and places x (m) of points to attach to, beside "root" and "tip".
    attach
        Names of those nodes that get constraint (static) modes, six each (fewer where u or rx is left out): for nodes
        that joints or springs hold, so that few modes suffice.
    fixed
        "root": the frame is that of the clamped root. None: a free beam, mean axes: shapes orthogonal to all rigid
        motions, the frame's origin where the undeformed root was.

    Returns
    -------
    ModalBody
        Shapes orthonormal over the mass (M = 1, K = diag omega^2), ascending in frequency; the largest entry positive.

    Raises
    ------
    ModelError
        A missing or impossible property, wrong shapes, a station outside the beam; the message names the argument.

    Notes
    -----
    Linear theory in the frame: deflections small against the length; second order enters through ``stiffening`` only,
    and of a free beam of inertial fields only the axial force of rotation about its centre. Error of the
    frequencies O(h^4) in the element length. Cost O(n^3) for n degrees of freedom, O(m^2 n) for the integrals.

    Examples
    --------
    >>> import numpy as np, mbrs as mb
    >>> rod = mb.flexible.beam(1.0, mass=1.0, EI_flap=1.0, EI_edge=4.0, modes=2)
    >>> np.round(rod.frequencies() * 2 * np.pi, 5)    # 1.875104^2 times 1 and 2
    array([3.51602, 7.03203])
    """
    for name, fixed_number in (("twist", twist), ("shear_factor", shear_factor)):
        if plain(fixed_number) is not fixed_number:
            raise ModelError(f"beam: {name} is a number; a parameter there changes the mesh: build the beam again")
    x, _ = _stretched(length)
    material = dict(E=E, G=G, rho=rho, area=area, I_flap=I_flap, I_edge=I_edge, J=J, shear_factor=shear_factor)
    direct = dict(mass=mass, EI_flap=EI_flap, EI_edge=EI_edge, GJ=GJ, EA=EA, GA_flap=GA_flap, GA_edge=GA_edge)
    own = dict(inertia_flap=inertia_flap, inertia_edge=inertia_edge)
    places = _places(nodes, x)
    return _Recipe(
        length,
        {**material, **direct, **own},
        twist,
        choice("theory", theory, THEORIES),
        places,
        float(x[-1]),
        count("elements", elements, 2000),
        count("modes", modes, 1000, least=0),
        _attached(attach, places, fixed),
        fixed,
        flag("stiffening", stiffening),
        damping,
    ).body()


@dataclass(frozen=True, eq=False)
class _Recipe:
    """The properties of a beam, expressions of parameters as they were given; ``places`` of its nodes at a length ``span``; ``refinement``:
    how often every element is cut in two."""

    length: Any
    given: dict[str, Any]
    twist: Any
    theory: str
    places: dict[str, float]
    span: float
    elements: int
    modes: int
    attach: list[str]
    fixed: str | None
    stiffening: bool
    damping: Any
    refinement: int = 0

    def body(self) -> ModalBody:
        """The beam of the present values."""
        x, stretch = _stretched(self.length)
        shear = self.theory == "timoshenko"
        numbers = {name: plain(value) for name, value in self.given.items()}
        properties = _properties(x, numbers, numbers, shear)
        found = {name: some for name in _PRODUCTS if (some := _expressions(name, self.given, len(x), shear))}
        properties["twist"] = _at_stations("twist", self.twist, x)
        places = {name: place * float(x[-1] / self.span) for name, place in self.places.items()}
        grid = _mesh(x, properties, places, self.elements, self.refinement, shear)
        return _reduced(grid, self, properties, places, x, found, stretch)

    def finer(self) -> ModalBody:
        """The beam of elements of half the length, with more than twice the shapes; undamped, unless one ratio holds for all shapes."""
        more = 2 * self.modes + _MORE_SHAPES
        damping = self.damping if np.ndim(plain(self.damping)) == 0 else None
        return replace(self, modes=more, damping=damping, refinement=self.refinement + 1).body()


def _stretched(length: Any) -> tuple[Array, Any]:
    """Stations now, and the length over that now where it is an expression."""
    now = plain(length)
    if now is length:
        return _stations(length), None
    if np.ndim(now):
        raise ModelError(
            "beam: stations are numbers; a parameter among them changes the mesh: build the beam again, or give one "
            "length, along which properties are constant"
        )
    return _stations(now), length / now


def _expressions(name: str, given: dict[str, Any], n: int, shear: bool) -> list[Channel]:
    """The expressions of parameters in a property."""
    if not shear and name.startswith("GA"):
        return []
    parts = [given[name]] if given[name] is not None else [given[part] for part in _PRODUCTS[name]]
    return [] if any(part is None for part in parts) else channels(parts, n)


def _stations(length: Any) -> Array:
    x = sized_array("beam: length", length)
    if x.ndim == 0:
        if not x > 0:
            raise ModelError(f"beam: length must be positive, it is {shown(length)}")
        return np.array([0.0, float(x)])
    if x.ndim != 1 or len(x) < 2 or x[0] != 0 or not np.all(np.diff(x) > 0):
        raise ModelError(f"beam: stations must increase from 0, at least two, got {shown(length)}")
    return x


def _at_stations(name: str, value: Any, x: Array) -> Array:
    made = sized_array(f"beam: {name}", value)
    if made.shape not in ((), x.shape):
        raise ModelError(f"beam: {name} must be a number or {len(x)} values at the stations, got shape {made.shape}")
    return np.broadcast_to(made, x.shape).astype(float)


# A property, and the parts whose product it is.
_PRODUCTS = {
    "mass": ("rho", "area"),
    "EI_flap": ("E", "I_flap"),
    "EI_edge": ("E", "I_edge"),
    "GJ": ("G", "J"),
    "EA": ("E", "area"),
    "GA_flap": ("shear_factor", "G", "area"),
    "GA_edge": ("shear_factor", "G", "area"),
    "inertia_flap": ("rho", "I_flap"),
    "inertia_edge": ("rho", "I_edge"),
}
_NEEDED = ("mass", "EI_flap", "EI_edge")


def _properties(x: Array, material: dict[str, Any], direct: dict[str, Any], shear: bool) -> dict[str, Array]:
    out = {}
    for name, parts in _PRODUCTS.items():
        if direct[name] is not None:
            out[name] = _at_stations(name, direct[name], x)
        elif all(material[part] is not None for part in parts):
            out[name] = np.prod([_at_stations(part, material[part], x) for part in parts], axis=0)
        else:
            out[name] = np.zeros(len(x))
        needed = name in _NEEDED or (shear and name.startswith("GA"))
        if needed and not np.any(out[name]):
            given = " or ".join([f"{name}=", " and ".join(f"{p}=" for p in parts if p != "shear_factor")])
            raise ModelError(f"beam: give {given}: the beam has no {name}")
        if np.any(out[name] < 0) or (np.any(out[name]) and not np.all(out[name][1:-1] > 0)):
            raise ModelError(f"beam: {name} must be positive along the beam, got {shown(out[name].tolist())}")
        if np.all(out[name][:2] == 0) != (not np.any(out[name])):
            raise ModelError(f"beam: {name} must not vanish over an interval between stations")
    if np.any(out["GJ"]) and not np.any(out["inertia_flap"] + out["inertia_edge"]):
        raise ModelError(
            "beam: a beam that twists needs rotary inertia: give inertia_flap= and inertia_edge= (kg m), or leave out GJ"
        )
    if not shear:
        out["GA_flap"] = out["GA_edge"] = np.zeros(len(x))
    return out


def _places(nodes: Mapping[str, float] | None, x: Array) -> dict[str, float]:
    if nodes is not None and not isinstance(nodes, Mapping):
        raise ModelError(f'beam: nodes must map names to places along the beam, {{"middle": 0.5}}, got {shown(nodes)}')
    places = {"root": 0.0, "tip": float(x[-1])}
    for name, value in (nodes or {}).items():
        at = sized_array(f"beam: the place of node {shown(name)}", value)
        if not isinstance(name, str) or not name or at.ndim:
            raise ModelError(f"beam: nodes must map names to places along the beam, got {shown(name)}: {shown(value)}")
        if not 0 <= at <= x[-1]:
            raise ModelError(f"beam: node {name!r} at {float(at):g} m is not on the beam, which ends at {x[-1]:g} m")
        if name in places and places[name] != at:
            raise ModelError(
                f"beam: the node {name!r} is at {places[name]:g} m; give the one at {float(at):g} m a name"
            )
        places[name] = float(at)
    return places


def _attached(attach: Any, places: dict[str, float], fixed: Any) -> list[str]:
    wanted = names("beam: attach", attach)
    if fixed is not None and not (isinstance(fixed, str) and fixed == "root"):
        raise ModelError(f'beam: fixed must be "root" or None (a free beam), got {shown(fixed)}')
    for name in wanted:
        if name not in places:
            raise ModelError(f"beam: attach names {name!r}, which is not a node; nodes are {', '.join(places)}")
        if fixed and places[name] == 0.0:
            raise ModelError(f"beam: attach names {name!r} at the root, which is held by the frame; leave it out")
    return list(dict.fromkeys(wanted))


def _mesh(
    x: Array, properties: dict[str, Array], places: dict[str, float], elements: int, refinement: int, shear: bool
) -> Mesh:
    """Nodes at stations and named places, the longest intervals cut until there are enough, and all of them ``refinement`` times more."""
    breaks = np.unique(np.concatenate([x, list(places.values())]))
    breaks = breaks[np.concatenate([[True], np.diff(breaks) > _SAME_PLACE * x[-1]])]
    lengths = np.diff(breaks)
    parts = np.maximum(np.rint(elements * lengths / x[-1]), _taper(breaks, x, properties)).astype(int) << refinement
    grid = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(breaks[:-1], breaks[1:], parts, strict=True)]

    def section(at: float) -> Section:
        return Section(**{name: float(np.interp(at, x, values)) for name, values in properties.items()})

    return mesh(np.concatenate([*grid, breaks[-1:]]), section, shear)


def _taper(breaks: Array, x: Array, properties: dict[str, Array]) -> Array:
    """Number of elements of every interval with which no stiffness or mass changes by more than a quarter in one."""
    out = np.ones(len(breaks) - 1)
    for name in _NEEDED:
        at = np.interp(breaks, x, properties[name])
        at = np.maximum(at, _POINTED * np.max(at))  # a pointed tip has no ratio
        out = np.maximum(out, np.ceil(np.abs(np.diff(np.log(at))) / np.log(1.25)))
    return out


def _reduced(
    grid: Mesh,
    given: _Recipe,
    properties: dict[str, Array],
    places: dict[str, float],
    x: Array,
    found: dict[str, list[Channel]],
    stretch: Any,
) -> ModalBody:
    modes, attach, fixed, damping = given.modes, given.attach, given.fixed, given.damping
    absent = [i for i, name in ((0, "EA"), (3, "GJ")) if not np.any(properties[name])]
    at = {name: int(np.argmin(np.abs(grid.x - place))) for name, place in places.items()}
    left_out = np.concatenate([_all_of(grid, i) for i in absent]) if absent else np.zeros(0, dtype=int)
    held = np.union1d(left_out, np.arange(6)) if fixed else left_out
    interface = np.setdiff1d([6 * at[name] + i for name in attach for i in range(6)], held).astype(int)
    if modes + len(interface) == 0:
        raise ModelError("beam: modes=0 and no attach=: nothing can deform; use m.body for a rigid body")
    rigid = 0 if fixed else 6 - len(absent)
    # A free beam without interface has its rigid motions among its modes; with one the constraint modes hold them.
    inside = modes + (rigid if not fixed and len(interface) == 0 else 0)
    M, K = grid.assembled()
    T, square = reduced_shapes(M, K, interface, held, inside, rigid, "beam", grid.stiffness_of)
    mass, com, inertia = rigid_body(grid)
    line = np.stack([T[6 * i : 6 * i + 6] for i in range(len(grid.x))])
    at_nodes = list(at.values())
    where = np.zeros((len(grid.x), 3))
    where[:, 0] = grid.x
    m = T.shape[1]
    second, KG = np.zeros((len(grid.x), 3, m, m)), np.zeros((12, m, m))
    if given.stiffening:
        second = second_order(grid, T, bool(fixed))
        KG = inertial_stiffness(grid, T, bool(fixed)) + turned_stiffness(grid, T, bool(fixed))
    note = f"{given.theory} beam, {grid.x[-1]:g} m, {len(grid.x) - 1} elements, "
    note += f"{'clamped at the root' if fixed else 'free, mean axes'}"
    integrals = dict(
        **shape_integrals(grid, T),
        K=np.diag(square),
        KG=KG,
    )
    C = modal_damping(plain(damping), np.sqrt(square), "beam")
    clamped, nodes_follow = bool(fixed), {}
    if stretch is not None:
        nodes_follow = stretched_nodes(where[at_nodes], line[at_nodes], second[at_nodes], stretch)
    depends = bool(found or nodes_follow) or plain(damping) is not damping
    follows = driven(grid, T, integrals, found, x, clamped, damping, stretch) if depends else {}
    return ModalBody(
        mass=mass,
        com=com,
        inertia=inertia,
        **integrals,
        C=C,
        driven=follows | nodes_follow,
        nodes=tuple(at),
        node_position=where[at_nodes],
        node_shape=line[at_nodes],
        line_position=where,
        line_shape=line,
        node_quadratic=second[at_nodes],
        line_quadratic=second,
        note=note,
        recipe=given,
    )


def _all_of(grid: Mesh, freedom: int) -> Array:
    """Every freedom of u (0) or rx (3), those inside the elements included."""
    n = len(grid.x)
    inner = (grid.n_dof - 6 * n) // (n - 1)
    inside = 6 * n + inner * np.arange(n - 1) + (0 if freedom == 0 else 1)
    return np.concatenate([6 * np.arange(n) + freedom, inside])


def modal_damping(damping: Any, omega: Array, whose: str) -> Array:
    """diag(2 zeta omega) for one ratio or one of each mode."""
    if damping is None:
        return np.zeros((len(omega), len(omega)))
    ratio = sized_array(f"{whose}: damping", damping)
    if ratio.shape not in ((), omega.shape) or np.any(ratio < 0) or not math.isfinite(float(np.sum(ratio))):
        raise ModelError(f"{whose}: damping must be one ratio or {len(omega)}, none negative, got {shown(damping)}")
    return np.diag(2 * np.broadcast_to(ratio, omega.shape) * omega)
