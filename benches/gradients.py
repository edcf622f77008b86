"""Every figure that gradients of motions should reach, measured: cost over the number of parameters, memory, Exudyn beside them.

    OPENBLAS_NUM_THREADS=1 python benches/gradients.py [--write] [--memory] [name ...]

CPU seconds of this process (one BLAS thread), the best of several repeats; ratios are of runs in this one process. ``--memory``
adds the adjoint over 1e5 steps (minutes with a development build). ``--write`` puts the table into benches/README.md.
"""

from __future__ import annotations

import resource
import sys
import time
import warnings
from collections.abc import Callable, Iterable
from typing import Any

import mbrs as mb
import numpy as np
import rivals_gradient as rivals
from motion import PROGRAMS, build, exudyn
from tables import Row, cpu, ms, run, selected

BEGIN, END = "<!-- gradient table begins -->", "<!-- gradient table ends -->"
COUNTS = (1, 2, 4, 8, 16, 64, 256, 1000)
# docs/theory.md (23.12), T = 2 s: converged by Runge-Kutta and DOP853
FIVE_BAR = np.array([-1.33084740, 0.99780747])


def largest(a: Any, b: Any) -> float:
    """Largest difference over the largest entry of b."""
    return float(np.max(np.abs(np.asarray(a) - np.asarray(b))) / np.max(np.abs(b)))


# --- Exudyn's forward differences -----


def double_pendulum() -> list[Row]:
    """Two angles at 1 s by five parameters, 1000 steps in both programs."""
    m, goals = rivals.pendulum()
    names, h = list(rivals.VALUES), 1e-3
    run = lambda: mb.gradient(m, goals, names, t=1.0, step=h, method="direct")  # noqa: E731
    found, exact = np.asarray(run().gradient), rivals.pendulum_truth()
    own = largest(found, differences(m, goals, names, h))
    seconds = cpu(run, repeats=5)
    text = f"direct {ms(seconds)}: {own:.0e} off the derivative of its steps, {largest(found, exact):.0e} off the converged one"
    adjoint = mb.gradient(m, goals, names, t=1.0, step=h, method="adjoint").gradient
    what = f"double pendulum, 2 angles at 1 s by 5 parameters, {round(1 / h)} steps"
    rows = []
    for label, size in (("forward differences, steps of 1e-3", 1e-3), ("forward differences, steps of 1e-6", 1e-6)):
        made = exudyn(lambda size=size: rivals.pendulum_in_exudyn(size))
        if made is None:
            rows.append(Row(what, "20 times faster, 1e-9", text, None, "Exudyn not run"))
            continue
        other, gradient = made
        ratio = other / seconds
        rows.append(
            Row(
                what,
                "20 times faster, 1e-9",
                text,
                ratio >= 20.0 and own <= 1e-9,
                f"Exudyn's {label} {ms(other)}, {largest(gradient, exact):.0e} off: {ratio:.0f} x",
            )
        )
    rows.append(
        Row(
            "the same: adjoint against direct", "1e-9", f"{largest(adjoint, found):.0e}", largest(adjoint, found) < 1e-9
        )
    )
    return rows


def differences(m: Any, goals: Any, names: list[str], h: float) -> np.ndarray:
    """Differences of six points through the same steps, (n_obj, n_p)."""
    weights = {1: 0.75, 2: -0.15, 3: 1 / 60}
    columns = []
    for name in names:
        now = m.value(name)
        e = 5e-3 * now
        total: Any = 0.0
        for k, w in weights.items():
            for sign in (1, -1):
                m.set({name: now + sign * k * e})
                total = total + sign * w * mb.gradient(m, goals, name, t=1.0, step=h, method="direct").value
        m.set({name: now})
        columns.append(total / e)
    return np.array(columns).T


# --- cost over the number of parameters -----


def springs(n: int) -> tuple[Any, list[str]]:
    """A chain of four rods with n springs to ground, whose stiffnesses are n parameters. Invented data."""
    m = mb.Model("springs", gravity=(0, -9.81, 0))
    last = m.ground
    for i in range(4):
        b = m.body(f"b{i}", mass=1.0, inertia=(0.02, 0.02, 0.02), at=(i + 0.5, 0, 0))
        m.revolute(f"J{i}", last, b, at=(i, 0, 0), axis="z", c=0.1)
        last = b
    for i in range(n):
        ends = ((i % 7, 2.0, 0), (i % 4 + 0.5, 0, 0))
        m.spring_damper(f"s{i}", m.ground, m.bodies[i % 4], at=ends, k=20.0 / n, c=0.0)
    return m, [f"s{i}.k" for i in range(n)]


