"""Work-precision of motion in time for docs/accuracy.md: every method of `mb.simulate`, and peers, against true motions."""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Callable
from typing import Any

import mbrs as mb
import numpy as np
import rivals_motion as rivals
from tables import of_tests

TOLERANCES = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9]
# The error of a method of order 2 falls with the square of the step: tighter would take minutes. A method without a tangent
# raises what is asked below 1e-8.
TIGHTEST = {"generalized-alpha": 1e-5, "bdf-bfgs": 1e-8}
# m: how far apart the tight runs may be that stand in for a truth
TRUSTED = 3e-9
LEFT_OUT = "left out: too many steps"


def methods() -> list[str]:
    """The methods that take a tolerance."""
    from mbrs.motion.options import METHODS

    return [m for m in METHODS if m not in ("auto", "ali3p")]


def at_the_end(result: Any, reference: Any) -> float:
    """Distance from the true place at the end, m, the largest of the points whose truth is known."""
    return max(float(np.linalg.norm(result.places[name] - place)) for name, place in reference.items())


def from_another_scheme(result: Any, reference: Any) -> float:
    """Distance from the place at the end by a tight run of another scheme, m, the largest of the points."""
    return at_the_end(result, reference[result.scheme == "explicit"])


class Run:
    """Where the known points were at the end, and what the run said about itself."""

    def __init__(self, places: dict[str, np.ndarray], traj: Any = None) -> None:
        self.places = places
        self.traj = traj
        self.scheme = "" if traj is None else traj.method
        self.status = "finished" if traj is None else traj.status

    @property
    def error(self) -> float | None:
        """The estimate of the run, m. It takes a second run, which the time of the first must not contain."""
        if self.traj is None or self.traj.error is None:
            return None
        return float(self.traj.error * self.traj.snapshot.system.characteristic_length)


def study(problem: Any, rival: Callable[[float], Run] | None = None, repeat: int = 5) -> Any:
    """All methods over the tolerances; ``rival(part)`` makes runs of a peer whose fixed step goes with part = sqrt(rtol)."""
    known = {name: place[-1] for name, place in problem.answer(np.array([problem.t])).items()}
    return _study(problem, known, at_the_end, rival, repeat)


def self_made(problem: Any, repeat: int) -> Any:
    """All methods over the tolerances, against tight runs: of `bdf` for explicit steps, of explicit steps for the others."""
    tight = []
    for method, rtol in (("explicit", 1e-13), ("bdf", 1e-12)):
        traj = mb.simulate(problem.model, t=[problem.t], rtol=rtol, method=method)
        tight.append({name: place[-1] for name, place in problem.places(traj).items()})
    apart = max(float(np.linalg.norm(tight[0][name] - tight[1][name])) for name in tight[0])
    print(f"{problem.name}: the two tight runs are {apart:.1e} m apart", file=sys.stderr)
    # worth nothing as a truth where they disagree
    if apart > TRUSTED:
        raise RuntimeError(f"{problem.name}: tight runs of two schemes differ by {apart:.1e} m")
    return _study(problem, tight, from_another_scheme, None, repeat)


def _study(problem: Any, known: Any, measure: Callable[[Any, Any], float], rival: Any, repeat: int) -> Any:

    def simulate(method: str, rtol: float) -> Run:
        if method == "Exudyn generalized-alpha":
            assert rival is not None
            return rival(float(np.sqrt(rtol)))
        if rtol < 0.99 * TIGHTEST.get(method, 0.0):
            raise mb.ModelError(LEFT_OUT)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mb.MbrsWarning)
            traj = mb.simulate(problem.model, t=[0.0, problem.t], rtol=rtol, method=method)
        return Run({name: place[-1] for name, place in problem.places(traj).items()}, traj)

    lines = methods()
    if rival is not None:
        try:
            importlib.import_module("exudyn")
            lines.append("Exudyn generalized-alpha")
        except ImportError:
            print("Exudyn not run", file=sys.stderr)
    return mb.accuracy_study(simulate, method=lines, rtol=TOLERANCES, reference=known, measure=measure, repeat=repeat)


def _four_bars_in_exudyn(n: int, end: float) -> Callable[[float], Run]:
    def run(part: float) -> Run:
        step = 0.3 * part
        if step < 2e-4:
            raise mb.ModelError(LEFT_OUT)
        _, _, tip = rivals.four_bars(n, end / max(1, round(end / step)), end)
        return Run({"tip": np.array([*tip, 0.0])})

    return run


def _top_in_exudyn(end: float) -> Callable[[float], Run]:
    def run(part: float) -> Run:
        step = 3e-3 * part  # its Newton iterations fail with steps above 1e-4 s
        if step < 9e-6:
            raise mb.ModelError(LEFT_OUT)
        return Run({"top": rivals.heavy_top("GeneralizedAlpha", end / round(end / step), end)[1]})

    return run


