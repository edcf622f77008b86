"""Figures: labels with units, the right data, readable with many curves, no display needed."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jitter
import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
import pytest
from mbrs import plot
from mbrs.errors import ModelError
from mbrs.plot.data import breaks_at_jumps, curves, frf_unit, rounded, tornado_bars
from small_results import isolator_modes, isolator_sensitivity, row_frf

pytest.importorskip("matplotlib")


def _labels(axes: Any) -> tuple[str, str]:
    return axes.get_xlabel(), axes.get_ylabel()


def _no_text_is_cut(figure: Any) -> None:
    """Every text of the figure lies inside it once it is laid out."""
    figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    box = figure.bbox
    for axes in figure.axes:
        texts = [axes.xaxis.label, axes.yaxis.label, axes.title, *axes.texts]
        for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            # ticks outside the limits exist but are not drawn
            shown = [t for t in axis.get_major_ticks() if min(limits) <= t.get_loc() <= max(limits)]
            texts += [t.label1 for t in shown]
        if axes.get_legend():
            texts += axes.get_legend().get_texts()
        for text in texts:
            if not text.get_text() or not text.get_visible():
                continue
            extent = text.get_window_extent(renderer)
            assert extent.x0 >= box.x0 - 3 and extent.x1 <= box.x1 + 3, text.get_text()
            assert extent.y0 >= box.y0 - 3 and extent.y1 <= box.y1 + 3, text.get_text()


def test_modes_shows_every_pole_and_coordinate() -> None:
    modes = isolator_modes()
    figure = plot.modes(modes)
    poles, matrix = figure.axes[:2]
    assert _labels(poles) == ("Re s [rad/s]", "Im s / 2 pi [Hz]")
    drawn = np.vstack([line.get_xydata() for line in poles.get_lines() if line.get_marker() == "o"])
    assert np.sort(drawn[:, 1]) == pytest.approx(np.sort(modes.eigenvalue.imag / (2 * np.pi)))
    assert [t.get_text() for t in matrix.get_yticklabels()] == list(modes.coordinates)
    # shapes of equal roots are along the axes, but where noise parts the roots
    shape = np.abs(modes.shape) if jitter.seed() is not None else np.eye(6)
    assert np.asarray(matrix.get_images()[0].get_array()) == pytest.approx(shape / shape.max(axis=0), abs=1e-12)
    _no_text_is_cut(figure)


def test_lists_of_modes_stand_beside_each_other() -> None:
    chain = mb.examples.chain(6)
    one = mb.modes(chain)
    f, zeta = one.frequency[::-1] * (1 + 1e-3), one.damping[::-1].copy()
    figure = one.plot("list", against=(f, zeta))
    upper, lower = figure.axes
    assert upper.get_ylabel() == "natural frequency [Hz]" and _labels(lower) == ("mode", "damping ratio")
    ours, other = (line.get_xydata() for line in upper.get_lines())
    assert ours[:, 0].tolist() == list(range(1, 7)) and np.all(np.diff(ours[:, 1]) >= 0)
    assert other[:, 1] == pytest.approx(ours[:, 1] * (1 + 1e-3))
    assert f"largest {1e-3 * one.frequency.max():.1e} Hz" in upper.get_title(loc="left")
    assert "largest 0.0e+00" in lower.get_title(loc="left")
    _no_text_is_cut(figure)
    assert len(one.plot("list", n=3).axes[0].get_lines()[0].get_xydata()) == 3
    with pytest.raises(ModelError, match='as a "list"'):
        one.plot("table")
    with pytest.raises(ModelError, match="against= belongs to"):
        one.plot(against=one)


def test_modes_of_a_large_model_has_no_tick_for_each_coordinate() -> None:
    n = 300
    rng = np.random.default_rng(0)
    modes = SimpleNamespace(
        eigenvalue=1j * np.arange(n), frequency=np.arange(n) / 6.28, shape=rng.normal(size=(n, n)),
        kind=["undamped"] * n, coordinates=[f"body{i}.x" for i in range(n)],
    )  # fmt: skip
    figure = plot.modes(modes)
    assert figure.axes[1].get_ylabel() == "coordinate" and len(figure.axes[1].get_xticks()) <= 16
    _no_text_is_cut(figure)


def test_bode_has_units_log_axes_and_the_closed_form() -> None:
    result = row_frf()
    above, below = plot.frf(result, marks=[11.25]).axes
    assert above.get_ylabel() == "|H| [m/N]" and _labels(below) == ("frequency [Hz]", "phase [deg]")
    assert above.get_yscale() == below.get_xscale() == "log"
    line = above.get_lines()[0]
    assert line.get_ydata()[0] == pytest.approx(abs(1 / (1e4 - (2 * np.pi) ** 2 * 2 + 2j * np.pi * 6)))
    assert below.get_lines()[0].get_ydata()[-1] == pytest.approx(-180.0, abs=3.0)


def test_many_curves_stay_readable() -> None:
    result = row_frf(8, 6)
    figure = plot.frf(result)
    above = figure.axes[0]
    assert len(above.get_lines()) == 48 and len(above.get_legend().get_texts()) == 10
    assert "38 smaller curves" in above.get_title(loc="left")
    _no_text_is_cut(figure)


def test_curves_that_are_only_rounding_are_left_out_and_said_so() -> None:
    result = row_frf(2, 1)
    result = replace(result, value=result.value * np.array([1.0, 1e-15])[:, None, None])
    figure = plot.frf(result)
    assert len(figure.axes[0].get_lines()) == 1
    assert figure.axes[0].get_title(loc="left") == "receptance (left out as zero: 1)"
    assert (
        len(plot.frf(replace(result, value=result.value * np.array([0.0, 1.0])[:, None, None])).axes[0].get_lines())
        == 1
    )


def test_nyquist_is_square_and_marks_the_peak() -> None:
    result = row_frf(2, 1)
    figure = plot.frf(result, kind="nyquist")
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0 and _labels(axes) == ("Re H [m/N]", "Im H [m/N]")
    peak = result.frequency[np.argmax(abs(result.value[0, 0]))]
    assert f"{peak:.4g} Hz" in [t.get_text() for t in axes.texts]
    _no_text_is_cut(figure)


@pytest.mark.parametrize(
    ("kind", "outputs", "inputs", "unit"),
    [
        ("receptance", ["a.motion.z"], ["a.force.z"], "m/N"),
        ("mobility", ["a.motion.z"], ["a.force.z"], "m/s/N"),
        ("accelerance", ["a.motion.rx"], ["a.torque.x"], "rad/s^2/(N m)"),
        ("receptance", ["a.motion.rx", "a.motion.z"], ["a.force.x"], ""),
        ("transmissibility", ["a.motion.z"], ["base.z"], "1"),
        ("transmissibility", ["a.motion.-ry"], ["base.z"], "rad/m"),
        ("receptance", ["a.motion.z@(0,0,0.5)"], ["a.torque.(1,0.5,0)"], "m/(N m)"),
        ("accelerance", ["a.motion.z"], ["base.z"], "m/s^2/m"),
    ],
)
def test_units_follow_kind_and_ports(kind: str, outputs: list[str], inputs: list[str], unit: str) -> None:
    assert frf_unit(SimpleNamespace(kind=kind, outputs=outputs, inputs=inputs)) == unit


def test_infinite_resonances_and_nan_do_not_spoil_the_plot() -> None:
    value = row_frf(2, 1).value.copy()
    value[0, 0, 100], value[1, 0, 50:60] = complex(np.inf, 0), np.nan
    result = replace(row_frf(2, 1), value=value)
    for kind in ("bode", "nyquist"):
        figure = plot.frf(result, kind=kind)
        low, high = figure.axes[0].get_ylim()
        assert np.isfinite([low, high]).all() and high < 0.1
        _no_text_is_cut(figure)


def test_wrapped_phase_draws_no_vertical_line() -> None:
    assert np.isnan(breaks_at_jumps(np.array([170.0, 179.0, -179.0, -170.0]), 270.0)).tolist() == [
        False,
        False,
        True,
        False,
    ]


def test_wrong_input_is_named() -> None:
    with pytest.raises(ModelError, match="kind='polar' is not known"):
        plot.frf(row_frf(), kind="polar")
    with pytest.raises(ModelError, match=r"\(n_out, n_in, n_freq\)"):
        curves(SimpleNamespace(value=np.zeros((2, 3))))
    with pytest.raises(ModelError, match="mode=6 is not among the 6 modes"):
        plot.tornado(isolator_sensitivity(), mode=6)
    with pytest.raises(ModelError, match="n_t = 3"):
        plot.response(SimpleNamespace(t=np.arange(3), value=np.zeros((1, 4))))
    with pytest.raises(ModelError, match="n_s = 3"):
        plot.campbell(SimpleNamespace(speed=np.arange(3), frequency=np.zeros((2, 2))))


def test_response_names_the_largest_curves() -> None:
    t = np.linspace(0, 1, 50)
    value = np.arange(1, 13)[:, None] * np.sin(20 * t)
    figure = plot.response(
        SimpleNamespace(t=t, value=value, kind="velocity", outputs=[f"b{i}.motion.z" for i in range(12)])
    )
    axes = figure.axes[0]
    assert _labels(axes) == ("t [s]", "velocity [m/s]") and len(axes.get_lines()) == 12
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [f"b{i}.motion.z" for i in range(11, 1, -1)]
    _no_text_is_cut(figure)


def _rotor() -> SimpleNamespace:
    """Rotor on isotropic bearings: f = -+ g/2 + sqrt((g/2)^2 + f0^2) with g = .6 speed/2pi; invented numbers."""
    speed = np.linspace(0, 300, 61)
    g = 0.6 * speed / (2 * np.pi) / 2
    backward, forward = np.sqrt(g**2 + 20.0**2) - g, np.sqrt(g**2 + 20.0**2) + g
    frequency = np.column_stack([backward, forward, np.full_like(speed, 35.0)])
    damping = np.where(np.column_stack([speed < 0, speed > 250, speed < 0]), -0.01, 0.02)
    whirl = np.tile([-1, 1, 0], (speed.size, 1))
    return SimpleNamespace(speed=speed, frequency=frequency, damping=damping, whirl=whirl, unit="rad/s")


def test_campbell_tells_whirl_and_instability_apart() -> None:
    figure = plot.campbell(_rotor())
    axes = figure.axes[0]
    named = {line.get_label(): line for line in axes.get_lines()}
    assert {"forward", "backward", "no whirl", "unstable"} <= set(named)
    assert np.all(np.diff(named["forward"].get_ydata()) > 0) and np.all(np.diff(named["backward"].get_ydata()) < 0)
    assert named["unstable"].get_xdata().min() > 250
    order = next(line for line in axes.get_lines() if line.get_linestyle() == "--")
    assert order.get_ydata()[-1] == pytest.approx(300 / (2 * np.pi))
    assert _labels(axes) == ("speed [rad/s]", "frequency [Hz]")
    _no_text_is_cut(figure)


def test_tornado_is_sorted_by_effect() -> None:
    figure = plot.tornado(isolator_sensitivity())
    axes = figure.axes[0]
    widths = [bar.get_width() for bar in axes.patches]
    assert widths == sorted(widths, key=abs, reverse=True) and widths[0] == pytest.approx(-0.0796, abs=1e-4)
    assert axes.get_yticklabels()[0].get_text() == "payload.mass  (+1 % of 20 kg)"
    assert axes.get_xlabel() == "change of f [Hz]"
    _no_text_is_cut(figure)


class _Model:
    def value(self, address: str) -> Any:
        known = {"k": 2e4, "V": np.ones((2,)), "m": 0.0}
        if address not in known:
            raise ModelError(f"no {address}")
        return known[address]


def test_tornado_takes_labels_from_shapes_and_values_from_the_model() -> None:
    """The form of mb.EigenSensitivity: names per parameter, labels per entry, values in the model behind the modes."""
    given = SimpleNamespace(
        frequency=np.array([[1e-4, 2.0, 3.0, 5.0]]),
        parameters=("k", "V", "m"),
        shapes=((), (2,), ()),
        units=("N/m", "kg", "kg"),
        labels=lambda: ["k", "V[0]", "V[1]", "m"],
        modal=SimpleNamespace(system=SimpleNamespace(model=_Model())),
    )
    bars = tornado_bars(given)
    assert [(b.label, b.change) for b in bars] == [("V[1]", "+1 kg"), ("V[0]", "+1 kg"), ("k", "+1 % of 20000 N/m")]
    assert [b.value for b in bars] == pytest.approx([3.0, 2.0, 0.02])
    single = SimpleNamespace(frequency=np.ones((3, 2, 2)), parameters=("V",), shapes=((2, 2),), units=("kg",))
    assert [b.label for b in tornado_bars(single, mode=2)] == ["p0", "p1", "p2", "p3"]


def test_figures_are_those_of_pyplot() -> None:
    made = plot.tornado(isolator_sensitivity())
    assert plt.fignum_exists(made.number) and plt.gcf() is made


@pytest.mark.slow
def test_figures_need_no_display() -> None:
    code = (
        "from small_results import row_frf; from mbrs import plot;"
        "plot.frf(row_frf()).savefig('/dev/null', format='png')"
    )
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": ":".join(sys.path)})


def test_two_results_in_one_axes_have_two_colours_and_two_names() -> None:
    _, ax = plt.subplots()
    for shift in (1.0, 1.3):
        plot.frf(replace(row_frf(), value=shift * row_frf().value), ax=ax)
    colours = {line.get_color() for line in ax.get_lines()}
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert len(ax.get_lines()) == len(colours) == len(names) == len(set(names)) == 2
    plot.frf(row_frf(), ax=ax, label="third")
    assert [text.get_text() for text in ax.get_legend().get_texts()][-1] == "third"
    assert len({line.get_color() for line in ax.get_lines()}) == 3


def test_importing_the_package_does_not_import_matplotlib() -> None:
    modules = "mbrs.plot, mbrs.view.modes, mbrs.view.page, mbrs.studies.accuracy"
    code = f"import sys, {modules}; assert not {{'matplotlib', 'scipy', 'rich'}} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": ":".join(sys.path)})


def test_the_users_own_style_is_left_alone() -> None:
    import matplotlib

    before = dict(matplotlib.rcParams)
    plot.tornado(isolator_sensitivity())
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("damping", [0.3, 0.02, 0.0007])
def test_nyquist_circles_are_round(damping: float) -> None:
    """Of viscous damping the mobility is a circle through zero, however many frequencies there are on it."""
    system = mb.MechanicalSystem([[1.3]], [[damping]], [[731.0]])
    figure = mb.frf(system, [0], [0], frequency=(1.0, 9.0), kind="mobility").plot(kind="nyquist")
    line = figure.axes[0].lines[0]
    z = line.get_xdata() + 1j * line.get_ydata()
    radius = 0.5 / damping
    assert np.abs(np.abs(z - radius) - radius).max() < 2e-3 * radius
    corners = np.abs(np.angle(np.diff(z)[1:] / np.diff(z)[:-1]))
    assert np.degrees(corners.max()) < 10.0


def test_sharp_corners_of_a_curve_stay() -> None:
    z = np.array([0.0, 1.0, 1.0 + 1.0j, 0.0 + 1.0j, 0.0, 1.0])
    assert np.array_equal(rounded(z), z)
    gap = np.array([0.0, 1.0, np.nan, 2.0, 3.0, 4.0], complex)
    assert np.isnan(rounded(gap)).sum() == 1


def test_equal_steps_are_drawn_as_a_level_line() -> None:
    motion = mb.simulate(mb.examples.four_bar(), t=0.13, step=0.01, method="generalized-alpha")
    low, high = motion.plot("steps").axes[0].get_ylim()
    assert low == 0.0 and 0.011 < high < 0.02