def cost() -> list[Row]:
    """CPU seconds over those of the same steps without derivatives."""
    parts = []
    for n in COUNTS:
        primal, direct, adjoint = _seconds(n)
        print(f"n_p = {n}: {ms(primal)}, direct {ms(direct)}, adjoint {ms(adjoint)}", file=sys.stderr, flush=True)
        parts.append((n, primal, direct / primal, adjoint / primal))
    forward = [p for p in parts if np.isfinite(p[2])]
    return [
        Row(
            "direct over the motion alone, chain of 4 with n_p springs, 100 steps",
            "at most 1 + .3 n_p",
            ", ".join(f"n_p = {n}: {d:.2f}" for n, _, d, _ in forward),
            all(d <= 1 + 0.3 * n for n, _, d, _ in forward),
        ),
        Row(
            "adjoint over the motion alone, the same, a cheap objective",
            "at most 4, up to n_p = 1000",
            ", ".join(f"n_p = {n}: {a:.2f}" for n, _, _, a in parts),
            all(a <= 4.0 for *_, a in parts),
        ),
    ]


def _seconds(n: int) -> tuple[float, float, float]:
    """Of the motion alone, of the direct gradient (up to 64 parameters) and of the adjoint."""
    m, names = springs(n)
    psi = mb.Final(lambda s: s.position("b3")[1])
    options = {"t": 0.5, "step": 5e-3}

    runs = [lambda: mb.simulate(m, method="ali3p", **options)]
    for method in ("direct", "adjoint") if n <= 64 else ("adjoint",):
        runs.append(lambda method=method: mb.gradient(m, psi, names, method=method, **options))
    # in turns, so that a machine that slows down slows all of them
    best = [np.inf] * len(runs)
    for _ in range(20 if n <= 16 else 4):
        best = [min(b, cpu(run, repeats=1, least=0.0)) for b, run in zip(best, runs, strict=True)]
    return best[0], best[1] if n <= 64 else np.nan, best[-1]


def car() -> list[Row]:
    """The car of mb.examples over its bump: 54 numbers, an objective written in Python."""
    m = mb.examples.car()
    psi = mb.Integral(lambda s: (s.t > 1.5) * s.point_acceleration("driver")[2] ** 2)
    names, options = list(m.parameters), {"t": 3.0, "step": 1e-2}
    primal = cpu(lambda: mb.simulate(m, method="ali3p", **options), repeats=2, least=0.0)
    adjoint = cpu(lambda: mb.gradient(m, psi, names, method="adjoint", **options), repeats=2, least=0.0)
    direct = cpu(lambda: mb.gradient(m, psi, names, method="direct", **options), repeats=1, least=0.0)
    text = f"motion {ms(primal)}, adjoint {ms(adjoint)} ({adjoint / primal:.1f}), direct {ms(direct)} ({direct / primal:.1f})"
    reached = adjoint <= 4 * primal and direct <= (1 + 0.3 * 54) * primal
    return [
        Row(
            "car of 14 degrees of freedom over a bump, 54 numbers, 300 steps",
            "adjoint 4, direct 17.2 motions",
            text,
            reached,
        )
    ]


# --- accuracy -----


def order() -> list[Row]:
    """Five-bar of docs/theory.md (23.12) over the step."""
    m, r0 = mb.examples.five_bar(), np.array([0.5, -2.0, 0.0])
    psi = mb.Integral(lambda s: np.sum((s.point("P2") - r0) ** 2))
    names, steps = ["spring1.length", "spring2.length"], (1e-2, 5e-3, 2.5e-3)
    errors, apart = [], 0.0
    for h in steps:
        direct = mb.gradient(m, psi, names, t=2.0, step=h, method="direct").gradient
        adjoint = mb.gradient(m, psi, names, t=2.0, step=h, method="adjoint").gradient
        errors.append(largest(direct, FIVE_BAR))
        apart = max(apart, largest(adjoint, direct))
    slope = float(np.log2(errors[-2] / errors[-1]))
    text = f"{slope:.2f} (errors {', '.join(f'{e:.1e}' for e in errors)} at h = {', '.join(f'{h:g}' for h in steps)})"
    return [
        Row("five-bar, 2 s: order of the gradient's error in h", "2", text, abs(slope - 2) < 0.1),
        Row("five-bar: adjoint against direct", "1e-9", f"{apart:.0e}", apart < 1e-9),
    ]


