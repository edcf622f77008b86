"""Blades in the wind: filaments a second, a turn of a wake, a turn of a flexible rotor, blade elements beside dynbem, error against time.

    OPENBLAS_NUM_THREADS=1 python benches/aero.py [--write] [name ...]

CPU seconds of this process on one thread, the best of a few repeats; ratios are of runs in this one process. numba and dynbem are
needed only beside ours; a row whose rival is not installed says "not run". ``--write`` puts the table into benches/README.md.
"""

from __future__ import annotations

import cProfile
import pstats
import sys
import time
import warnings
from typing import Any

import mbrs as mb
import numpy as np
from tables import Row, cpu, ms, one_thread, run, selected

BEGIN, END = "<!-- aero table begins -->", "<!-- aero table ends -->"
PROGRAMS = ("numpy", "numba", "dynbem")
# Operations of the core's loop for one filament and one point with Vatistas' core (rust/src/aero/kernels.rs): 15 differences and sums of
# vectors, 5 + 7 + 7 + 6 of lengths and products, 26 of the law; divisions and roots count as one.
FLOPS = 66
REPEATS = 3
# s: a turn of the example's rotor
TURN = 60.0 / 17.2


# --- Biot and Savart -----


def plain(points: np.ndarray, start: np.ndarray, end: np.ndarray, gamma: np.ndarray, radius: float) -> np.ndarray:
    """The law of Biot and Savart with Vatistas' core, as one writes it with vectors over the filaments."""
    out = np.empty_like(points)
    line = end - start
    length2 = np.sum(line**2, axis=1)
    for i, p in enumerate(points):
        a, b = p - start, p - end
        across = np.cross(a, b)
        h2 = np.sum(across**2, axis=1) / length2
        one, two = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        shape = (one + two) / (one * two * (one * two + np.sum(a * b, axis=1))) * h2 / np.sqrt(h2**2 + radius**4)
        out[i] = (gamma / (4 * np.pi) * shape) @ across
    return out


def double_loop(points: Any, start: Any, end: Any, gamma: Any, radius: float) -> Any:
    """The same as a loop over points and filaments, for numba."""
    out = np.zeros_like(points)
    for i in range(len(points)):
        for j in range(len(start)):
            ax, ay, az = points[i, 0] - start[j, 0], points[i, 1] - start[j, 1], points[i, 2] - start[j, 2]
            bx, by, bz = points[i, 0] - end[j, 0], points[i, 1] - end[j, 1], points[i, 2] - end[j, 2]
            lx, ly, lz = end[j, 0] - start[j, 0], end[j, 1] - start[j, 1], end[j, 2] - start[j, 2]
            cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            h2 = (cx * cx + cy * cy + cz * cz) / (lx * lx + ly * ly + lz * lz)
            one, two = np.sqrt(ax * ax + ay * ay + az * az), np.sqrt(bx * bx + by * by + bz * bz)
            dot = ax * bx + ay * by + az * bz
            f = (
                gamma[j]
                / (4 * np.pi)
                * (one + two)
                / (one * two * (one * two + dot))
                * h2
                / np.sqrt(h2 * h2 + radius**4)
            )
            out[i, 0] += f * cx
            out[i, 1] += f * cy
            out[i, 2] += f * cz
    return out


def peak() -> float:
    """Operations a second of this machine on one thread: what a product of matrices reaches."""
    a = np.random.default_rng(0).normal(size=(1000, 1000))
    return 2e9 / cpu(lambda: a @ a, REPEATS)


def pairs() -> list[Row]:
    rng = np.random.default_rng(1)
    points, start = rng.normal(size=(1000, 3)), rng.normal(size=(1000, 3))
    end, gamma = start + 0.1 * rng.normal(size=(1000, 3)), rng.normal(size=1000)
    given = (points, start, end, gamma)
    n = len(points) * len(start)
    rates, found = {}, {}
    for core in ("vatistas", "rosenhead-moore", "lamb-oseen"):
        rates[core] = n / cpu(
            lambda core=core: mb.aero.induced_velocity(*given, core_radius=0.05, core=core, threads=1), REPEATS
        )
    ours = mb.aero.induced_velocity(*given, core_radius=0.05, core="vatistas", threads=1)
    beside = "numba not run"
    try:
        import numba

        compiled = numba.njit(double_loop)
        found["numba"] = compiled(*given, 0.05)
        rate = n / cpu(lambda: compiled(*given, 0.05), REPEATS)
        beside = f"numba {rate:.2e} ({rates['vatistas'] / rate:.2g} x)"
    except ImportError:
        pass
    some = points[:40]
    found["numpy"] = plain(some, *given[1:], 0.05)
    rate = len(some) * len(start) / cpu(lambda: plain(some, *given[1:], 0.05), REPEATS)
    off = max(np.abs(v - ours[: len(v)]).max() / np.abs(ours).max() for v in found.values())
    top = peak()
    others = ", ".join(f"{core} {rates[core]:.2e}" for core in list(rates)[1:])
    return [
        Row("Biot and Savart with Vatistas' core, 1000 filaments at 1000 points: pairs a second", "",
            f"{rates['vatistas']:.2e}; {others}", None,
            f"{beside}; NumPy's vectors {rate:.2e} ({rates['vatistas'] / rate:.2g} x); differences {off:.0e}"),
        Row("the same over the peak of one core", "", f"{100 * FLOPS * rates['vatistas'] / top:.0f} % ({FLOPS} operations a pair)", None,
            f"product of matrices: {top:.2e} operations a second"),
    ]  # fmt: skip


