"""Free wakes: pairs of filaments and points a second beside NumPy's, what a turn costs and where, error against time.

python benches/aero.py [--threads n]

Ratios of one run; nothing else may run on the machine.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time

import mbrs as mb
import numpy as np


def pairs(threads: int) -> None:
    """Pairs a second of the core, of all its threads and of NumPy with vectors over the filaments."""
    rng = np.random.default_rng(1)
    points, start = rng.normal(size=(2000, 3)), rng.normal(size=(4000, 3))
    end, gamma = start + 0.1 * rng.normal(size=(4000, 3)), rng.normal(size=4000)
    for core in ("rosenhead-moore", "vatistas", "lamb-oseen"):
        rates = []
        for n in (1, threads):
            best = min(
                timed(
                    lambda n=n, core=core: mb.aero.induced_velocity(
                        points, start, end, gamma, core_radius=0.05, core=core, threads=n
                    )
                )
                for _ in range(3)
            )
            rates.append(len(points) * len(start) / best)
        print(f"{core}: {rates[0]:.3g} pairs/s on one thread, {rates[1]:.3g} on {threads or 'all'}")
    some = points[:40]
    rate = len(some) * len(start) / min(timed(lambda: plain(some, start, end, gamma, 0.05)) for _ in range(3))
    print(f"NumPy, one point after the other, Vatistas: {rate:.3g} pairs/s")


def plain(points: np.ndarray, start: np.ndarray, end: np.ndarray, gamma: np.ndarray, radius: float) -> np.ndarray:
    """The law of Biot and Savart with Vatistas' core, as one writes it."""
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


def timed(work) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def turbine() -> mb.aero.Rotor:
    a = np.radians(np.arange(-20.0, 20.5, 1.0))
    section = mb.aero.polar(a, 2 * np.pi * np.sin(a), 0.008 + 0.01 * a**2).extend(aspect_ratio=17.0)
    x = np.linspace(0.15, 1.0, 18) * 40.0
    phi = 2 / 3 * np.arctan(40.0 / (7.0 * x))
    chord = 8 * np.pi * x * (1 - np.cos(phi)) / (6 * np.pi * np.sin(np.radians(5.0)))
    return mb.aero.rotor(mb.aero.blade(x, 0.8 * chord, phi - np.radians(5.0), section), 3)


def shares(threads: int) -> None:
    """What a turn of three blades with 20 strips and a wake of ten turns costs, and the share of the core in it."""
    profile = cProfile.Profile()
    profile.enable()
    begin = time.perf_counter()
    found = mb.aero.rotor_wake(
        turbine(), 7.0, turns=4, steps=36, strips=20, free_turns=4.0, mean_turns=2.0, tail_turns=4.0, threads=threads
    )
    seconds = time.perf_counter() - begin
    profile.disable()
    core = sum(row[2] for key, row in pstats.Stats(profile).stats.items() if "_core.induced_velocity" in key[2])  # type: ignore[attr-defined]
    count = found.stats.counts["filament_pairs"]
    print(
        f"a turn in 36 steps, {found.wake}: {seconds / 4:.3g} s, "
        f"{100 * core / seconds:.0f} % of it Biot and Savart's law; {count:.3g} pairs"
    )


def accuracy(threads: int) -> None:
    """Thrust and power of a turbine while the wake is cut finer, one option at a time."""
    rotor = turbine()
    cases = [{"steps": n} for n in (12, 24, 36, 48)] + [{"strips": n} for n in (8, 16, 32)]
    cases += [{"free_turns": n} for n in (1.0, 2.0, 4.0)] + [{"tail_turns": n} for n in (4.0, 10.0, 20.0)]
    cases += [{"core_radius": share * rotor.radius} for share in (0.025, 0.05, 0.1)]
    for options in cases:
        found = mb.aero.performance(rotor, 7.0, inflow="free-wake", turns=10, threads=threads, **options)
        print(
            f"{options}: C_T {found.thrust_coefficient[0]:.4f}, C_P {found.power_coefficient[0]:.4f}, "
            f"spread {found.error[0]:.1e}, {found.stats.wall_time:.3g} s"
        )


if __name__ == "__main__":
    given = argparse.ArgumentParser(description=__doc__)
    given.add_argument("--threads", type=int, default=0)
    asked = given.parse_args()
    pairs(asked.threads)
    shares(asked.threads)
    accuracy(asked.threads)
