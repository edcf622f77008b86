"""Every target of nonlinear vibration, measured, beside other programs where they are installed.

    python benches/nonlinear.py [--write] [name ...]

CPU seconds of this process (one BLAS thread), the best of several repeats; ratios are of runs in this one process. A
program that is not installed says "not run". ``--write`` puts the table into benches/README.md.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mbrs as mb
import numpy as np
import rivals_nonlinear as rivals
from tables import Row, cpu, ms, of_tests, one_thread, run, selected

BEGIN, END = "<!-- nonlinear table begins -->", "<!-- nonlinear table ends -->"
# docs/theory.md (23.6), (23.10), by shooting with rtol 1e-13
PEAK, PEAK_OMEGA, FOLDS = 2.5645599332, 2.3993334635, (2.3996492588, 1.3291743525)
PERIODS = {1.0: 6.66328686, 5.0: 11.61223067, 20.0: 34.68232331}


def _duffing() -> Any:
    return mb.MechanicalSystem([[1.0]], [[rivals.C]], [[1.0]], elements=[mb.Cubic(rivals.K3, w=[1.0])])


def _curve(H: int, stability: bool = False, **more: Any) -> Any:
    span = (rivals.W0, rivals.W1)
    return mb.frequency_response(_duffing(), force=[rivals.F], omega=span, harmonics=H, stability=stability, **more)


def _ours(H: int) -> tuple[np.ndarray, np.ndarray]:
    curve = _curve(H)
    return curve.omega, np.stack([curve.coefficient(0, h) for h in range(H + 1)], axis=1)


def _error(points: tuple[np.ndarray, np.ndarray]) -> float:
    """Largest distance of the points (omega, |a1|), in units of the peak's, from the curve of H = 31, which is followed in
    small steps and interpolated by a spline over its length."""
    from scipy.interpolate import CubicSpline

    fine = _curve(31, step=2e-3, max_step=5e-3)
    plane = np.column_stack([fine.omega / PEAK_OMEGA, fine.amplitude() / PEAK])
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(plane, axis=0), axis=1)))
    curve = CubicSpline(length, plane)
    worst = 0.0
    for omega, c in zip(*points, strict=True):
        at = np.array([omega / PEAK_OMEGA, abs(c[1]) / PEAK])
        s = float(length[np.argmin(np.linalg.norm(plane - at, axis=1))])
        for _ in range(20):
            off, along, bend = curve(s) - at, curve(s, 1), curve(s, 2)
            s -= float(off @ along / (along @ along + off @ bend))
        if length[0] <= s <= length[-1]:
            worst = max(worst, float(np.linalg.norm(curve(s) - at)))
    return worst


def duffing() -> list[Row]:
    """Time per point, the rivals' included, and the error at the same number of harmonics."""
    plain, full = _curve(7), _curve(7, stability=True)
    times = {flag: cpu(lambda flag=flag: _curve(7, stability=flag), repeats=5) for flag in (False, True)}
    per = times[False] / len(plain), times[True] / len(full)
    text = f"{ms(per[0])} per point, {len(plain)} points"
    rows = [Row("Duffing, H = 7, both folds", "at most 0.1 ms per point", text, per[0] <= 1e-4)]
    text = f"{ms(per[1])} per point, {len(full.events)} events located"
    rows.append(Row("the same with stability at every point", "at most 0.3 ms per point", text, per[1] <= 3e-4))
    texts, ratios = [], []
    for name, make in rivals.RIVALS.items():
        try:
            run = make(7)
            points = run()
        except ImportError:
            texts.append(f"{name} not run")
            continue
        theirs = cpu(run, repeats=1) / len(points[0])
        ratios.append(theirs / per[0])
        upper = " (upper branch only)" if name == "mousai" else ""
        texts.append(f"{name} {ms(theirs)} ({ratios[-1]:.0f} x), error {_error(points):.0e}{upper}")
    reached = min(ratios) >= 10 if ratios else None
    own = f"{ms(per[0])}, error {_error(_ours(7)):.0e}"
    goal = "at least 10 times faster, same error"
    rows.append(Row("the same in other programs, per point", goal, own, reached, "; ".join(texts)))
    return rows


def folds() -> list[Row]:
    curve = _curve(31)
    peak = curve.peak(harmonic=None)
    found = sorted((e.omega for e in curve.events if e.kind == "fold"), reverse=True)
    errors = [
        abs(a / b - 1) for a, b in zip([*found, peak.omega, peak.largest()], [*FOLDS, PEAK_OMEGA, PEAK], strict=True)
    ]
    text = f"folds {errors[0]:.0e}, {errors[1]:.0e}; peak at {errors[2]:.0e}, its height {errors[3]:.0e}"
    return [Row("Duffing, H = 31: error of folds and peak", "1e-8 (shooting)", text, max(errors) <= 1e-8)]


