"""Effects of a scene, with reasons: a closed list, decided from the model before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..errors import ModelError
from ..model.flexible import FlexibleBody
from ..model.names import nearest, shown
from ..model.schema import JOINTS, LAWS
from ..results import Result, derived, result

if TYPE_CHECKING:
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

    def plot(self, *, ax: Any = None) -> Any:
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
    versions = (model.structure_version, model.values_version)
    cached = model.cache.get("effects")
    if cached is None or cached[0] != versions:
        rows = tuple(Effect(name, *_RULES[name](model)) for name in EFFECTS)
        cached = model.cache["effects"] = (versions, EffectsTable(model.name, rows))
    return cached[1]


def check_without(names: Any) -> tuple[str, ...]:
    """The effects to leave out, checked, in the order of `EFFECTS`; a single name may stand without a tuple."""
    given = (names,) if isinstance(names, str) else names
    if not isinstance(given, Iterable):
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


def _gravity(m: Model) -> tuple[bool, str]:
    g = m.gravity
    if g is None:
        return False, "no gravity was given"
    text = ", ".join(f"{v:g}" for v in g)
    if not g.any():
        return False, "gravity was given as zero"
    return True, f"({text}) m/s2"


def _moving(m: Model) -> tuple[list[str], list[str]]:
    turning, sliding = [], []
    for body in m.bodies:
        if any(body.values("angular_velocity")):
            turning.append(body.name)
        elif any(body.values("velocity")):
            sliding.append(body.name)
    return turning, sliding


def _inertial(m: Model) -> tuple[bool, str]:
    turning, sliding = _moving(m)
    if turning:
        return True, f"initial angular velocity of {_listed(turning)}"
    if sliding and m.joints:
        return True, f"initial velocity of {_listed(sliding)}, which joints may turn into rotation"
    if sliding:
        return False, "bodies move, but none has an initial angular velocity"
    return False, "no initial velocity"


def _loads(m: Model) -> list[str]:
    """Kinds of load on the springs and joints of the scene."""
    out = []
    if _gravity(m)[0]:
        out.append("gravity")
    if m.loads:
        out.append(_count(len(m.loads), "load"))
    out += _prestress(m)
    if _inertial(m)[0]:
        out.append("inertial forces")
    return out


def _prestress(m: Model) -> list[str]:
    out = []
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


def _count(n: int, what: str) -> str:
    return f"{n} {what}" + ("" if n == 1 else "s")


def _springs(m: Model) -> list[Any]:
    return [*m.elements, *(j for j in m.joints if _is_sprung(j) or ("joint", j.index) in m.laws_of)]


def _is_sprung(joint: Any) -> bool:
    return any(joint.has(name) for name in ("k", "c", "preload"))


def _preload_stiffness(m: Model) -> tuple[bool, str]:
    if not _springs(m):
        return False, "no spring, bushing or joint stiffness"
    loads = _loads(m)
    if not loads:
        return False, "springs carry no force: no gravity, load, preload or given length"
    return True, "springs are loaded by " + ", ".join(loads)


def _constraint_stiffness(m: Model) -> tuple[bool, str]:
    if not any(j.type != "free" for j in m.joints):
        return False, "no joint constrains anything"
    loads = _loads(m)
    if not loads:
        return False, "joints carry no force: no gravity, load or preload"
    return True, "joints are loaded by " + ", ".join(loads)


def with_rate_laws(m: Model) -> list[Any]:
    """Elements and joints with a law whose force depends on the rate."""
    return [law.owner for laws in m.laws.values() for law in laws if law.uses_rate]


def _damping(m: Model) -> tuple[bool, str]:
    owners = _springs(m)
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


def _law_rule(what: str) -> Callable[[Model], tuple[bool, str]]:
    names = frozenset(law.name for law in LAWS.values() if law.effect == what)

    def rule(m: Model) -> tuple[bool, str]:
        found = [law.owner.name for laws in m.laws.values() for law in laws if law.name in names]
        return (True, f"{what} law on {_listed(found)}") if found else (False, f"no {what} law")

    return rule


def _flexibility(m: Model) -> tuple[bool, str]:
    flexible = [body for body in m.bodies if isinstance(body, FlexibleBody)]
    if not flexible:
        return False, "all bodies are rigid"
    modes = sum(body.n_modes for body in flexible)
    return True, f"{_count(modes, 'modal coordinate')} of {_listed([body.name for body in flexible])}"


def _drives(m: Model) -> tuple[bool, str]:
    varying = [load.name for load in m.loads if load.motions]
    parts = [f"drive {_listed([d.name for d in m.drives])}"] if m.drives else []
    if varying:
        parts.append(f"loads that vary in time ({_listed(varying)}), which stay when this is left out")
    return (True, "; ".join(parts)) if m.drives else (False, "no joint is driven")


def _nonholonomic(m: Model) -> tuple[bool, str]:
    found = [j.name for j in m.joints if JOINTS[j.type].nonholonomic]
    return (True, f"{_listed(found)}") if found else (False, "no knife edge or rolling disc")


_RULES: dict[str, Callable[[Any], tuple[bool, str]]] = {
    "gravity": _gravity,
    "gyroscopic": _inertial,
    "centrifugal": _inertial,
    "preload-stiffness": _preload_stiffness,
    "constraint-force-stiffness": _constraint_stiffness,
    "damping": _damping,
    "flexibility": _flexibility,
    "friction": _law_rule("friction"),
    "contact": _law_rule("contact"),
    "drives": _drives,
    "nonholonomic": _nonholonomic,
}
