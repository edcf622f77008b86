"""Writes docs/accuracy.md and its pictures: measured error against measured time, by `mb.accuracy_study`.

python benches/accuracy.py [name ...]     (names: only these sections, put into the page that is there)
python benches/accuracy.py --redraw       (measures nothing: draws the pictures anew from the numbers on the page)

Times are wall times of this machine, the best of several runs; errors do not depend on it.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import accuracy_gradients
import accuracy_motion
import accuracy_nonlinear as nonlinear
import bdf_evaluations
import mbrs as mb
import numpy as np
from mbrs.studies.accuracy import AccuracyStudy, StudyPoint
from tables import folded

DOCS = Path(__file__).resolve().parent.parent / "docs"
HEAD = """# What accuracy costs

[Accuracy and cost](cost.md) picks the four curves that answer most questions and says what to take. Here is every curve; "numbers" below
it unfolds what it is drawn from.

Made by `python benches/accuracy.py` through `mb.accuracy_study`; times are of one machine and tell ratios only. Every
result of mbrs carries an estimate of its own error (`.error`); the column "estimate" is its largest value.
"""


@dataclass(frozen=True)
class Section:
    """A study with the words around it."""

    name: str
    title: str
    text: str
    study: mb.study.AccuracyStudy | Any


@cache
def spring_chain(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Masses 1 and springs 1 in a row, fixed at one end: the factor F of K = F^T F, and the exact frequencies in Hz.

    w_j = 2 sin((2 j - 1) pi / (2 (2 n + 1))), a known closed form.
    """
    factor = np.eye(n) - np.eye(n, k=-1)
    j = np.arange(1, n + 1)
    return factor, np.sin((2 * j - 1) * np.pi / (2 * (2 * n + 1))) / np.pi


def against_closed_form(result: Any, reference: Any) -> float:
    """Largest relative error of a frequency, against the closed form."""
    f = np.sort(np.asarray(getattr(result, "frequency", result)))
    dof = len(result.coordinates) if hasattr(result, "coordinates") else len(f)
    return float(np.max(np.abs(f / reference(dof)[: len(f)] - 1)))


def exact(n: int) -> np.ndarray:
    return spring_chain(n)[1]


def dense_modes() -> Section:
    import scipy.linalg

    def solve(n: int, method: str) -> Any:
        factor = spring_chain(n)[0]
        stiffness = factor.T @ factor
        if method == "scipy.linalg.eigh":
            return np.sqrt(np.abs(scipy.linalg.eigh(stiffness, np.eye(n))[0])) / (2 * np.pi)
        system = mb.MechanicalSystem(np.eye(n), None, stiffness)
        return mb.modes(system, stiffness_factor=factor if method == "factored stiffness" else None)

    methods = ["assembled stiffness", "factored stiffness", "scipy.linalg.eigh"]
    study = mb.accuracy_study(
        solve, n=[10, 30, 100, 300], method=methods, reference=exact, measure=against_closed_form, repeat=3
    )
    text = (
        "All modes of n masses in a row. The condition of the assembled K grows like n^2, and a backward stable solver "
        "may lose as many digits of the lowest frequency. `stiffness_factor=` takes a factor F with K = F^T F instead."
    )
    return Section("dense-modes", "Dense modes", text, study)


def sparse_modes() -> Section:
    import scipy.sparse
    import scipy.sparse.linalg

    @cache
    def matrices(n: int) -> tuple[Any, Any]:
        factor = scipy.sparse.diags_array([np.ones(n), -np.ones(n - 1)], offsets=[0, -1], format="csc")
        return scipy.sparse.eye_array(n, format="csc"), (factor.T @ factor).tocsc()

    def solve(n: int, method: str) -> Any:
        mass, stiffness = matrices(n)
        if method == "mb.modes":
            return mb.modes(mb.MechanicalSystem(mass, None, stiffness), n=20)
        values = scipy.sparse.linalg.eigsh(stiffness, k=20, M=mass, sigma=0.0, return_eigenvectors=True)[0]
        return np.sqrt(np.abs(np.sort(values))) / (2 * np.pi)

    def measure(result: Any, sizes: Any) -> float:
        """Largest relative error of the 20 lowest frequencies, against the closed form."""
        f = np.sort(np.asarray(getattr(result, "frequency", result)))
        # Which size a plain array belongs to is told by its lowest frequency.
        n = min(sizes, key=lambda size: abs(math.log(f[0] / exact_lowest(size)[0])))
        return float(np.max(np.abs(f / exact_lowest(n) - 1)))

    sizes = [1_000, 10_000, 100_000]
    study = mb.accuracy_study(
        solve, n=sizes, method=["mb.modes", "scipy eigsh, shift-invert"], reference=sizes, measure=measure, repeat=1
    )
    text = "The 20 lowest modes of the same row with sparse matrices."
    return Section("sparse-modes", "Sparse modes", text, study)