def _chain(n: int, law: Callable[..., Any], *numbers: float) -> tuple[Any, np.ndarray]:
    M, C, K, middle, stiffness = rivals.chain(n)
    w, force = np.zeros(n), np.zeros(n)
    w[middle], force[middle] = 1.0, 0.02 * stiffness
    element = law(*(v * stiffness for v in numbers), w=w)
    return mb.MechanicalSystem(M, C, K, elements=[element]), force


@dataclass(frozen=True)
class Timed:
    """CPU seconds per point of a branch once it is set up, and of the set-up (reduction and first point)."""

    point: float
    setup: float
    points: int
    route: str

    @property
    def whole(self) -> float:
        """Seconds per point of the whole curve, its set-up included."""
        return self.point + self.setup / self.points

    def __str__(self) -> str:
        return f"{ms(self.point)} per point, {self.points} points; set-up {ms(self.setup)} ({self.route})"


def _per_point(system: Any, force: np.ndarray, most: int = 1000, repeats: int = 3, **more: Any) -> Timed:
    best = None
    for _ in range(repeats):
        begin = time.process_time()
        branch = mb.Branch(system, force=force, omega=(0.8, 1.3), harmonics=7, stability=False, **more)
        middle = time.process_time()
        points = branch.run(most)
        spent = time.process_time() - middle
        if branch.curve().status == "stopped":
            raise RuntimeError(f"a curve of {len(force)} coordinates stopped after {points} points")
        once = Timed(spent / points, middle - begin, points, branch.setup.route)
        best = once if best is None or once.whole < best.whole else best
    assert best is not None
    return best


def chains() -> list[Row]:
    """One element in a chain of n masses."""
    one = _per_point(*_chain(1000, mb.Cubic, 0.2))
    text = f"{ms(one.whole)} per point: {one}"
    rows = [
        Row(
            "chain of 1000, one cubic spring, H = 7",
            "at most 0.5 ms per point, set-up included",
            text,
            one.whole <= 5e-4,
        )
    ]
    slip = _per_point(*_chain(1000, mb.Jenkins, 0.3, 0.1), n_samples=512)
    text = f"{slip}, 512 samples"
    rows.append(Row("chain of 1000, one Jenkins element, H = 7", "at most 2 ms per point", text, slip.point <= 2e-3))
    rows.append(_growth("chains", lambda n: _chain(n, mb.Cubic, 0.2), (1000, 10_000, 100_000)))
    # finer hinged beams are refused: rounding of double precision would leave nothing of their stiffness
    rows.append(_growth("hinged beams", _beam_of, (1000, 3000, 10_000)))
    rows.append(_growth("beams on an elastic foundation", _rail_of, (1000, 10_000, 100_000)))
    ours = _per_point(*_chain(20, mb.Cubic, 0.2)).point
    try:
        theirs = min(rivals.pyharm_chain(20, 30)() for _ in range(2))
        beside = f"PyHarm {ms(theirs)} ({theirs / ours:.0f} x)"
    except ImportError:
        beside = "PyHarm not run"
    rows.append(Row("chain of 20, one cubic spring, per point", "", ms(ours), None, beside))
    return rows


def _growth(what: str, make: Callable[[int], tuple[Any, np.ndarray]], sizes: tuple[int, ...]) -> Row:
    times = {n: _per_point(*make(n), most=15, repeats=2, condense=True) for n in sizes}
    exponent = np.log(times[sizes[2]].point / times[sizes[1]].point) / np.log(sizes[2] / sizes[1])
    text = ", ".join(f"n = {n:.0e}: {ms(t.point)} ({t.route})" for n, t in times.items())
    return Row(f"{what}, cubic spring, per point over n", "linear (exponent at most 1.2)",
               f"{text}; exponent {exponent:.2f} from {sizes[1]:.0e} to {sizes[2]:.0e}", exponent <= 1.2)  # fmt: skip