# --- the explicit scheme -----


def explicit() -> list[Row]:
    """Cost in motions over the number of parameters, accuracy and cost of a smooth mechanism, order."""
    return [*_whole_cost("explicit", 5.0, coordinates="tree"), _cost_of_chains(), *_explicit_accuracy()]


def slanting(n: int) -> tuple[Any, list[str]]:
    """Bodies on hinges with springs, lengths and axes in directions drawn at random; three parameters of each. Invented data."""
    m, rng = mb.Model("slanting chain", gravity=(0.3, -9.1, 1.7)), np.random.default_rng(3)
    last, place = m.ground, np.zeros(3)
    for i in range(n):
        way, axis = rng.standard_normal((2, 3))
        way *= 0.3 / np.linalg.norm(way)
        b = m.body(f"b{i}", mass=1.3, inertia=(0.011, 0.013, 0.017), at=tuple(place + way / 2))
        m.revolute(f"h{i}", last, b, at=tuple(place), axis=tuple(axis), k=3.1, c=0.02)
        last, place = b, place + way
    return m, [f"{name}{i}.{value}" for i in range(n) for name, value in (("b", "mass"), ("h", "k"), ("h", "c"))]


def _cost_of_chains() -> Row:
    parts = []
    for n in (24, 72, 144):
        m, names = slanting(n)
        psi = mb.Final(lambda s, n=n: s.position(f"b{n - 1}")[1])
        runs = [
            lambda m=m: mb.simulate(m, 1.0, method="explicit", coordinates="tree", rtol=1e-9),
            lambda m=m, names=names, psi=psi: mb.gradient(
                m, psi, names, t=1.0, scheme="explicit", method="adjoint", rtol=1e-9
            ),
        ]
        primal, own = (cpu(one, repeats=3, least=0.0) for one in runs)
        parts.append((n, own / primal))
    return Row(
        "explicit: the same of chains of n bodies, n_p = 3 n, 1 s, rtol 1e-9",
        "at most 5",
        ", ".join(f"n = {n}: {cost:.2f}" for n, cost in parts),
        all(cost <= 5.0 for _, cost in parts),
    )


def implicit() -> list[Row]:
    """Cost in motions over the number of parameters, with steps of one length and by a tolerance; the smallest error for the time."""
    rows = []
    for scheme in ("radau", "bdf"):
        rows += [*_whole_cost(scheme, 3.0), *_whole_cost(scheme, 3.0, step=5e-3)]
    return [*rows, *_radau_or_bdf()]


def _whole_cost(scheme: str, goal: float, step: float | None = None, **own: Any) -> list[Row]:
    parts = []
    control: dict[str, Any] = {"rtol": 1e-9} if step is None else {"step": step}
    for n in (1, 8, 64, 1000):
        m, names = springs(n)
        psi = mb.Final(lambda s: s.position("b3")[1])
        runs = [
            lambda m=m: mb.simulate(m, 5.0, method=scheme, **control, **own),
            lambda m=m, names=names, psi=psi: mb.gradient(
                m, psi, names, t=5.0, scheme=scheme, method="adjoint", **control
            ),
        ]
        # in turns, so that a machine that slows down slows both
        best = [np.inf] * len(runs)
        for _ in range(3):
            best = [min(b, cpu(run, repeats=1, least=0.0)) for b, run in zip(best, runs, strict=True)]
        parts.append((n, best[1] / best[0]))
    steps = "rtol 1e-9" if step is None else f"{round(5.0 / step)} steps"
    return [
        Row(
            f"{scheme}: value and adjoint gradient over the motion alone, the same chain, 5 s, {steps}",
            f"at most {goal:g}, up to n_p = 1000",
            ", ".join(f"n_p = {n}: {a:.2f}" for n, a in parts)
            + (" (of which 1 chooses the steps)" if step is None else ""),
            all(a <= goal for _, a in parts),
        )
    ]