# --- wakes -----


def turbine() -> mb.aero.Rotor:
    a = np.radians(np.arange(-20.0, 20.5, 1.0))
    section = mb.aero.polar(a, 2 * np.pi * np.sin(a), 0.008 + 0.01 * a**2).extend(aspect_ratio=17.0)
    x = np.linspace(0.15, 1.0, 18) * 40.0
    phi = 2 / 3 * np.arctan(40.0 / (7.0 * x))
    chord = 8 * np.pi * x * (1 - np.cos(phi)) / (6 * np.pi * np.sin(np.radians(5.0)))
    return mb.aero.rotor(mb.aero.blade(x, 0.8 * chord, phi - np.radians(5.0), section), 3)


def profiled(work: Any) -> tuple[float, Any, dict[Any, Any]]:
    """CPU seconds of one call without a profile, what it returns, and the rows of a second call's profile."""
    begin = time.process_time()
    found = work()
    seconds = time.process_time() - begin
    profile = cProfile.Profile(time.process_time)
    profile.runcall(work)
    return seconds, found, pstats.Stats(profile).stats  # type: ignore[attr-defined]


def wake() -> list[Row]:
    """Three blades with 20 strips; ten turns of wake, of which four are free, two go over and four are prescribed."""
    turns = 4

    def work() -> Any:
        return mb.aero.rotor_wake(
            turbine(), 7.0, turns=turns, steps=36, strips=20, free_turns=4.0, mean_turns=2.0, tail_turns=4.0, threads=1
        )

    seconds, found, rows = profiled(work)
    total = max(row[3] for row in rows.values())
    core = sum(row[2] for key, row in rows.items() if "induced_velocity" in key[2] and key[0] == "~")
    pairs_ = found.stats.counts["filament_pairs"]
    return [
        Row("free wake of ten turns, three blades of 20 strips: a turn in 36 steps", "", f"{seconds / turns:.3g} s",
            None, f"{100 * core / total:.0f} % Biot and Savart's law, {pairs_ / turns:.2e} pairs a turn")
    ]  # fmt: skip


def coupled_rotor(steps: int) -> mb.Model:
    tilt = np.radians(5.0)
    m = mb.examples.wind_rotor()
    m.aerodynamics(
        "air", mb.examples.wind_rotor_blades(), inflow="free-wake", options={"steps": steps, "threads": 1},
        wind=mb.aero.wind(8.0, "x", shear=0.2, reference_height=84.0), axis=(np.cos(tilt), 0.0, np.sin(tilt)),
    )  # fmt: skip
    return m


def coupled() -> list[Row]:
    """One turn of the flexible rotor beside its free wake, which goes on from a third of a turn."""
    m = coupled_rotor(36)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        start = mb.simulate(m, t=np.linspace(0.0, TURN / 3.0, 3), rtol=1e-5).state()
        seconds, _, rows = profiled(
            lambda: mb.simulate(m, t=np.linspace(start.t, start.t + TURN, 73), at=start, rtol=1e-5)
        )
    total = max(row[3] for row in rows.values())
    share = {
        "wake": sum(
            row[3] for key, row in rows.items() if key[0].endswith("coupled.py") and key[2] in ("trial", "accept")
        ),
        "structure": sum(row[2] for key, row in rows.items() if key[0] == "~" and "_core.simulate" in key[2]),
    }
    share["coupling"] = total - sum(share.values())
    law = sum(row[2] for key, row in rows.items() if "induced_velocity" in key[2] and key[0] == "~")
    text = ", ".join(f"{name} {100 * part / total:.0f} %" for name, part in share.items())
    return [
        Row("flexible rotor and its free wake: a turn in steps of 10 degrees", "", f"{seconds:.3g} s", None,
            f"{text}; Biot and Savart's law {100 * law / total:.0f} %")
    ]  # fmt: skip