def exact_lowest(n: int) -> np.ndarray:
    j = np.arange(1, 21)
    return np.sin((2 * j - 1) * np.pi / (2 * (2 * n + 1))) / np.pi


def truncation() -> Section:
    m = mb.examples.chain(10, joint=None, along="x")
    ports = ("B10.force.y", "B5.motion.y")
    frequency = np.linspace(0.5, 15.0, 400)
    lin = mb.linearize(m)
    modes = mb.modes(lin)
    force, motion = (np.asarray(modes.body_shape(b)[1]) for b in ("B10", "B5"))
    static = float(mb.frf(m, *ports, frequency=[0.0]).value[0, 0, 0].real)
    reference = mb.frf(m, *ports, frequency=frequency).value[0, 0]

    def modal_sum(modes_kept: int, correction: str) -> np.ndarray:
        # phi^T (2 s M + C) phi = 2i Im s, so each pair adds L phi phi^T F/(2i Im s) over iw - s, and its conjugate.
        s, residue = modes.eigenvalue[:modes_kept], (force * motion)[:modes_kept]
        residue = residue / (2j * s.imag)
        iw = 2j * np.pi * frequency[:, None]
        value = (residue / (iw - s) + residue.conj() / (iw - s.conj())).sum(axis=1)
        if correction == "static":
            value = value + static - np.sum(-2 * (residue / s).real)
        return value

    study = mb.accuracy_study(
        modal_sum,
        modes_kept=[5, 10, 20, 40, 60],
        correction=["none", "static"],
        reference=reference,
        repeat=5,
    )
    text = (
        "The receptance of a chain of ten bodies on bushings (60 degrees of freedom), 0.5 to 15 Hz, as a sum over the "
        "lowest modes, without and with the static response of the others. `mb.frf` needs no such choice: it uses all "
        "modes, checks itself against direct solves, and falls back on them; this shows what a truncated model loses."
    )
    return Section("truncation", "Number of modes in a transfer function", text, study)


def response() -> Section:
    system = mb.MechanicalSystem([[1.0]], [[0.2]], [[25.0]])
    w = 3.0

    def run(points: int) -> Any:
        t = np.linspace(0.0, 10.0, points)
        return mb.response(system, t=t, loads={0: np.sin(w * t)}, outputs=0)

    def at_the_end(result: Any, reference: Any) -> float:
        """Error of the displacement at 10 s, relative to the largest."""
        return abs(float(result.value[0, -1]) - float(reference)) / float(np.max(np.abs(result.value)))

    study = mb.accuracy_study(
        run, points=[11, 41, 161, 641, 2561], reference=_oscillator(10.0, w), measure=at_the_end, repeat=5
    )
    text = (
        "An oscillator of 5 rad/s under a sine of 3 rad/s that is given at so many times and taken as linear between "
        "them. The response to that load is exact, so the error is that of the load: second order in the step."
    )
    return Section("response", "Time response and the sampling of its load", text, study)


def _oscillator(t: float, w: float) -> float:
    """x" + 0.2 x' + 25 x = sin(w t) from rest, in closed form."""
    x = 1.0 / complex(25.0 - w * w, 0.2 * w)
    steady, rate = (x * np.exp(1j * w * t)).imag, 0.1
    wd = math.sqrt(25.0 - rate * rate)
    a, v = -x.imag, -(1j * w * x).imag
    return steady + math.exp(-rate * t) * (a * math.cos(wd * t) + (v + rate * a) / wd * math.sin(wd * t))


