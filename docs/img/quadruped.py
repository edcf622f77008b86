"""Draws the picture of the README: the quadruped in one of its modes, its transfer function, and what moves that mode.

python docs/img/quadruped.py [file]
"""

import sys
from pathlib import Path
from typing import Any

import mbrs as mb
import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mbrs.plot.data import tornado_bars
from mbrs.view.solids import body_solid
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

PICTURE = Path(__file__).resolve().with_name("quadruped.png")
BLUE, ORANGE, GREY = "#1f5fa8", "#d9662b", "#9aa7b5"
# How far the point that moves the most is moved in the drawing, m.
SHOWN_MOTION = 0.12


def moved(points: np.ndarray, origin: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """Points of a rigid body after a small motion (6,) of its origin."""
    return points + twist[:3] + np.cross(twist[3:], points - origin)


def draw_mode(axes: Any, modes: Any, mode: int) -> None:
    """Bodies as solids, coloured by how far they move; feet to ground as lines."""
    scene = modes.geometry
    twists = {b.name: modes.body_shape(b.name)[:, mode].real for b in scene.bodies}
    solids = []
    for b in scene.bodies:
        vertices, faces = body_solid(b.origin, b.rotation, b.points, 0.018)
        before = vertices + b.origin
        solids.append((before, moved(before, b.origin, twists[b.name]) - before, faces))
    scale = SHOWN_MOTION / max(np.linalg.norm(d, axis=1).max() for _, d, _ in solids)
    shades = colormaps["GnBu"]
    for before, d, faces in solids:
        axes.add_collection3d(Line3DCollection([before[[*f, f[0]]] for f in faces], colors="#c7d0d9", linewidths=0.5))
        size = np.linalg.norm(d, axis=1) * scale / SHOWN_MOTION
        colours = [shades(0.4 + 0.55 * float(np.mean(size[f]))) for f in faces]
        after = before + scale * d
        axes.add_collection3d(
            Poly3DCollection([after[f] for f in faces], facecolors=colours, edgecolors="#33404e", linewidths=0.4)
        )
    feet = [link.at_a for link in scene.links if link.a is None]
    axes.scatter(*np.transpose(feet), marker="s", s=28, color=GREY, depthshade=False)
    axes.set(xlim=(-0.42, 0.42), ylim=(-0.42, 0.42), zlim=(0.0, 0.68))
    axes.set_box_aspect((0.84, 0.84, 0.68), zoom=1.05)
    axes.view_init(elev=18, azim=28)
    axes.set_axis_off()
    axes.set_title(
        f"mode {mode + 1}: {modes.frequency[mode]:.2f} Hz, damping {100 * modes.damping[mode]:.1f} %", fontsize=11
    )


def draw_transfer_function(axes: Any, modes: Any, h: Any) -> None:
    for row, (name, colour) in enumerate((("up and down", BLUE), ("fore and aft", ORANGE))):
        axes.loglog(h.frequency, np.abs(h.value[row, row]), color=colour, label=name, lw=1.6)
    for f in modes.frequency:
        axes.axvline(f, color=GREY, ls=":", lw=0.7)
    axes.set(xlim=(0.5, 100), xlabel="frequency [Hz]", ylabel="|H| [m/N]")
    axes.set_title("receptance of the torso", fontsize=11)
    axes.legend(frameon=False, fontsize=9)


def draw_sensitivities(axes: Any, s: Any, mode: int) -> None:
    bars = tornado_bars(s, mode, most=5)
    place = np.arange(len(bars))
    axes.barh(place, [b.value for b in bars], color=[BLUE if b.value > 0 else ORANGE for b in bars], height=0.6)
    axes.set_yticks(place, [f"{b.label}\n{b.change}" for b in bars], fontsize=8.5)
    axes.invert_yaxis()
    axes.axvline(0.0, color="#33404e", lw=0.9)
    axes.set(xlabel="change of f [Hz]")
    axes.set_title("what moves this mode", fontsize=11)


def main(path: Path) -> None:
    m = mb.examples.quadruped()
    modes = mb.modes(m)
    mode = 2
    directions = ("z", "y")
    h = mb.frf(
        m,
        [f"torso.force.{a}" for a in directions],
        [f"torso.motion.{a}" for a in directions],
        frequency=np.geomspace(0.5, 100, 600),
    )
    s = mb.sensitivity(modes, ["k_leg", "k_foot", "torso.mass", "knee-FL.at_a[1]", "thigh-FL.mass"])
    figure = Figure(figsize=(12.5, 4.1), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(1, 3, width_ratios=(1.0, 1.15, 0.9))
    draw_mode(figure.add_subplot(grid[0], projection="3d"), modes, mode)
    draw_transfer_function(figure.add_subplot(grid[1]), modes, h)
    draw_sensitivities(figure.add_subplot(grid[2]), s, mode)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
    print(f"wrote {path}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURE)
