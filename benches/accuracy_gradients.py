"""The sections of docs/accuracy.md about gradients of motions: error against time, and differences over their step."""

from __future__ import annotations

import dataclasses
from typing import Any

import mbrs as mb
import numpy as np

# docs/theory.md (23.12), five-bar, T = 2 s: converged by Runge-Kutta and DOP853
CONVERGED = np.array([-1.33084740, 0.99780747])
END, NAMES, R0 = 2.0, ["spring1.length", "spring2.length"], np.array([0.5, -2.0, 0.0])


def drift(s: Any) -> Any:
    """How far point 2 is from where it was drawn."""
    return np.sum((s.point("P2") - R0) ** 2)


def relative(a: Any, b: np.ndarray) -> float:
    """Largest difference over the largest entry of b."""
    return float(np.max(np.abs(np.asarray(a) - b)) / np.max(np.abs(b)))


def objective(m: Any, **how: Any) -> float:
    """The integral as a user of differences has it: of a simulation without derivatives, by the trapezoidal rule."""
    traj = mb.simulate(m, **how)
    return float(np.trapezoid(np.sum((traj.point("P2") - R0) ** 2, axis=1), traj.t))


def by_differences(m: Any, size: float, central: bool, **how: Any) -> np.ndarray:
    """Forward or central differences with the step ``size``, m."""
    here = None if central else objective(m, **how)
    slopes = []
    for name in NAMES:
        now = m.value(name)
        m.set({name: now + size})
        high = objective(m, **how)
        if central:
            m.set({name: now - size})
        low = objective(m, **how) if here is None else here
        m.set({name: now})
        slopes.append((high - low) / (2 * size if central else size))
    return np.array(slopes)


def against_converged(result: Any, reference: Any) -> float:
    """Largest error of an entry of the gradient over its largest entry, against the converged gradient."""
    return relative(result, reference)


def over_time() -> tuple[str, str, str, Any]:
    m = mb.examples.five_bar()
    psi = mb.Integral(drift)

    def solve(method: str, step: float) -> np.ndarray:
        if method in ("direct", "adjoint"):
            return np.asarray(mb.gradient(m, psi, NAMES, t=END, step=step, method=method).gradient)
        # steps of differences whose error, in the other section, is below that of the motion
        central = method.startswith("central")
        return by_differences(m, 1e-4 if central else 1e-7, central, t=END, step=step, method="ali3p")

    study = mb.accuracy_study(
        solve,
        method=["direct", "adjoint", "forward differences", "central differences"],
        step=[2e-2, 1e-2, 5e-3, 2.5e-3, 1.25e-3, 6.25e-4],
        reference=CONVERGED,
        measure=against_converged,
        repeat=3,
    )
    text = (
        "Five-bar of docs/theory.md (23.12), the integral over 2 s by both natural lengths. All four converge with the square of the "
        "step: the error is that of the motion. Differences look as good here because each was given a step (1e-7 m and 1e-4 m) whose "
        "own error stays below that of the motion, which only the exact gradient told; their cost grows with the number of parameters, "
        "that of the adjoint does not. "
        "The time of direct and adjoint includes the objective, a Python function called at every step."
    )
    return "gradients", "Gradients: error against time", text, study


@dataclasses.dataclass
class Valley:
    """A study of differences, drawn over their step instead of over time."""

    study: Any
    exact: float

    def __getattr__(self, name: str) -> Any:
        return getattr(self.study, name)

    def __str__(self) -> str:
        return str(self.study)

    def plot(self) -> Any:
        """Error over the step of the differences."""
        from mbrs.plot.figure import PALETTE, figure, legend, style

        with style():
            made, ax = figure(1, 1, size=(8.4, 4.8))
            names = []
            for color, (name, points) in zip(PALETTE, self.study.lines(), strict=False):
                sizes = [float(next(iter(p.numeric.values()))) for p in points]
                ax.loglog(sizes, [p.error for p in points], "o-", ms=4, color=color, label=name)
                names.append(name)
            ax.axhline(self.exact, color="#33404e", ls="--", lw=1.2, label="adjoint (against direct)")
            ax.set(xlabel="step of the differences [m]", ylabel="relative error of the gradient")
            legend(ax, [*names, "adjoint (against direct)"])
        return made


def differences() -> tuple[str, str, str, Any]:
    m = mb.examples.five_bar()
    psi = mb.Integral(drift)
    exact = {}
    for step in (1e-2, 2.5e-3):
        exact[step] = np.asarray(mb.gradient(m, psi, NAMES, t=END, step=step, method="direct").gradient)
    adjoint = np.asarray(mb.gradient(m, psi, NAMES, t=END, step=1e-2, method="adjoint").gradient)
    times = np.linspace(0.0, END, 801)

    def solve(kind: str, size: float) -> Any:
        central = kind.startswith("central")
        if "rtol" in kind:
            return kind, by_differences(m, size, central, t=times, rtol=1e-6)
        step = 1e-2 if "h = 0.01" in kind else 2.5e-3
        return kind, by_differences(m, size, central, t=END, step=step, method="ali3p")

    def off(result: Any, reference: Any) -> float:
        """Relative to the largest entry: against the exact gradient of the same steps (with rtol: the converged one)."""
        kind, gradient = result
        return relative(gradient, CONVERGED if "rtol" in kind else exact[1e-2 if "h = 0.01" in kind else 2.5e-3])

    study = mb.accuracy_study(
        solve,
        kind=[
            "forward, h = 0.01",
            "forward, h = 0.0025",
            "central, h = 0.01",
            "central, h = 0.0025",
            "central, steps chosen by rtol = 1e-6",
        ],
        size=[10.0**-e for e in range(1, 13)],
        reference=CONVERGED,
        measure=off,
        repeat=1,
    )
    text = (
        "The same gradient by differences over the step of the differences: too large and the curvature enters, too small and "
        "rounding is divided by next to nothing; the best step is known only to those who know the gradient. The last line is "
        "against the converged gradient: where a tolerance chooses the steps, their error is the floor. The dashed line is what "
        "direct and adjoint differ by: they have no step to choose."
    )
    return (
        "gradients-differences",
        "Gradients: differences over their step",
        text,
        Valley(study, relative(adjoint, exact[1e-2])),
    )


SECTIONS = {"gradients": over_time, "gradients-differences": differences}