def example() -> list[Row]:
    """The motion of examples/rotors/rotor_in_wind.py, 30 s."""
    m = coupled_rotor(36)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        begin = time.process_time()
        mb.simulate(m, t=np.linspace(0.0, 30.0, 1201), rtol=1e-5)
    return [
        Row("30 s of that motion, 8.6 turns, with the start of the wake", "", f"{time.process_time() - begin:.3g} s")
    ]


# --- blade elements and momentum -----

RADIUS, ROOT, CHORD, SLOPE, DRAG, TWIST, WIND, SPEED, DENSITY = 5.0, 1.0, 0.25, 5.73, 0.01, 2.0, 8.0, 12.0, 1.2
EQUAL = 1e-5


def momentum() -> list[Row]:
    """A rotor of straight blades without losses: time for a state at equal error of the thrust against each program's own limit."""
    a = np.linspace(-0.6, 0.6, 241)
    section = mb.aero.polar(a, SLOPE * a, np.full(len(a), DRAG))
    blade = mb.aero.blade([ROOT, RADIUS], CHORD, np.radians(TWIST), section)
    rotor = mb.aero.rotor(blade, 3, tip_loss=False, hub_loss=False)
    ratios = np.full(400, SPEED * RADIUS / WIND)

    def thrust(n: int) -> float:
        return float(mb.aero.performance(rotor, ratios[:1], elements=n).thrust(WIND, DENSITY)[0])

    limit, n = thrust(640), 8
    seconds = cpu(lambda: mb.aero.performance(rotor, ratios, elements=n), REPEATS) / len(ratios)
    ours = f"{1e6 * seconds:.3g} us of 400 states at once, {n} elements, error {abs(thrust(n) / limit - 1):.0e} (its own estimate included)"
    return [
        Row(
            f"blade elements and momentum: a state, thrust to {EQUAL:.0e}",
            "",
            ours,
            None,
            dynbem_beside(limit, seconds),
        )
    ]


def dynbem_beside(limit: float, seconds: float) -> str:
    try:
        import dynbem
    except ImportError:
        return "dynbem not run"
    inputs = dynbem.RotorInputs(
        np.radians(-TWIST), 0.0, 0.0, np.eye(3), np.zeros(3), np.array([0.0, 0.0, -WIND]), SPEED, DENSITY
    )
    state = dynbem.QuasiStaticRotorState()
    for n in (8, 16, 32, 48, 64):
        blade = dynbem.BladeGeometry(3, RADIUS, ROOT, CHORD, n_elements=n, tip_loss=False)
        air = dynbem.LinearPolarParameters(0.0, SLOPE, DRAG, 40.0)
        model = dynbem.create_aero(dynbem.RotorDefinition(blade, air), "bem", n_psi_elements=4)
        force = -model.compute_forces(inputs, state)[0].F_world[2]
        if abs(force / limit - 1) <= EQUAL:
            break
    theirs = cpu(lambda: model.compute_forces(inputs, state), REPEATS)
    return f"dynbem {1e6 * theirs:.3g} us ({theirs / seconds:.2g} x), {n} elements, {abs(force / limit - 1):.0e} from our limit"


# --- error against time -----


def accuracy() -> list[Row]:
    """Thrust and power of the turbine while the wake is cut finer, one option at a time."""
    rotor = turbine()
    out = []
    finest = mb.aero.performance(rotor, 7.0, inflow="free-wake", turns=10, threads=1, steps=48, strips=32)
    whole = finest.thrust_coefficient[0], finest.power_coefficient[0]
    for options in ({"steps": 12}, {"steps": 24}, {"steps": 36}, {"strips": 8}, {"strips": 32}, {"free_turns": 1.0}, {"free_turns": 4.0},
                    {"tail_turns": 20.0}, {"core_radius": 1.0}, {"core_radius": 4.0}):  # fmt: skip
        begin = time.process_time()
        found = mb.aero.performance(rotor, 7.0, inflow="free-wake", turns=10, threads=1, **options)
        seconds = time.process_time() - begin
        now = found.thrust_coefficient[0], found.power_coefficient[0]
        named = ", ".join(f"{k} {v:g}" for k, v in options.items())
        off = max(abs(a / b - 1) for a, b in zip(now, whole, strict=True))
        out.append(
            Row(f"wake at the tip speed ratio 7: {named}", "", f"{ms(seconds)}, C_T {now[0]:.4f}, C_P {now[1]:.4f}", None,
                f"{off:.0e} from 48 steps with 32 strips; spread of three turns {found.error[0]:.0e}")
        )  # fmt: skip
    return out


MEASUREMENTS = {
    "pairs": pairs, "momentum": momentum, "wake": wake, "coupled": coupled, "example": example, "accuracy": accuracy,
}  # fmt: skip

if __name__ == "__main__":
    one_thread()
    run(selected(MEASUREMENTS, sys.argv[1:]), sys.argv[1:], BEGIN, END, PROGRAMS)
