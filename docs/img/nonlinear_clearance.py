"""Draws docs/img/nonlinear-clearance.png, the picture of docs/nonlinear.md."""

from pathlib import Path

import mbrs as mb
from mbrs.plot.figure import figure, style

m = mb.examples.clearance_oscillator()
curve = mb.frequency_response(m, inputs="mass.force.x", amplitude=3.0, frequency=(5, 25), harmonics=21)
with style():
    picture, (left, right) = figure(1, 2, size=(10.0, 4.2), width_ratios=(1.5, 1))
    curve.plot("mass.motion.x", harmonic=None, ax=left)
    curve.peak("rail").plot_orbit("mass.motion.x", ax=right)
picture.savefig(Path(__file__).resolve().with_name("nonlinear-clearance.png"))
