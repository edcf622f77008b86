"""Effects of a scene, with reasons: a closed list, decided from the model before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .._lib.checks import is_list
from ..errors import ModelError
from ..model.flexible import FlexibleBody
from ..model.names import nearest, shown
from ..model.schema import JOINTS, LAWS, Block
from ..results import Result, derived, result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..model.model import Model

EFFECTS = (
    "gravity",
    "gyroscopic",
    "centrifugal",
    "preload-stiffness",
    "constraint-force-stiffness",
    "damping",
    "flexibility",
    "friction",
    "contact",
    "drives",
    "nonholonomic",
    "aerodynamics",
)
# parts of a linearisation: a motion has them in its forces or not at all
LINEAR_ONLY = frozenset({"gyroscopic", "preload-stiffness", "constraint-force-stiffness"})
_NEVER_OFF = frozenset({"loops", "redundancy"})


@dataclass(frozen=True)
class Effect:
    """One effect: whether the scene has it, and the reason in words."""

    name: str
    on: bool
    why: str


@result
class EffectsTable(Result):
    """The effects of a model in the order of `EFFECTS`; prints as a table, indexes by name."""

    name: str
    entries: tuple[Effect, ...]

    def __iter__(self) -> Iterator[Effect]:
        return iter(self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    def __getitem__(self, name: str) -> Effect:
        check_without((name,))
        return next(row for row in self.entries if row.name == name)

    @property
    def on(self) -> tuple[str, ...]:
        """Names of the effects that are present."""
        return tuple(row.name for row in self.entries if row.on)

    row: ClassVar[str] = "effect"
    axes: ClassVar[Mapping[str, str]] = {"effect": "names"}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all effects."""
        return tuple(entry.name for entry in self.entries)

    @property
    @derived(dims=("effect",), name="on")
    def _on(self) -> np.ndarray:
        return np.array([entry.on for entry in self.entries])

    @property
    @derived(dims=("effect",), name="why")
    def _why(self) -> np.ndarray:
        return np.array([entry.why for entry in self.entries])

    def heading(self) -> str:
        return f"effects of {self.name!r}"

    def rows(self) -> tuple[list[str], list[list[Any]]]:
        """Columns and rows of the table."""
        return ["effect", "state", "why"], [[e.name, "on" if e.on else "off", e.why] for e in self.entries]

    def plot(self, *, ax: Axes | None = None) -> Figure:
        """The effects as filled (on) and empty (off) marks with their reasons; returns the figure."""
        from ..plot.studies import effects_list

        return effects_list(self, ax=ax)


def effects(model: Model) -> EffectsTable:
    """Effects of a model: each effect of the closed list, on or off, and why.

    Parameters
    ----------
    model
        A `Model`, as it is now.

    Returns
    -------
    EffectsTable
        Prints as a table; ``effects(m)["damping"].on``; ``effects(m).on`` lists the names of those that are present.

    Raises
    ------
    ModelError
        Anything but a model.

    Notes
    -----
    What is off costs nothing in any analysis; what is on can be left out by name with ``without=``. Cost O(objects).

    Examples
    --------
    >>> import mbrs as mb
    >>> mb.effects(mb.Model("empty"))["gravity"].why
    'no gravity was given'
    """
    if not hasattr(model, "stores"):
        raise ModelError(f"effects needs a mb.Model, got {shown(model)}")
    now = (model.structure_version, *_deciding_numbers(model))
    cached = model.cache.get("effects")
    if cached is None or cached[0] != now:
        scene = _Scene(model)
        rows = tuple(Effect(name, *_RULES[name](scene)) for name in EFFECTS)
        cached = model.cache["effects"] = (now, EffectsTable(model.name, rows))
    return cached[1]


# Fields of bodies, joints and elements whose numbers decide about effects; all others decide by being given or not.
_DECIDING = ("velocity", "angular_velocity", "at_a", "at_b", "angle")


@cache
def _deciding(block: Block) -> tuple[int, ...]:
    parts = (block.slice(name) for name in _DECIDING if name in block.fields)
    return tuple(place for part in parts for place in range(part.start, part.stop))