def _motion(name: str, title: str, text: str, make: Callable[[], Any]) -> Callable[[], Section]:
    return lambda: Section(name, title, text, make())


SECTIONS: dict[str, Callable[[], Section]] = {
    "dense": dense_modes,
    "sparse": sparse_modes,
    "truncation": truncation,
    "response": response,
    **{name: _motion(name, *rest) for name, rest in accuracy_motion.sections().items()},
    **{
        name: lambda make=make: Section(*make())
        for name, make in {**accuracy_gradients.SECTIONS, **nonlinear.SECTIONS}.items()
    },
}


def markdown(section: Section) -> str:
    study = section.study
    lines = [["setting", "time", "error", "estimate", "status"], ["---"] * 5]
    for p in study.points:
        if accuracy_motion.LEFT_OUT in p.status:
            continue
        setting = ", ".join(f"{name} = {text}" for name, text in p.settings.items())
        numbers = ["-" if math.isnan(v) else f"{v:.1e}" for v in (p.error, p.estimate)]
        lines.append([setting, "-" if not math.isfinite(p.time) else f"{1e3 * p.time:.3g} ms", *numbers, p.status])
    rows = "\n".join("| " + " | ".join(cells) + " |" for cells in lines)
    picture = f"![error against time](img/accuracy-{section.name}.png)"
    return f"## {section.title}\n{section.text}\n\nError: {study.measure}.\n\n{picture}\n\n{folded(rows)}\n"


def redraw() -> None:
    """Pictures of error against time from the numbers on the page: the first setting that is a number stands beside the points."""
    sections = (DOCS / "accuracy.md").read_text(encoding="utf-8").split("\n## ")[1:]
    for section in sections:
        picture = re.search(r"!\[error against time\]\(img/(.*?)\)", section)
        points = [
            _point(*row)
            for row in re.findall(r"^\| (\w+ = .*?) \| (.*?) \| (.*?) \| (.*?) \| (.*?) \|$", section, re.M)
        ]
        if picture is None or not points:
            continue
        if "size" in points[0].settings:  # differences over their step: no curve over time
            continue
        measure = re.search(r"^Error: (.*)\.$", section, re.M)
        assert measure is not None, section[:80]
        study = AccuracyStudy(tuple(points), tuple(points[0].settings), measure[1], "")
        study.plot().savefig(DOCS / "img" / picture[1])


def _point(setting: str, time: str, error: str, estimate: str, status: str) -> StudyPoint:
    settings = dict(part.split(" = ", 1) for part in re.split(r", (?=\w+ = )", setting))
    number = next(name for name, text in settings.items() if text.replace(".", "").replace("e-", "").isdigit())
    numbers = [math.nan if text == "-" else float(text.removesuffix(" ms")) for text in (time, error, estimate)]
    return StudyPoint(
        settings, {}, 1e-3 * numbers[0], numbers[1], status, numbers[2], numeric={number: float(settings[number])}
    )


def main(names: list[str]) -> None:
    if names == ["--redraw"]:
        redraw()
        return
    parts = [HEAD]
    for name in names or SECTIONS:
        section = SECTIONS[name]()
        print(section.study)
        section.study.plot().savefig(DOCS / "img" / f"accuracy-{section.name}.png")
        parts.append(markdown(section))
    if not names:
        parts.append(bdf_evaluations.section())
        (DOCS / "accuracy.md").write_text("\n".join(parts))
    elif (DOCS / "accuracy.md").exists():
        _replace(parts[1:])


def _replace(sections: list[str]) -> None:
    """Put some sections anew into docs/accuracy.md, the others staying as they were measured."""
    page = (DOCS / "accuracy.md").read_text()
    for section in sections:
        title = section.partition("\n")[0]
        before, found, rest = page.partition(title + "\n")
        after = rest.partition("\n## ")
        tail = f"\n## {after[2]}" if after[1] else ""
        page = f"{before}{section.rstrip()}\n{tail}" if found else f"{page.rstrip()}\n\n{section.rstrip()}\n"
    (DOCS / "accuracy.md").write_text(page)


if __name__ == "__main__":
    main(sys.argv[1:])