def _beam_of(n: int) -> tuple[Any, np.ndarray]:
    """Euler beam on hinges by cubic elements, about n coordinates, a cubic spring at its middle: length pi, bending stiffness
    and mass per length 1, so that the first natural frequency is 1."""
    return _bending(n, np.pi / (n // 2), 0.0)


def _rail_of(n: int) -> tuple[Any, np.ndarray]:
    """A beam of n / 8 on an elastic foundation, elements of 1/4: stiffness of the foundation, bending stiffness and mass per
    length 1, so that waves begin to travel at the frequency 1."""
    return _bending(n, 0.25, 1.0)


def _bending(n: int, h: float, foundation: float) -> tuple[Any, np.ndarray]:
    """About n coordinates of a hinged beam with elements of the length h; lumped mass and foundation."""
    elements = n // 2
    problem = of_tests("problems").hinged_beam(elements, h)
    (M, K), middle = problem.model, problem.notes["middle"]
    K = K + foundation * M
    w, force = np.zeros(K.shape[0]), np.zeros(K.shape[0])
    w[middle], force[middle] = 1.0, 0.02
    return mb.MechanicalSystem(M, 0.02 * M, K, elements=[mb.Cubic(0.2, w=w)]), force


def quasi_periodic() -> list[Row]:
    """Against a solution with many more terms, and against the printed coefficients."""
    printed = {2.0: (-0.0055712601, -0.0832608775, -0.0014475824, -0.0357439837, -0.0003014939, -0.0006886006),
               1.5: (-0.0261221620, -0.2067112787, -0.0045260166, -0.0731946175, -0.0006733389, 0.0102917316)}  # fmt: skip
    index = [(1, 0), (0, 1), (2, -1)]

    def coefficients(found: Any) -> np.ndarray:
        c = [found.coefficient(0, k) for k in index]
        return np.array([v for z in c for v in (z.real, -z.imag)])

    rows, gap = [], 0.0
    for eta, m, limit, seconds in ((2.0, 7, 1e-7, 0.1), (1.5, 13, 1e-8, 1.0)):
        system, forces = mb.examples.two_tone_duffing(eta)
        found = mb.quasi_periodic(system, forces, harmonics=m)
        spent = cpu(lambda s=system, f=forces, m=m: mb.quasi_periodic(s, f, harmonics=m), repeats=2)
        fine = mb.quasi_periodic(system, forces, harmonics=19 if eta < 2 else 11)
        t = np.linspace(0, 200, 4001)
        x, exact = found.displacement(t), fine.displacement(t)
        error = float(np.max(np.abs(x - exact)) / np.max(np.abs(exact)))
        gap = max(
            gap, float(np.max(np.abs(coefficients(mb.quasi_periodic(system, forces, harmonics=7)) - printed[eta])))
        )
        text = (
            f"error {error:.0e} (estimate {found.error:.0e}, integration {found.verify(rtol=1e-12):.0e}) in {ms(spent)}"
        )
        target = f"{limit:.0e} within {seconds:g} s"
        rows.append(
            Row(f"quasi-periodic Duffing, eta = {eta:g}, m = {m}", target, text, error <= limit and spent <= seconds)
        )
    rows.append(Row("the coefficients of docs/theory.md (23.9), m = 7", "to their ten digits", f"largest difference {gap:.0e}",
                    gap <= 6e-11))  # fmt: skip
    rows.append(Row("quasi-periodic response in other programs", "", "", None, "none that installs with pip has it"))
    return rows


def cycles() -> list[Row]:
    rows = []
    for mu, limit, given in (
        (1.0, 1e-10, dict(harmonics=31)),
        (5.0, 1e-10, dict(harmonics=159)),
        (20.0, 1e-6, dict(method="collocation", harmonics=63)),
    ):
        system = mb.examples.van_der_pol(mu)
        found = mb.limit_cycle(system, **given)
        spent = cpu(lambda s=system, g=given: mb.limit_cycle(s, **g), repeats=1)
        known = PERIODS[mu] if mu > 5 else _period_by_shooting(system, found)
        error, printed = abs(found.period / known - 1), abs(found.period - PERIODS[mu])
        source = "nine printed digits" if mu > 5 else f"shooting; differs from the printed period by {printed:.0e}"
        text = f"{error:.0e} against {source} ({found.stats.route}) in {ms(spent)}"
        rows.append(Row(f"van der Pol, mu = {mu:g}: error of the period", f"{limit:.0e}", text, error <= limit))
    return rows


def _period_by_shooting(system: Any, found: Any) -> float:
    """By the plain reference, which integrates in time with a relative tolerance of 1e-12."""
    from mbrs.reference import hbm_shooting

    state = np.concatenate([found.displacement(0.0)[:, 0], found.velocity(0.0)[:, 0]])
    # begun off the cycle, so that it cannot only repeat what it was given
    return float(hbm_shooting.cycle(system, {0: np.zeros(1)}, 1.001 * state, 1.0005 * found.period)[1])


MEASUREMENTS: dict[str, Callable[[], list[Row]]] = {
    "duffing": duffing,
    "folds": folds,
    "chains": chains,
    "quasi-periodic": quasi_periodic,
    "cycles": cycles,
}


def main(arguments: list[str]) -> None:
    used = ("numpy", "scipy", "pyHarm-os", "harmonicbalance", "mousai")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run(selected(MEASUREMENTS, arguments), arguments, BEGIN, END, used)


if __name__ == "__main__":
    one_thread()
    main(sys.argv[1:])
