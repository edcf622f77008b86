"""Every figure that motion in time should reach, measured, beside Exudyn where it is installed.

    OPENBLAS_NUM_THREADS=1 python benches/motion.py [--write] [name ...]

CPU seconds of this process (one BLAS thread), the best of several repeats; ratios are of runs in this one process. True
motions are those of tests/models/motion_problems.py: closed forms, and equations written by hand for DOP853 at 1e-13. ``--write``
puts the table into benches/README.md.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import mbrs as mb
import motion_effects
import numpy as np
import rivals_motion as rivals
from mbrs.studies.measures import motion_difference
from tables import Row, cpu, ms, of_tests, run, selected

zoo, true = of_tests("motion_problems"), of_tests("motion_truths")
BEGIN, END = "<!-- motion table begins -->", "<!-- motion table ends -->"
PROGRAMS = ("numpy", "scipy", "exudyn")
TOLERANCES = 10.0 ** -np.arange(3.0, 11.0)


def exudyn(run: Callable[[], Any]) -> Any:
    """None where Exudyn is not installed or its solver gives up."""
    try:
        return run()
    except ImportError:
        return None
    except Exception as reason:  # what its solver raises has no common type
        print(f"Exudyn: {reason}", file=sys.stderr)
        return None


def quiet(m: Any, **options: Any) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        return mb.simulate(m, **options)


# --- N four-bar -----


def tip_after(n: int, end: float) -> np.ndarray:
    phi = true.four_bars([end], n, 1.0)[0]
    return np.array([np.sin(phi), np.cos(phi)])


def reached(n: int, end: float, rtol: float) -> tuple[float, float]:
    """Energy drift (J) and error of the tip (m) of mbrs with spatial bodies and hinges."""
    traj = quiet(mb.examples.four_bars(n), t=end, rtol=rtol)
    energy = traj.energy.total
    return float(np.max(np.abs(energy - energy[0]))), float(
        np.linalg.norm(traj.point("tip")[-1, :2] - tip_after(n, end))
    )


def cheapest(n: int, end: float, drift: float, tip: float) -> tuple[float, float, float, float]:
    """The loosest tolerance that keeps energy and tip within limits, with the next ones tighter too; its CPU seconds."""
    found = {}
    for rtol in 10.0 ** -np.arange(2.0, 11.5, 0.5):
        found[rtol] = reached(n, end, rtol)
        kept = [d <= drift and e <= tip for d, e in found.values()]
        if len(kept) >= 2 and all(kept[-2:]):
            break
    else:
        return np.nan, np.nan, np.nan, np.nan
    rtol = list(found)[-2]
    m = mb.examples.four_bars(n)
    seconds = cpu(lambda: quiet(m, t=end, rtol=rtol), repeats=3)
    return seconds, rtol, *found[rtol]


def four_bars() -> list[Row]:
    rows, end = [], 10.0
    for n in (1, 10, 40):
        exact = tip_after(n, end)
        runs = []
        for h in (1e-2, 5e-3, 4e-3, 2e-3, 1e-3):
            made = exudyn(lambda n=n, h=h: rivals.four_bars(n, h, end))
            if made is not None:
                runs.append((*made[:2], float(np.linalg.norm(made[2] - exact)), h))
        good = [r for r in runs if r[1] <= 0.1 and r[2] <= 1e-2]
        rows.append(_against(n, end, min(good, default=None), 0.1, 1e-2, "energy within .1 J, tip within 1e-2 m"))
        last = runs[-1] if runs else None
        limits = last[1:3] if last else (1e-3, 1e-4)
        rows.append(_against(n, end, last, *limits, "the accuracy of Exudyn at h = 1e-3"))
    return rows


def _against(n: int, end: float, rival: Any, drift: float, tip: float, words: str) -> Row:
    what = f"N four-bar, N = {n}, 10 s, {words}"
    seconds, rtol, own_drift, own_tip = cheapest(n, end, drift, tip)
    text = f"{ms(seconds)} at rtol {rtol:.0e} ({own_drift:.1e} J, {own_tip:.1e} m)"
    if rival is None:
        return Row(what, "5 times faster", text, None, "Exudyn not run, or none of its steps reaches it")
    other, its_drift, its_tip, h = rival
    beside = f"Exudyn {ms(other)} at h = {h:g} ({its_drift:.1e} J, {its_tip:.1e} m): {other / seconds:.1f} x"
    return Row(what, "5 times faster", text, other >= 5 * seconds, beside)


def growth() -> list[Row]:
    """CPU seconds for a second of motion over the number of bars; stops where the next would take a minute."""
    sizes, seconds = [], []
    for n in (10, 30, 100, 300, 1000):
        if len(seconds) > 1 and seconds[-1] * (n / sizes[-1]) * (seconds[-1] / seconds[-2]) > 200.0:
            break
        m = mb.examples.four_bars(n)
        seconds.append(cpu(lambda m=m: quiet(m, t=1.0, rtol=1e-6), repeats=1, least=0.0))
        sizes.append(n)
    large = [i for i, n in enumerate(sizes) if n >= 30]
    slope = np.polyfit(np.log([sizes[i] for i in large]), np.log([seconds[i] for i in large]), 1)[0]
    text = ", ".join(f"N = {n} {ms(s)}" for n, s in zip(sizes, seconds, strict=True)) + f"; exponent {slope:.2f}"
    return [
        Row("N four-bar, 1 s at rtol 1e-6: growth with N", "linear up to 1000", text, sizes[-1] == 1000 and slope < 1.2)
    ]


# --- heavy top -----


def heavy_top() -> list[Row]:
    problem = zoo.heavy_top(t=2.0)
    exact = problem.answer(np.array([2.0]))["top"][0]

    def off(position: np.ndarray) -> float:
        return float(np.linalg.norm(position - exact))

    rows = []
    for rtol in 10.0 ** -np.arange(7.0, 12.5, 0.5):
        traj = quiet(problem.model, t=2.0, rtol=rtol)
        if off(traj.position("top")[-1]) <= 1e-9:
            break
    error = off(traj.position("top")[-1])
    seconds = cpu(lambda: quiet(problem.model, t=2.0, rtol=rtol), repeats=5)
    own, texts = f"{ms(seconds)} ({traj.method}, rtol {rtol:.0e}, {error:.1e} m)", []
    for solver, h in (("GeneralizedAlpha", 1e-4), ("RK67", 2e-4), ("RK67", 1e-4)):
        made = exudyn(lambda solver=solver, h=h: rivals.heavy_top(solver, h, 2.0))
        texts.append(
            f"Exudyn {solver} h = {h:g} not run"
            if made is None
            else f"Exudyn {solver} {ms(made[0])} (h = {h:g}, {off(made[1]):.1e} m)"
        )
    reached = error <= 1e-9 and seconds <= 0.05
    rows.append(Row("heavy top, 2 s, by `auto`", "1e-9 m in 50 ms", own, reached, "; ".join(texts)))
    short = zoo.heavy_top(t=0.2)
    for method, order in (("generalized-alpha", 2), ("bdf", 4), ("bdf-bfgs", 4)):
        rows.append(_order(short, method, order))
    return rows


def _order(problem: Any, method: str, order: int) -> Row:
    what, errors = f"heavy top, order of {method} with fixed steps", []
    steps = (400, 800, 1600) if method != "generalized-alpha" else (800, 1600, 3200)
    try:
        for n in steps:
            traj = quiet(problem.model, t=[problem.t], step=problem.t / n, method=method)
            errors.append(problem.error(traj.t, problem.places(traj)))
    except mb.MbrsError as reason:
        return Row(what, str(order), f"not run: {str(reason)[:80]}")
    slopes = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    text = f"{slopes[-1]:.2f} (errors {', '.join(f'{e:.1e}' for e in errors)} m)"
    return Row(what, str(order), text, bool(abs(slopes[-1] - order) < 0.25))


# --- errors over the zoo -----


def tight(problem: Any, times: np.ndarray) -> Any:
    """A run that the truth confirms, to compare rotations with as well."""
    for rtol in (1e-12, 3e-12, 3e-13, 3e-11, 1e-10):
        traj = quiet(problem.model, t=times, rtol=rtol, method="explicit")
        if problem.error(traj.t, problem.places(traj)) < 1e-9 * max(problem.length, 1.0):
            return traj
    raise RuntimeError(f"no tight run of {problem.name} agrees with its truth")


def slopes() -> list[Row]:
    rows = []
    for method, tolerances in (("explicit", TOLERANCES), ("bdf", TOLERANCES), ("generalized-alpha", TOLERANCES[:4])):
        found = {}
        for name, make in zoo.SMOOTH.items():
            problem = make()
            times = np.linspace(0.0, problem.t, 9)
            exact = tight(problem, times)
            try:
                errors = [
                    motion_difference(quiet(problem.model, t=times, rtol=r, method=method), exact) for r in tolerances
                ]
            except mb.MbrsError as reason:
                print(f"{name}, {method}: {str(reason)[:100]}", file=sys.stderr)
                continue
            found[name] = float(np.polyfit(np.log10(tolerances), np.log10(errors), 1)[0])
        inside = [n for n, s in found.items() if 0.8 <= s <= 1.2]
        others = ", ".join(f"{n} {s:.2f}" for n, s in found.items() if n not in inside) or "none"
        what = f"slope of error against tolerance, {tolerances[0]:.0e} to {tolerances[-1]:.0e}, {method}"
        text = f"{len(inside)} of {len(zoo.SMOOTH)} problems; outside: {others}"
        rows.append(Row(what, "0.8 to 1.2 on at least 12", text, len(inside) >= 12))
    return rows


def estimates(count: int = 200) -> list[Row]:
    """`traj.error` against the true error at random tolerances and ends."""
    rng, names, ratios = np.random.default_rng(5), list(zoo.SMOOTH), []
    for i in range(count):
        problem = zoo.SMOOTH[names[i % len(names)]]()
        times = np.linspace(0.0, problem.t * rng.uniform(0.3, 1.0), 9)
        exact = tight(problem, times)
        traj = quiet(problem.model, t=times, rtol=10.0 ** rng.uniform(-9.0, -4.0))
        ratios.append(motion_difference(traj, exact) / traj.error)
    near = float(np.mean((np.array(ratios) >= 0.1) & (np.array(ratios) <= 10.0)))
    low, middle, high = np.quantile(ratios, [0.025, 0.5, 0.975])
    text = (
        f"{100 * near:.1f} % of {count} runs; true/estimated: median {middle:.2f}, 95 % within {low:.2f} to {high:.2f}"
    )
    return [Row("`traj.error` within a factor 10 of the true error", "95 % of runs", text, near >= 0.95)]


def residuals() -> list[Row]:
    rows = []
    for method in ("auto", "generalized-alpha", "bdf", "bdf-bfgs"):
        worst, where = np.zeros(3), ""
        try:
            for name in (
                "four_bars",
                "slider_crank",
                "spherical_pendulum",
                "five_bar",
                "skate",
                "swing",
                "rolling_disc",
            ):
                problem = zoo.SMOOTH[name]()
                how: dict[str, Any] = {"rtol": 1e-6} if method == "auto" else {"step": problem.t / 400}
                traj = quiet(problem.model, t=np.linspace(0.0, problem.t, 101), method=method, **how)
                found = traj.residual.max(axis=0)
                where = name if found[1] > worst[1] else where
                worst = np.maximum(worst, found)
        except mb.MbrsError as reason:
            rows.append(Row(f"constraint residuals, {method}", "at most 1e-10", f"not run: {str(reason)[:80]}"))
            continue
        text = f"positions {worst[0]:.0e}, velocities {worst[1]:.0e} ({where}), accelerations {worst[2]:.0e}"
        rows.append(
            Row(
                f"constraint residuals at every output, {method}",
                "at most 1e-10",
                text,
                bool(np.all(worst[:2] < 1e-10)),
            )
        )
    return rows


# --- stages -----


def stages() -> list[Row]:
    """Tree coordinates projected once per step, beside independent coordinates in every stage."""
    rows = []
    names = ("four_bars", "slider_crank", "five_bar", "spherical_pendulum", "swing", "skate", "rolling_disc")
    for name in names:
        problem = zoo.SMOOTH[name]()

        def off(traj: Any, problem: Any = problem) -> float:
            return float(problem.error(traj.t, problem.places(traj)))

        rows.append(_ways(name, problem.model, problem.t, 1e-7, off))
    for n in (1, 10, 40):

        def tip(traj: Any, n: int = n) -> float:
            return float(np.linalg.norm(traj.point("tip")[-1, :2] - tip_after(n, 10.0)))

        rows.append(_ways(f"{n} four-bars, 10 s", mb.examples.four_bars(n), 10.0, 1e-6, tip))
    return rows


def _ways(name: str, m: Any, end: float, rtol: float, off: Callable[[Any], float]) -> Row:
    texts, seconds = {}, {}
    for way in ("tree", "independent"):
        options = {"t": [end], "rtol": rtol, "method": "explicit", "coordinates": way}
        traj = quiet(m, **options)
        n = traj.stats.counts
        seconds[way] = cpu(lambda options=options: quiet(m, **options), repeats=5)
        factors = n.get("mass factorisations", 0) + n.get("reduced factorisations", 0)
        texts[way] = (
            f"{way}: {ms(seconds[way])}, {off(traj):.1e} m, {len(traj.steps) - 1} steps, {factors} factorisations, "
            f"{n.get('coordinate switches', 0)} switches"
        )
    chosen = "independent" if "independent" in quiet(m, t=[end], rtol=rtol, method="explicit").stats.route else "tree"
    other = "tree" if chosen == "independent" else "independent"
    what = f"{name}, explicit at rtol {rtol:.0e}: the default of tree and independent coordinates"
    # two runs of one program differ by a tenth on a machine that others use as well
    cheaper = seconds[chosen] <= 1.1 * seconds[other]
    return Row(what, "the cheaper one", texts[chosen], cheaper, texts[other])


MEASUREMENTS: dict[str, Callable[[], list[Row]]] = {
    "four_bars": four_bars,
    "growth": growth,
    "heavy_top": heavy_top,
    "slopes": slopes,
    "estimates": estimates,
    "residuals": residuals,
    "effects": motion_effects.rows,
    "stages": stages,
}


def build() -> str:
    """Which core was measured: a development build is several times slower."""
    import mbrs._core as core

    size = Path(core.__file__).stat().st_size / 1e6
    return f"Core of {size:.0f} MB ({'release' if size < 30 else 'development'} build)."


def main(arguments: Iterable[str]) -> None:
    arguments = list(arguments)
    run(selected(MEASUREMENTS, arguments), arguments, BEGIN, END, PROGRAMS, f" {build()}")


if __name__ == "__main__":
    main(sys.argv[1:])
