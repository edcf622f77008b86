"""What an effect costs in a motion, and what leaving it out saves: rows for the table of benches/motion.py.

Two runs are compared in turn, so that what else the machine does touches both; a share is the median over the pairs, its
scatter that of the median. Steps are fixed and equal, so that an effect changes the work and not its amount.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import mbrs as mb
import numpy as np
from tables import Row, ms

PAIRS = 60, 300
# shares are told to this much, or the row fails
SCATTER = 0.005
# of what a scene without the effect saves
PART = 0.8
STEPS = {"t": 0.005, "step": 1e-4, "method": "explicit"}


def simulated(m: Any, **options: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        return mb.simulate(m, **{**STEPS, **options})


def _seconds(work: Callable[[], Any]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


@dataclass(frozen=True)
class Share:
    """Part of the time of one run that another saves, and the scatter (one sigma) of this number."""

    part: float
    scatter: float
    seconds: float

    @property
    def resolved(self) -> bool:
        return self.part > 3 * self.scatter

    def __str__(self) -> str:
        return f"{100 * self.part:.1f} +- {100 * self.scatter:.1f} %"


def saved(full: Callable[[], Any], less: Callable[[], Any]) -> Share:
    """Pairs in alternating order until the median of their ratios is known to `SCATTER`, or 400 of them."""
    full(), less()
    ratios: list[float] = []
    times: list[float] = []
    scatter = np.inf
    while len(ratios) < PAIRS[1]:
        if len(ratios) % 2:
            a, b = _seconds(full), _seconds(less)
        else:
            b, a = _seconds(less), _seconds(full)
        ratios.append(b / a)
        times.append(a)
        # of the median of normal scatter, its width taken from the middle half, which outliers do not reach
        scatter = 1.2533 * float(np.subtract(*np.quantile(ratios, [0.75, 0.25]))) / 1.349 / np.sqrt(len(ratios))
        if len(ratios) >= PAIRS[0] and scatter < 0.5 * SCATTER:
            break
    return Share(1.0 - float(np.median(ratios)), scatter, min(times))


@dataclass(frozen=True)
class Case:
    """A scene that has an effect; ``bare`` is the same scene built without it, None where it cannot be."""

    words: str
    effect: str
    scene: Callable[[], Any]
    bare: Callable[[], Any] | None
    options: dict[str, Any] = field(default_factory=dict)

    def row(self) -> Row:
        m = self.scene()
        full = lambda: simulated(m, **self.options)  # noqa: E731
        out = saved(full, lambda: simulated(m, without=(self.effect,), **self.options))
        text, beside = f"{ms(out.seconds)}; left out {out} saved", ""
        reached = out.resolved
        scatter = out.scatter
        if self.bare is not None:
            bare = self.bare()
            cost = saved(full, lambda: simulated(bare, **self.options))
            beside = f"built without it {cost} saved" + ("" if cost.resolved else " (not resolved)")
            slack = 3 * float(np.hypot(out.scatter, cost.scatter))
            reached = out.part > PART * cost.part - slack and out.resolved >= cost.resolved
            scatter = max(scatter, cost.scatter)
        if scatter > SCATTER:
            text, reached = text + "; the machine is too noisy to tell", False
        return Row(f"{self.words}: without {self.effect}", "saves what it costs", text + self._work(m), reached, beside)

    def _work(self, m: Any) -> str:
        """Counts that fall."""
        full = simulated(m, **self.options).stats.counts
        less = simulated(m, without=(self.effect,), **self.options).stats.counts
        fallen = [f"{name} {n} to {less.get(name, 0)}" for name, n in full.items() if less.get(name, 0) < n]
        return "; " + (", ".join(fallen) or "counts are equal")


# --- scenes, all data invented -----


def chain(n: int = 20, gravity: bool = True, driven: bool = False, **joint: Any) -> Any:
    """Links on hinges, let go level; ``joint`` makes what acts in every hinge."""
    m = mb.Model("chain", gravity=(0.0, -9.81, 0.0) if gravity else None)
    before = m.ground
    for i in range(n):
        link = m.body(f"link{i}", mass=1.0, inertia=(1e-3, 0.01, 0.01), at=(0.2 * i + 0.1, 0, 0))
        made = {key: value() if callable(value) else value for key, value in joint.items()}
        hinge = m.revolute(f"hinge{i}", before, link, at=(0.2 * i, 0, 0), axis="z", **made)
        if driven:
            m.drive(f"motor{i}", hinge, mb.Sine(0.1, frequency=1.0))
        before = link
    return m


def cloud(n: int = 10, each: int = 8, **element: Any) -> Any:
    """Free bodies in a row, each held to the next by elements between points; without ``element`` by none."""
    m = mb.Model("cloud")
    bodies = [m.ground]
    for i in range(n):
        at, velocity = (0.3 * i, 0, 0), (0, 0.2 * i, 0)
        bodies.append(m.body(f"body{i}", mass=1.0, inertia=(0.1, 0.1, 0.1), at=at, velocity=velocity))
    for i in range(n):
        for j in range(each if element else 0):
            at = ((0.3 * i - 0.1 * j, 0.1 * j, 0.2), (0.3 * i + 0.1 * j, 0.3, 0.05 * j))
            m.spring_damper(f"element{i}-{j}", bodies[i], bodies[i + 1], at=at, **element)
    return m


def skates(edge: bool = True, n: int = 8) -> Any:
    """Blades on a plane, each with or without its edge."""
    m = mb.Model("skates")
    for i in range(n):
        a = m.body(
            f"blade{i}", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0, i, 0), velocity=(1, 0, 0), angular_velocity=(0, 0, 1)
        )
        m.planar(f"ice{i}", m.ground, a, at=(0, i, 0), axis="z")
        if edge:
            m.knife_edge(f"edge{i}", m.ground, a, at=(0.1, i, 0), axis="y")
    return m


def rods(flexible: bool = True, n: int = 3, modes: int = 6) -> Any:
    """Turning rods one after the other on hinges, each with bending modes or rigid, equal mass and inertia."""
    shape = mb.flexible.beam([0.0, 1.0], mass=1.0, EI_flap=40.0, EI_edge=60.0, modes=modes)
    m = mb.Model("rods", gravity=(0.0, -9.81, 0.0))
    before: Any = m.ground
    for i in range(n):
        moving = {"at": (i, 0, 0), "velocity": (0, 2.0 * i, 0), "angular_velocity": (0, 0, 2.0)}
        if flexible:
            rod = m.flexible_body(f"rod{i}", shape, **moving)
            root, tip = rod.node("root"), rod.node("tip")
        else:
            rod = m.body(f"rod{i}", mass=shape.mass, com=shape.com, inertia=shape.inertia, **moving)
            root = tip = rod
        m.revolute(f"hinge{i}", before, root, at=(i, 0, 0), axis="z")
        before = tip
    return m


# enough of scenes whose steps are dear
SHORT = {"t": 0.002}
CASES = (
    Case("20 links under gravity", "gravity", chain, lambda: chain(gravity=False)),
    Case("friction in each of 20 hinges", "friction", lambda: chain(law=lambda: mb.CoulombTanh(0.5, 1e-2)), chain),
    Case(
        "friction in each of 20 hinges with springs",
        "friction",
        lambda: chain(k=5.0, law=lambda: mb.CoulombTanh(0.5, 1e-2)),
        lambda: chain(k=5.0),
    ),
    Case("a stop in each of 20 hinges", "contact", lambda: chain(law=lambda: mb.Gap(50.0, 0.3, 1e-3)), chain),
    Case(
        "a stop in each of 20 hinges with springs",
        "contact",
        lambda: chain(k=5.0, law=lambda: mb.Hertz(50.0, 1.5, -0.1)),
        lambda: chain(k=5.0),
    ),
    Case("80 dampers", "damping", lambda: cloud(c=0.3), cloud, SHORT),
    Case(
        "80 dampers beside springs, tangents in every step",
        "damping",
        lambda: cloud(k=20.0, c=0.3),
        lambda: cloud(k=20.0),
        {"method": "ali3p", "step": 1e-3, "t": 0.02},
    ),
    Case("20 driven hinges", "drives", lambda: chain(driven=True), chain, SHORT),
    Case("8 knife edges", "nonholonomic", skates, lambda: skates(edge=False)),
    Case("3 turning rods of 6 modes", "centrifugal", rods, None, SHORT),
    Case("3 turning rods of 6 modes", "flexibility", rods, lambda: rods(flexible=False), SHORT),
)


def modal_data() -> list[Row]:
    """Tables and counts of a motion with and without flexible bodies."""
    texts, found = [], []
    for words, flexible, without in (
        ("rigid", False, ()),
        ("flexible", True, ()),
        ("flexible, left out", True, ("flexibility",)),
    ):
        m = rods(flexible)
        traj = simulated(m, method="bdf", t=0.05, step=1e-3, without=without)
        made = traj.snapshot.tables
        arrays = [np.size(made[name]) for name in made if name.startswith("flexible")]
        bodies = traj.stats.counts.get("flexible bodies", 0)
        found.append((len(arrays), bodies))
        texts.append(f"{words}: {len(arrays)} arrays of {sum(arrays)} numbers, {bodies} flexible bodies in tangents")
    reached = found[0] == found[2] == (0, 0) and min(found[1]) > 0
    return [Row("modal data of 3 rods", "none without flexible bodies", "; ".join(texts), reached)]


def no_tangents() -> list[Row]:
    """An explicit motion forms no tangent, an implicit one of the same scene does."""
    names = ("tangents", "factorisations", "multiplier solutions", "velocity projections")
    m = chain(k=5.0, law=lambda: mb.CoulombTanh(0.5, 1e-2))
    explicit, implicit = (simulated(m, method=method).stats.counts for method in ("explicit", "bdf"))
    told = ", ".join(f"{explicit.get(name, 0)} {name}" for name in names)
    text = f"{told}, {explicit['force evaluations']} force evaluations; `bdf` {implicit.get('tangents', 0)} tangents"
    reached = not any(explicit.get(name, 0) for name in names) and implicit.get("tangents", 0) > 0
    return [Row("friction in each of 20 hinges with springs, explicit: work", "no tangents", text, reached)]


def rows() -> list[Row]:
    return [*(case.row() for case in CASES), *no_tangents(), *modal_data()]