def deciding_places(model: Model) -> list[tuple[str, np.ndarray]]:
    """Stores, and places in them, of all numbers that decide about effects."""
    cached = model.cache.get("deciding places")
    if cached is None or cached[0] != model.structure_version:
        places = []
        for kind, items in (("body", model.bodies), ("joint", model.joints), ("element", model.elements)):
            own = [item.start + place for item in items for place in _deciding(item.table.block)]
            places.append((kind, np.array(own, dtype=int)))
        places += [(kind, np.arange(len(model.stores[kind].x))) for kind in ("gravity", "flexible")]
        cached = model.cache["deciding places"] = (model.structure_version, [p for p in places if len(p[1])])
    found: list[tuple[str, np.ndarray]] = cached[1]
    return found


def _deciding_numbers(model: Model) -> list[bytes]:
    """These numbers now. Cost O(numbers), without a look at the objects."""
    return [np.frombuffer(model.stores[kind].x)[places].tobytes() for kind, places in deciding_places(model)]


def check_without(names: Any) -> tuple[str, ...]:
    """The effects to leave out, checked, in the order of `EFFECTS`; a single name may stand without a tuple."""
    given = (names,) if isinstance(names, str) else names
    if not is_list(given):
        raise ModelError(f"without= takes names of effects, got {shown(names)}")
    wanted = list(given)
    for name in wanted:
        if isinstance(name, str) and name in EFFECTS:
            continue
        if isinstance(name, str) and name in _NEVER_OFF:
            raise ModelError(
                f"the effect {shown(name)} cannot be switched off: it follows from the joints of the model"
            )
        guess = nearest(name, EFFECTS) if isinstance(name, str) else None
        hint = f"did you mean {guess!r}?" if guess else "known: " + ", ".join(EFFECTS)
        raise ModelError(f"no effect is called {shown(name)}; {hint}")
    return tuple(name for name in EFFECTS if name in wanted)


def _listed(names: list[str], limit: int = 4) -> str:
    return ", ".join(names[:limit]) + (f" and {len(names) - limit} more" if len(names) > limit else "")


class _Scene:
    """A model, and what several effects ask of it."""

    def __init__(self, model: Model) -> None:
        self.model = model

    @cached_property
    def gravity(self) -> tuple[bool, str]:
        g = self.model.gravity
        if g is None:
            return False, "no gravity was given"
        text = ", ".join(f"{v:g}" for v in g)
        if not g.any():
            return False, "gravity was given as zero"
        return True, f"({text}) m/s2"

    @cached_property
    def inertial(self) -> tuple[bool, str]:
        turning, sliding = [], []
        for body in self.model.bodies:
            if any(body.values("angular_velocity")):
                turning.append(body.name)
            elif any(body.values("velocity")):
                sliding.append(body.name)
        if turning:
            return True, f"initial angular velocity of {_listed(turning)}"
        if sliding and self.model.joints:
            return True, f"initial velocity of {_listed(sliding)}, which joints may turn into rotation"
        if sliding:
            return False, "bodies move, but none has an initial angular velocity"
        return False, "no initial velocity"

    @cached_property
    def loads(self) -> list[str]:
        """Kinds of load on the springs and joints of the scene."""
        out = ["gravity"] if self.gravity[0] else []
        if self.model.loads:
            out.append(_count(len(self.model.loads), "load"))
        out += self._prestress()
        if self.inertial[0]:
            out.append("inertial forces")
        return out

    def _prestress(self) -> list[str]:
        m, out = self.model, []
        owners: list[Any] = [*m.joints, *m.elements]
        preloaded = [o.name for o in owners if o.has("preload")]
        springs = [o for o in m.elements if "length" in o.table.block.fields]
        lengths = [o.name for o in springs if o.has("length")]
        angles = [o.name for o in m.elements if "angle" in o.table.block.fields and o.values("angle") != [0.0]]
        either = [o for o in owners if o.table.points == "either"]
        apart = [o.name for o in either if o.values("at_a") != o.values("at_b")]
        apart += [o.name for o in m.joints if o.has("length")]
        if preloaded:
            out.append(f"preload of {_listed(preloaded)}")
        if lengths or angles:
            out.append(f"natural length or angle given for {_listed(lengths + angles)}")
        if apart:
            out.append(f"assembly of {_listed(apart)}")
        return out

    @cached_property
    def springs(self) -> list[Any]:
        m = self.model
        return [*m.elements, *(j for j in m.joints if _is_sprung(j) or ("joint", j.index) in m.laws_of)]


def _count(n: int, what: str) -> str:
    return f"{n} {what}" + ("" if n == 1 else "s")


