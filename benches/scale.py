"""Large and stiff models: ladders of closed loops, dense eigenvalues, sampling, long chains, stiff motion; beside SciPy.

    python benches/scale.py [--write] [--long] [name ...]

CPU seconds of this process (one BLAS thread), the best of several repeats; ratios are of runs in this one process. ``--long`` adds
the ladder of 10 000 layers. ``--write`` puts the table into benches/README.md.
"""

from __future__ import annotations

import contextlib
import itertools
import resource
import sys
import time
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any
from unittest import mock

import mbrs as mb
import numpy as np
import scipy.linalg
import scipy.sparse as sparse
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import eigs
from tables import Row, cpu, ms, of_tests, one_thread, run, selected

BEGIN, END = "<!-- scale table begins -->", "<!-- scale table ends -->"
PROGRAMS = ("numpy", "scipy")
truth = of_tests("problems")
LADDER = truth.LADDERS[0]
LONG = 10_000
COUNT = 20


def once(work: Callable[[], Any]) -> tuple[float, Any]:
    """CPU seconds of one call, and what it returns."""
    begin = time.process_time()
    found = work()
    return time.process_time() - begin, found


# --- ladders -----


def rows_and_stiffness(m: Any) -> tuple[Any, Any, Any]:
    """Mass, stiffness and rows of all hinges of a model in absolute coordinates, sparse: five rows a hinge, nothing removed."""
    masses, stiff, entries = [], [], []
    for b in m.bodies:
        R = rotation(m.value(f"{b.name}.orientation"))
        masses += [m.value(f"{b.name}.mass") * np.eye(3), R @ m.value(f"{b.name}.inertia") @ R.T]
    row = 0
    for j in m.joints:
        axis = np.array(m.value(f"{j.name}.axis"))
        point = np.array(m.value(f"{j.name}.at"))
        across = scipy.linalg.null_space(axis[None, :]).T
        for sign, i in ((-1.0, j.a), (1.0, j.b)):
            if i < 0:
                continue
            x, y, z = point - np.array(m.value(f"{m.bodies[i].name}.at"))
            lever = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
            block = sign * np.block([[np.eye(3), lever], [np.zeros((2, 3)), across]])
            entries.append((row, 6 * i, block))
            stiff.append((row // 5, 6 * i + 3, sign * axis[None, :] * np.sqrt(m.value(f"{j.name}.k"))))
        row += 5
    n = 6 * len(m.bodies)
    made = [sparse_of(parts, (count, n)) for parts, count in ((entries, row), (stiff, row // 5))]
    return sparse.block_diag(masses, format="csc"), made[1].T @ made[1], made[0]


def rotation(q: Any) -> np.ndarray:
    """Matrix of a quaternion, scalar first."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(np.array(q), -1)).as_matrix()


def sparse_of(parts: list[tuple[int, int, np.ndarray]], shape: tuple[int, int]) -> Any:
    """Matrix of dense blocks at (row, column)."""
    places = [(r + np.arange(b.shape[0])[:, None] + 0 * b, c + np.arange(b.shape[1]) + 0 * b, b) for r, c, b in parts]
    r, c, b = (np.concatenate([p[k].ravel() for p in places]) for k in range(3))
    return sparse.csc_matrix((b, (r.astype(int), c.astype(int))), shape=shape)


def by_scipy(m: Any) -> np.ndarray:
    """Lowest frequencies from the saddle system of all rows, shifted and inverted; redundant rows need the regularisation."""
    M, K, B = rows_and_stiffness(m)
    rows = B.shape[0]
    size = 1e-12 * sparse.identity(rows, format="csc")
    A = sparse.bmat([[K, B.T], [B, -size]], format="csc")
    weight = sparse.block_diag([M, sparse.csc_matrix((rows, rows))], format="csc")
    values = eigs(A, k=COUNT, M=weight, sigma=0.0, return_eigenvectors=False)
    return np.sort(np.sqrt(np.abs(values)))


def ladders(sizes: tuple[int, ...] = (100, 300, 1000)) -> list[Row]:
    rows, seconds = [], {}
    for n in sizes:
        known = truth.ladder(n, **LADDER)
        m, exact = known.model, known.answer["omega"][:COUNT]
        spent, found = once(lambda m=m: (mb.System(m.copy()), mb.modes(m.copy(), n=COUNT)))
        seconds[n] = spent
        error = float(np.abs(found[1].omega / exact - 1).max())
        damped = m.copy()
        for i in range(1, n + 1, 3):
            damped.spring_damper(f"d{i}", f"R{i}", "ground" if i == 1 else f"R{i - 1}", k=0.0, c=0.3, at=slanting(m, i))
        with_dampers, _ = once(lambda d=damped: mb.modes(d, n=COUNT))
        text = (
            f"{spent:.3g} s (with dampers {with_dampers:.3g} s), error {error:.0e}, estimate {found[1].error.max():.0e}, "
            f"{sum(found[0].redundant.values())} redundant rows by name"
        )
        if n <= 1000:
            theirs, omega = once(lambda m=m: by_scipy(m))
            beside = f"SciPy `eigs` {theirs:.3g} s, error {np.abs(omega / exact - 1).max():.0e}"
            rows.append(Row(f"ladder of {n}: System and 20 modes", "SciPy's time", text, spent <= theirs, beside))
        else:
            memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
            reached = spent <= 15.0 and with_dampers <= 35.0 and error <= 1e-8 and memory <= 4.0
            goal = "15 s, with dampers 35 s, 1e-8, 4 GB"
            rows.append(Row(f"ladder of {n}: System and 20 modes", goal, f"{text}, {memory:.1f} GB", reached))
    if len(sizes) > 1:
        exponent = np.log(seconds[sizes[-1]] / seconds[sizes[0]]) / np.log(sizes[-1] / sizes[0])
        what = f"the same: growth with the number of layers, {sizes[0]} to {sizes[-1]}"
        rows.append(Row(what, "exponent 1.2", f"{exponent:.2f}", exponent <= 1.2))
    return rows


def slanting(m: Any, i: int) -> tuple[np.ndarray, np.ndarray]:
    """The ends of a damper across layer i."""
    return np.array(m.value(f"b{i},1.at")), np.array(m.value(f"a{i},0.at"))


def reduction() -> list[Row]:
    """M, C, K in independent coordinates against singular values and products in NumPy."""
    m = truth.ladder(160, **LADDER).model
    ours = cpu(lambda: mb.linearize(m), repeats=3)

    def plain() -> Any:
        M, K, B = (x.toarray() for x in rows_and_stiffness(m))
        Z = scipy.linalg.null_space(B)
        return Z.T @ M @ Z, Z.T @ K @ Z

    theirs, _ = once(plain)
    text = f"{ms(ours)}: {theirs / ours:.0f} times as fast"
    return [
        Row(
            "ladder of 160: M, C, K in independent coordinates",
            "10 times as fast",
            text,
            theirs >= 10 * ours,
            f"NumPy {ms(theirs)}",
        )
    ]


# --- dense eigenvalues -----


def trees() -> list[Row]:
    rows = []
    for code in ("TL7SF1", "TL8SF1"):
        lin = mb.linearize(mb.examples.from_code(code))
        A = np.linalg.solve(lin.M, np.hstack([-lin.K, -lin.C]))
        state = np.vstack([np.hstack([np.zeros_like(lin.M), np.eye(len(lin.M))]), A])
        ours, modes = once(lambda lin=lin: mb.modes(lin))
        theirs, _ = once(lambda state=state: scipy.linalg.eig(state))
        text = f"{ours:.3g} s: ratio {ours / theirs:.2f} (route {modes.stats.route})"
        what = f"{code}, {len(state)} states: all modes with estimates, over `scipy.linalg.eig`"
        rows.append(Row(what, "at most 1.2", text, ours <= 1.2 * theirs, f"SciPy {theirs:.3g} s"))
    return rows


# --- harmonic balance -----


def balance() -> list[Row]:
    """Set-up included: a curve of 100 points; Jenkins with the samples that the tolerance asks for."""
    import rivals_nonlinear as rivals

    M, C, K, middle, k = rivals.chain(1000)
    w, force = np.zeros(1000), np.zeros(1000)
    w[middle], force[middle] = 1.0, 0.02 * k
    system = mb.MechanicalSystem(M, C, K, elements=[mb.Cubic(0.2 * k, w=w)])

    def curve() -> int:
        branch = mb.Branch(system, force=force, omega=(0.8, 1.3), harmonics=7, stability=False)
        return int(branch.run(100))

    # what is imported when a curve is first asked for is not part of any
    small = mb.MechanicalSystem([[1.0]], [[0.02]], [[1.0]], elements=[mb.Cubic(0.2, w=[1.0])])
    mb.Branch(small, force=[0.1], omega=(0.8, 1.3), harmonics=7, stability=False).run(1)
    seconds, points = once(curve)
    each = seconds / points
    rows = [
        Row(
            "chain of 1000, one cubic spring, set-up included",
            "at most .5 ms a point",
            f"{ms(each)} a point, {points} points",
            each <= 5e-4,
        )
    ]
    jenkins = mb.MechanicalSystem([[1.0]], [[0.02]], [[1.0]], elements=[mb.Jenkins(0.5, 0.1, w=[1.0])])
    options: dict[str, Any] = {"force": [0.1], "omega": (0.6, 1.6), "harmonics": 15, "tol": 0.1, "stability": False}
    found = mb.frequency_response(jenkins, **options)
    spent = cpu(lambda: mb.frequency_response(jenkins, **options), repeats=2)
    text = f"{ms(spent)}, {len(found)} points"
    return [*rows, Row("Jenkins, one coordinate, H = 15, tol .1", "at most 100 ms", text, spent <= 0.1)]


# --- motion -----


def accelerations() -> list[Row]:
    """One evaluation: the difference of two motions that differ in the number of their steps."""
    rows = []
    for n, goal in ((200, 0.05e-3), (1000, 0.25e-3)):
        m = of_tests("random_models").hinged_chain(n)
        short, long = (partial(mb.simulate, m, [1e-6 * k], step=1e-6, method="explicit") for k in (2, 2 + 2000 // n))
        evaluations = [f().stats.counts["force evaluations"] for f in (short, long)]
        each = (cpu(long, repeats=3) - cpu(short, repeats=3)) / (evaluations[1] - evaluations[0])
        beside = "Pinocchio not run" if n == 200 else "Pinocchio's data of 1000 joints need more than 12 GB"
        with contextlib.suppress(ImportError):
            beside = f"Pinocchio's recursion {ms(pinocchio(n))}" if n == 200 else beside
        what = f"accelerations of a chain of {n} links, with their share of a step"
        rows.append(Row(what, f"at most {ms(goal)}", ms(each), each <= goal, beside))
    return rows


def pinocchio(n: int) -> float:
    """CPU seconds of `aba` for a chain of n hinges."""
    import pinocchio as pin

    m, parent = pin.Model(), 0
    inertia = pin.Inertia(0.3, np.array([0.3, 0.15, -0.1]), np.diag([0.01, 0.012, 0.009]))
    rng = np.random.default_rng(n)
    for i in range(n):
        axis = rng.normal(size=3)
        place = pin.SE3(np.eye(3), np.array([0.6, 0.3, -0.2]) if i else np.zeros(3))
        parent = m.addJoint(parent, pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis)), place, f"j{i}")
        m.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    data, q, zero = m.createData(), pin.neutral(m), np.zeros(m.nv)
    return cpu(lambda: pin.aba(m, data, q, zero, zero))


def heavy_top() -> list[Row]:
    problem = of_tests("motion_problems").heavy_top(t=2.0)
    made = once(lambda: mb.simulate(problem.model, t=[2.0], step=1e-4, method="generalized-alpha", rho=0.8))
    error = problem.error(made[1].t, problem.places(made[1]))
    text = f"{error:.1e} m in {ms(made[0])}"
    return [Row("heavy top, 2 s, generalised-alpha, step 1e-4, rho = .8", "2e-4 m", text, error <= 2e-4)]


def governor() -> list[Row]:
    """Times at which both are right to 1e-7 m, over tolerances."""
    zoo, end = of_tests("motion_problems"), 10.0
    problem, runs = zoo.governor(t=end), {}
    exact = problem.answer(np.array([end]))

    def off(places: dict[str, np.ndarray]) -> float:
        return max(float(np.abs(places[name] - exact[name]).max()) for name in exact)

    for rtol in 10.0 ** -np.arange(6.0, 12.0, 0.5):
        spent, traj = once(lambda rtol=rtol: mb.simulate(problem.model, t=[end], rtol=rtol, method="radau"))
        if off(problem.places(traj)) <= 1e-7:
            runs["mbrs"] = spent, rtol, off(problem.places(traj))
            break

    def solved(slope: Any, y0: Any, times: Any, rtol: float) -> np.ndarray:
        return solve_ivp(slope, (0, times[-1]), y0, method="Radau", t_eval=times, rtol=rtol, atol=rtol * 1e-3).y.T

    for rtol in 10.0 ** -np.arange(6.0, 12.0, 0.5):
        with mock.patch.object(zoo.true, "governor", partial(zoo.true.governor, solve=partial(solved, rtol=rtol))):
            spent, places = once(lambda: problem.answer(np.array([end])))
        if off(places) <= 1e-7:
            runs["SciPy"] = spent, rtol, off(places)
            break
    told = {k: f"{ms(s)} at rtol {r:.0e}, {e:.0e} m" for k, (s, r, e) in runs.items()}
    ahead = "mbrs" in runs and ("SciPy" not in runs or runs["mbrs"][0] <= runs["SciPy"][0])
    beside = f"SciPy's Radau on equations by hand {told.get('SciPy', 'does not reach it')}"
    return [Row("stiff governor, 10 s, 1e-7 m", "ahead of SciPy", told.get("mbrs", "does not reach it"), ahead, beside)]


MEASUREMENTS: dict[str, Callable[[], list[Row]]] = {
    "ladders": ladders,
    "reduction": reduction,
    "trees": trees,
    "balance": balance,
    "accelerations": accelerations,
    "heavy_top": heavy_top,
    "governor": governor,
}


def main(arguments: list[str]) -> None:
    chosen = dict(MEASUREMENTS)
    if "--long" in arguments:
        chosen = dict(itertools.chain([("long ladder", lambda: ladders((LONG,)))], chosen.items()))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run(selected(chosen, arguments), arguments, BEGIN, END, PROGRAMS)


if __name__ == "__main__":
    one_thread()
    main(sys.argv[1:])