def sections() -> dict[str, tuple[str, str, Callable[[], Any]]]:
    """Name: (title, words, what makes the study)."""
    zoo = of_tests("motion_problems")
    peer = " Exudyn's lines are of planar rods with fixed steps, its time includes building the model."
    return {
        "motion-swing": (
            "Motion: two-body swing, 2 s",
            "A driven hinge and a free one: a constraint that moves.",
            lambda: study(zoo.swing(2.0)),
        ),
        "motion-heavy-top": (
            "Motion: fast heavy top, 0.5 s",
            "Twelve turns about its own axis: smooth, not stiff, fast. Explicit steps of high order are made for it.",
            lambda: study(zoo.heavy_top(t=0.5), _top_in_exudyn(0.5)),
        ),
        "motion-four-bars": (
            "Motion: ten four-bars, 0.7 s",
            "Spatial hinges, thirty redundant constraints, up to just before the links align." + peer,
            lambda: study(zoo.four_bars(10, 0.7), _four_bars_in_exudyn(10, 0.7)),
        ),
        "motion-slider-crank": (
            "Motion: slider-crank, 1 s",
            "One loop with redundant joints; the dead centres are the fast parts.",
            lambda: study(zoo.slider_crank()),
        ),
        "motion-rotor": (
            "Motion: unbalanced rigid rotor, ten turns",
            "One coordinate under gravity; the truth is Jacobi's amplitude.",
            lambda: study(rigid_rotor()),
        ),
        "motion-wind-rotor": (
            "Motion: three-bladed rotor with flexible blades and shaft, one turn",
            "The scene of `examples/rotors/wind_rotor.py`: 18 degrees of freedom, weight and tabulated air loads with a kink at every "
            "eighth of a turn. Shaft and blades are stiff against the turning, so that stability sets the explicit steps: their "
            "error is below 1e-8 m whatever is asked. There is no closed form: explicit steps are measured against `bdf` at 1e-12, all "
            "others against explicit steps at 1e-13. No installed peer has the scene: Pinocchio has no flexible bodies, and "
            "the floating frame of Exudyn takes meshes of solids instead of beams.",
            lambda: self_made(wind_rotor(), repeat=2),
        ),
        "motion-stiff": (
            "Motion: masses on bushings, the middle one of 9e6 N/m, 0.1 s",
            "A fast oscillation without amplitude beside slow ones. Explicit steps are bound by it, `bdf` passes over it down to "
            "1e-5; generalised-alpha and `bdf-bfgs` follow it at every tolerance and pay for it.",
            lambda: study(shorter(zoo.bushings(stiff=1e4), 0.1), repeat=2),
        ),
        "motion-gap": (
            "Motion: a mass that strikes a stop of 1e4 N/m, 2 s",
            "Each contact is a kink in the force: the steps of all methods end there, and histories begin anew.",
            lambda: study(zoo.gap(), repeat=2),
        ),
    }


def shorter(problem: Any, t: float) -> Any:
    """The same motion up to t, s."""
    problem.t = t
    return problem


def rigid_rotor(turns: int = 10) -> Any:
    """phi = 2 am(w t/2 | 4 g'/w^2) from below, g' = m g r/(J + m r^2). Data invented."""
    from scipy.special import ellipj, ellipk

    zoo = of_tests("motion_problems")
    w, mass, r, inertia = 40.0, 2.0, 0.1, 0.05
    m = mb.Model("rotor", gravity=(0, -9.81, 0))
    b = m.body(
        "rotor", mass=mass, inertia=(inertia,) * 3, at=(0, -r, 0), velocity=(w * r, 0, 0), angular_velocity=(0, 0, w)
    )
    m.revolute("shaft", m.ground, b, at=(0, 0, 0), axis="z")
    modulus = 4 * mass * 9.81 * r / (inertia + mass * r * r) / w**2

    def truth(t: np.ndarray) -> dict[str, np.ndarray]:
        phi = 2 * ellipj(0.5 * w * np.asarray(t, dtype=float), modulus)[3]
        return {"rotor": np.stack([r * np.sin(phi), -r * np.cos(phi), 0 * phi], axis=1)}

    return zoo.MotionProblem(m, truth, "Jacobi's am", name="rigid rotor", t=turns * 4 * ellipk(modulus) / w)


def wind_rotor() -> Any:
    """WindPACT blades on an invented shaft: where three places at 85 % of the blades are after a turn of the drive."""
    zoo = of_tests("motion_problems")

    def unknown(t: np.ndarray) -> dict[str, np.ndarray]:
        return dict.fromkeys(("section1", "section2", "section3"), np.full((len(t), 3), np.nan))

    return zoo.MotionProblem(mb.examples.wind_rotor(air=12.0), unknown, "none", name="wind rotor", t=60.0 / 17.2)
