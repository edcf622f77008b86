"""What a picture says: units of its axes, scales that are not rounding, names of settings, marks that are seen."""

from __future__ import annotations

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
import pytest
from mbrs._lib.text import counted

TILT = mb.rotation((0.31, -0.83, 0.46), 0.7)


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def carriage():
    m = mb.Model("carriage")
    a = m.body("a", mass=1.7, inertia=(0.1, 0.2, 0.3), orientation=TILT)
    b = m.body("b", mass=0.9, inertia=(0.03,) * 3, orientation=TILT)
    m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis=(0.31, -0.83, 0.46), c=0.61)
    m.revolute("hub", m.ground, b, at=(0, 0, 0), axis=(0.7, 0.2, -0.5), c=0.017)
    return m


def test_speeds_of_a_steady_motion_have_their_units():
    title = mb.steady_motion(carriage(), {"rail": 0.7, "hub": 13.0}).plot().axes[0].get_title(loc="left")
    assert title == "steady motion: rail 0.7 m/s, hub 13 rad/s"


def test_undamped_poles_lie_on_an_axis_that_is_not_scaled_to_rounding():
    K = np.array([[3.1, -1.7], [-1.7, 2.9]])
    undamped, damped = (mb.modes(mb.MechanicalSystem(np.diag([1.3, 0.7]), C, K)) for C in (None, 0.01 * K))
    assert undamped.plot().axes[0].get_xlim() == (-1.0, 1.0)
    low, high = damped.plot().axes[0].get_xlim()
    assert low < damped.eigenvalue.real.min() and high < 0.1


@pytest.mark.parametrize("fastest", [120.0, 290.0])
def test_engine_orders_are_named_where_their_lines_end_or_leave_the_picture(fastest):
    diagram = mb.campbell(mb.examples.rotor(), "shaft", speed=np.linspace(10.0, fastest, 4))
    axes = diagram.plot().axes[0]
    top = axes.get_ylim()[1]
    found = {text.get_text(): text.xy for text in axes.texts}
    assert set(found) == {"1x", "2x"}
    for order, name in ((1, "1x"), (2, "2x")):
        speed, frequency = found[name]
        assert frequency == pytest.approx(order * speed / (2 * np.pi))
        assert speed == pytest.approx(fastest) or frequency == pytest.approx(0.96 * top)


def test_energies_are_drawn_and_tabled_over_time():
    m = carriage()
    m.gravity = (0.0, 0.0, -9.81)
    energy = mb.simulate(m, t=[0.0, 0.3, 0.4, 1.1]).energy
    axes = energy.plot().axes[0]
    assert axes.get_xlabel() == "t [s]" and axes.lines[0].get_xdata().tolist() == [0.0, 0.3, 0.4, 1.1]
    assert next(iter(energy.columns().values())).tolist() == [0.0, 0.3, 0.4, 1.1]


def test_displacements_of_a_model_have_units():
    m = mb.examples.clearance_oscillator()
    curve = mb.frequency_response(m, inputs="mass.force.x", amplitude=3.0, frequency=(5, 9), harmonics=5)
    assert curve.plot("mass.motion.x").axes[0].get_ylabel().endswith("of mass.motion.x [m]")
    orbit = curve.point(0).plot_orbit("mass.motion.x").axes[-1]
    assert orbit.get_xlabel() == "mass.motion.x [m]" and orbit.get_ylabel() == "d/dt mass.motion.x [m/s]"


def test_settings_of_a_study_are_named():
    def solve(n, samples, way):
        return np.array([1.0 / n + 1e-3 / float(samples) * (way == "a")])

    study = mb.accuracy_study(solve, n=[3, 5, 9], samples=["64", "128"], way=["a", "b"], reference=np.array([0.0]))
    axes = study.plot().axes[0]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        f"samples = {n}, way = {way}" for n in ("64", "128") for way in "ab"
    ]
    assert axes.texts[-1].get_text().endswith("beside the points: n")


def test_terms_of_rounding_print_as_zero():
    s = mb.MechanicalSystem(M=[[1.3]], C=[[0.07]], K=[[1.9]], elements=[mb.Cubic(0.23, w=[1.0])], coordinates=["x"])
    _, rows = mb.harmonic_balance(s, force=[0.31], omega=1.1, harmonics=5).rows()
    assert rows[0][1] == rows[0][3] == 0.0 and rows[0][2] > 0.1 and rows[0][4] > 1e-4
    forces = [dict(force=[0.11], omega=0.83), dict(force=[0.07], omega=1.31)]
    _, rows = mb.quasi_periodic(s, forces, harmonics=3).rows()
    sizes = {row[0]: row[2] for row in rows}
    assert sizes["k = (1, 0)"] > 0.01 and sizes["k = (1, 1)"] == sizes["0"] == 0.0


def test_one_thing_is_not_many():
    assert [counted(n, "body") for n in (0, 1, 2)] == ["0 bodies", "1 body", "2 bodies"]
    assert counted(2, "spring or damper") == "2 springs or dampers"
    m = carriage()
    assert repr(m) == "Model('carriage': 2 bodies, 2 joints, 0 springs or dampers, 0 loads, 0 parameters)"


def test_a_single_transfer_function_is_named_in_the_title():
    m = mb.examples.four_bar()
    one = mb.frf(m, "coupler.force.x", "coupler.motion.x", frequency=[2.0, 3.0], at=mb.equilibrium(m))
    axes = one.plot().axes[0]
    assert axes.get_title(loc="left") == "receptance coupler.motion.x / coupler.force.x" and axes.get_legend() is None
    _, given = plt.subplots()
    one.plot(ax=given, label="soft")
    one.plot(ax=given, label="stiff")
    assert [text.get_text() for text in given.get_legend().get_texts()] == ["soft", "stiff"]


def test_bars_of_rounding_are_zero():
    m = mb.Model("two")
    for name, k in (("a", 31.0), ("b", 57.0)):
        body = m.body(name, mass=1.3, inertia=(0.1, 0.2, 0.3), orientation=TILT)
        m.prismatic(f"{name} rail", m.ground, body, at=(0, 0, 0), axis=(0.31, -0.83, 0.46), k=k)
    bars = mb.plot.tornado(mb.sensitivity(mb.modes(m), ["a rail.k", "b rail.k"]), mode=0)
    assert bars.axes[0].texts[1].get_text() == "0"


@pytest.mark.some(2)
@pytest.mark.parametrize("name", ["quarter_car", "slider_crank", "four_bar", "rotor"])
def test_names_in_the_picture_of_a_model_lie_beside_each_other(name):
    figure = getattr(mb.examples, name)().plot()
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    assert len(boxes) > 2
    for i, one in enumerate(boxes):
        for other in boxes[:i]:
            width = min(one.x1, other.x1) - max(one.x0, other.x0)
            height = min(one.y1, other.y1) - max(one.y0, other.y0)
            assert width <= 0 or height < 0.15 * one.height