def _radau_or_bdf() -> list[Row]:
    """The two stiff schemes over the tolerance: a rope of many rods with springs in its hinges, and a rigid chain."""
    rows = []
    for what, make, t in (("a rope of 80 rods", lambda: rope(80), 0.5), ("the chain of 4", lambda: springs(8), 2.0)):
        m, names = make()
        last = m.bodies[-1].name
        psi = mb.Final(lambda s, last=last: np.sum(s.position(last)))
        take = lambda scheme, rtol, m=m, psi=psi, names=names, t=t: mb.gradient(  # noqa: E731
            m, psi, names, t=t, rtol=rtol, scheme=scheme, method="adjoint"
        )
        exact = np.asarray(take("radau", 1e-11).gradient)
        found = {}
        for scheme in ("radau", "bdf"):
            found[scheme] = []
            for rtol in (1e-5, 1e-7, 1e-9):
                seconds = cpu(lambda scheme=scheme, rtol=rtol, take=take: take(scheme, rtol), repeats=2, least=0.0)
                found[scheme].append((seconds, largest(take(scheme, rtol).gradient, exact)))
        text = "; ".join(f"{k}: " + ", ".join(f"{e:.0e} in {ms(s)}" for s, e in v) for k, v in found.items())
        rows.append(
            Row(f"radau and bdf: {what}, {t:g} s, rtol 1e-5, 1e-7, 1e-9: error of the gradient", "told", text, None)
        )
    return rows


def rope(n: int) -> tuple[Any, list[str]]:
    """Rods with springs and dampers in their hinges, from the horizontal. Invented data."""
    m = mb.Model("rope", gravity=(0, 0, -9.81))
    last = m.ground
    for i in range(n):
        b = m.body(f"b{i}", mass=1.0 / n, inertia=(1e-3 / n**2,) * 3, at=((i + 0.5) / n, 0, 0))
        m.revolute(f"j{i}", last, b, at=(i / n, 0, 0), axis="y", k=2.0 * n, c=0.02 * n)
        last = b
    return m, [f"j{i}.k" for i in range(n)]


def _explicit_accuracy() -> list[Row]:
    m, r0 = mb.examples.five_bar(), np.array([0.5, -2.0, 0.0])
    psi = mb.Integral(lambda s: np.sum((s.point("P2") - r0) ** 2))
    names = ["spring1.length", "spring2.length", "spring1.k", "spring2.k"]
    take = lambda **steps: mb.gradient(m, psi, names, t=2.0, scheme="explicit", **steps)  # noqa: E731
    exact = np.asarray(take(step=2e-3).gradient)
    primal = cpu(lambda: mb.simulate(m, 2.0, rtol=1e-12, method="explicit", coordinates="tree"))
    seconds, found = cpu(lambda: take(rtol=1e-9)), take(rtol=1e-9)
    miss = largest(found.gradient, exact)
    errors = [largest(take(step=h).gradient, exact) for h in (0.05, 0.025)]
    slope = float(np.log2(errors[0] / errors[1]))
    return [
        Row(
            "explicit: five-bar, 2 s, 4 parameters, rtol 1e-9, an objective written in Python",
            "1e-8 in at most 16 motions at rtol 1e-12",
            f"{miss:.0e} in {ms(seconds)}, {len(found.t) - 1} steps: {seconds / primal:.1f} motions",
            miss <= 1e-8 and seconds <= 16 * primal,
        ),
        Row(
            "explicit: the same, order of the gradient's error in h",
            "8, within .3",
            f"{slope:.2f} (errors {', '.join(f'{e:.1e}' for e in errors)} at h = 0.05, 0.025)",
            slope > 7.7,
        ),
    ]


def memory(steps: int = 100_000) -> list[Row]:
    """The adjoint over many steps that are not kept but run again between checkpoints."""
    m, names = springs(2)
    psi = mb.Final(lambda s: s.position("b3")[1])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    found = mb.gradient(m, psi, names, t=1e-4 * steps, step=1e-4, method="adjoint", keep=0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    counts = found.stats.counts
    text = (
        f"{counts['checkpoints']} checkpoints, {counts['steps']} steps forwards, peak memory +{grown:.0f} MB, "
        f"{time.perf_counter() - start:.0f} s"
    )
    bounded = counts["checkpoints"] <= 2 * np.sqrt(steps) and counts["steps"] <= 2 * steps + 1
    return [Row(f"adjoint over {steps} steps", "memory bounded by the checkpoints", text, bool(bounded))]


MEASUREMENTS: dict[str, Callable[[], list[Row]]] = {
    "double_pendulum": double_pendulum,
    "cost": cost,
    "car": car,
    "order": order,
    "explicit": explicit,
    "implicit": implicit,
}


def main(arguments: Iterable[str]) -> None:
    arguments = list(arguments)
    chosen = dict(MEASUREMENTS)
    if {"--memory", "memory"} & set(arguments):
        chosen["memory"] = memory
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        run(selected(chosen, arguments), arguments, BEGIN, END, PROGRAMS, f" {build()}")


if __name__ == "__main__":
    main(sys.argv[1:])