def _is_sprung(joint: Any) -> bool:
    return any(joint.has(name) for name in ("k", "c", "preload"))


def _preload_stiffness(scene: _Scene) -> tuple[bool, str]:
    if not scene.springs:
        return False, "no spring, bushing or joint stiffness"
    if not scene.loads:
        return False, "springs carry no force: no gravity, load, preload or given length"
    return True, "springs are loaded by " + ", ".join(scene.loads)


def _constraint_stiffness(scene: _Scene) -> tuple[bool, str]:
    if not (any(j.type != "free" for j in scene.model.joints) or scene.model.constraints):
        return False, "no joint constrains anything"
    if not scene.loads:
        return False, "joints carry no force: no gravity, load or preload"
    return True, "joints are loaded by " + ", ".join(scene.loads)


def with_rate_laws(m: Model) -> list[Any]:
    """Elements and joints with a law whose force depends on the rate."""
    return [law.owner for laws in m.laws.values() for law in laws if law.uses_rate]


def _damping(scene: _Scene) -> tuple[bool, str]:
    m, owners = scene.model, scene.springs
    flexible = [b for b in m.bodies if isinstance(b, FlexibleBody) and any(b.integrals.values("C"))]
    if flexible:
        return True, f"modal damping of {_listed([b.name for b in flexible])}"
    if not owners:
        return False, "no spring, bushing or joint stiffness that could have damping"
    rated = {id(owner) for owner in with_rate_laws(m)}
    damped = [o for o in owners if o.has("c") or id(o) in rated]
    if not damped:
        return False, "no c= was given, and no law depends on a rate"
    if len(owners) == 1:
        return True, "the spring has damping"
    share = f"all {len(owners)}" if len(damped) == len(owners) else f"{len(damped)} of {len(owners)}"
    return True, f"{share} springs have damping"


def _law_rule(what: str) -> Callable[[_Scene], tuple[bool, str]]:
    names = frozenset(law.name for law in LAWS.values() if law.effect == what)

    def rule(scene: _Scene) -> tuple[bool, str]:
        found = [law.owner.name for laws in scene.model.laws.values() for law in laws if law.name in names]
        return (True, f"{what} law on {_listed(found)}") if found else (False, f"no {what} law")

    return rule


def _flexibility(scene: _Scene) -> tuple[bool, str]:
    flexible = [body for body in scene.model.bodies if isinstance(body, FlexibleBody)]
    if not flexible:
        return False, "all bodies are rigid"
    modes = sum(body.n_modes for body in flexible)
    return True, f"{_count(modes, 'modal coordinate')} of {_listed([body.name for body in flexible])}"


def _drives(scene: _Scene) -> tuple[bool, str]:
    m = scene.model
    varying = [load.name for load in m.loads if load.motions]
    parts = [f"drive {_listed([d.name for d in m.drives])}"] if m.drives else []
    if varying:
        parts.append(f"loads that vary in time ({_listed(varying)}), which stay when this is left out")
    return (True, "; ".join(parts)) if m.drives else (False, "no joint is driven")


def _aerodynamics(scene: _Scene) -> tuple[bool, str]:
    airs = scene.model.airs
    if not airs:
        return False, "no air was given"
    parts = [f"{air.name}: {_count(sum(air.counts()), 'section')}, inflow {air.inflow}" for air in airs]
    return True, "; ".join(parts)


def _nonholonomic(scene: _Scene) -> tuple[bool, str]:
    found = [j.name for j in scene.model.joints if JOINTS[j.type].nonholonomic]
    found += [c.name for c in scene.model.constraints if c.of_velocities]
    return (True, f"{_listed(found)}") if found else (False, "no knife edge, rolling disc or velocity constraint")


_RULES: dict[str, Callable[[Any], tuple[bool, str]]] = {
    "gravity": lambda scene: scene.gravity,
    "gyroscopic": lambda scene: scene.inertial,
    "centrifugal": lambda scene: scene.inertial,
    "preload-stiffness": _preload_stiffness,
    "constraint-force-stiffness": _constraint_stiffness,
    "damping": _damping,
    "flexibility": _flexibility,
    "friction": _law_rule("friction"),
    "contact": _law_rule("contact"),
    "drives": _drives,
    "nonholonomic": _nonholonomic,
    "aerodynamics": _aerodynamics,
}
