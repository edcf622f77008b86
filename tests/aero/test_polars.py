"""Polars, blades and wind against closed forms, SciPy's interpolation and files as AeroDyn writes them."""

from __future__ import annotations

import doctest
import importlib

import mbrs as mb
import numpy as np
import pytest
from mbrs.aero.polars import wrap
from mbrs.errors import ModelError
from scipy.interpolate import PchipInterpolator

RNG = np.random.default_rng(20)


def random_table(n, low=-0.7, high=0.9):
    angle = np.sort(RNG.uniform(low, high, n))
    return angle, RNG.normal(size=n), RNG.uniform(0.003, 0.9, n), RNG.normal(size=n)


def plate(n=41, drag=0.02, **more):
    """A section with the whole circle: cl = 2 pi sin a cos a, cd = drag + sin^2 a."""
    a = np.linspace(-np.pi, np.pi, n)
    return mb.aero.polar(a, np.pi * np.sin(2 * a), drag + np.sin(a) ** 2, -0.1 * np.sin(2 * a), **more)


@pytest.mark.parametrize("n", [2, 3, 7, 41])
def test_pchip_is_that_of_scipy(n):
    angle, *columns = random_table(n)
    p = mb.aero.polar(angle, *columns)
    a = RNG.uniform(angle[0], angle[-1], 300)
    for k, column in enumerate(columns):
        # SciPy cannot interpolate two points by itself: that is the straight line
        truth = PchipInterpolator(angle, column) if n > 2 else np.poly1d(np.polyfit(angle, column, 1))
        slope = truth.derivative() if n > 2 else truth.deriv()
        size = np.abs(np.diff(column) / np.diff(angle)).max()
        assert np.abs(p.coefficients(a)[:, k] - truth(a)).max() < 1e-13 * (1 + size)
        assert np.abs(p.slopes(a)[:, k] - slope(a)).max() < 1e-11 * (1 + size)


@pytest.mark.parametrize("interpolation", ["pchip", "linear"])
def test_an_interpolation_adds_no_extremes_and_meets_its_table(interpolation):
    for _ in range(20):
        angle, *columns = random_table(23)
        p = mb.aero.polar(angle, *columns, interpolation=interpolation)
        assert np.abs(p.coefficients(angle) - np.stack(columns, axis=1)).max() < 1e-13 * 5
        for i in range(22):
            inner = p.coefficients(np.linspace(angle[i], angle[i + 1], 40))
            ends = np.stack(columns, axis=1)[i : i + 2]
            assert np.all(inner >= ends.min(axis=0) - 1e-12) and np.all(inner <= ends.max(axis=0) + 1e-12)


def test_refinement_converges_to_the_function_second_order_or_better():
    a = RNG.uniform(-np.pi, np.pi, 4000)
    errors = [np.abs(plate(n).coefficients(a)[:, 0] - np.pi * np.sin(2 * a)).max() for n in (41, 81, 161)]
    assert errors[0] / errors[1] > 3.5 and errors[1] / errors[2] > 3.5 and errors[2] < 2e-3


def test_a_whole_circle_closes():
    p = plate()
    a = RNG.uniform(-np.pi, np.pi, 50)
    assert p.whole_circle and np.all(p.covers(RNG.normal(size=50) * 90))
    for turns in (-3, 1, 2):
        assert np.abs(p.coefficients(a + 2 * np.pi * turns) - p.coefficients(a)).max() < 1e-12
    # value and slope are continuous where the circle closes
    step = 1e-9
    assert np.abs(p.coefficients(np.pi - step) - p.coefficients(-np.pi + step)).max() < 1e-7
    assert np.abs(p.slopes(np.pi) - p.slopes(-np.pi)).max() < 1e-12
    # five digits of pi, and coefficients rounded at the fourth digit, are still the circle; more is refused
    digits = np.linspace(-3.14159, 3.14159, 9)
    table = np.zeros(9)
    table[-1] = 0.9e-4
    assert mb.aero.polar(digits, table, table + 0.01).whole_circle
    table[-1] = 3e-4
    with pytest.raises(ModelError, match="the same flow"):
        mb.aero.polar(digits, table, table + 0.01)


def test_angles_within_a_turn_stay_bit_by_bit():
    a = np.r_[RNG.uniform(-np.pi, np.pi, 200), np.pi, -np.pi, 0.0]
    assert np.array_equal(wrap(a), a)


def test_the_angle_that_a_table_lacks_is_named():
    p = mb.aero.polar([-0.31, 0.0, 0.27], [-1.9, 0, 1.7], [0.02] * 3, name="root")
    with pytest.raises(ModelError, match=r"'root' covers -17.76 to 15.47 degrees, not 17.19.*extend"):
        p.coefficients([0.1, 0.3])
    b = mb.aero.blade([1.3, 2.9, 7.1], 0.7, 0.1, [p, p, plate(name="tip")])
    with pytest.raises(ModelError, match=r"'root'.*at 4 m \(station 2 of 3\) is 28.65 degrees"):
        b.coefficients([1.5, 4.0], [0.1, 0.5])
    b.coefficients([1.5, 7.1], [0.1, 0.5])  # the tip has the whole circle


@pytest.mark.parametrize("low", [-0.05, -0.4])
def test_the_extension_meets_viternas_equations_and_the_table(low):
    high, aspect = 0.27, 13.7
    a = np.linspace(low, high, 15)
    p = mb.aero.polar(a, 5.9 * a + 0.3, 0.009 + 0.3 * a**2, -0.07 + 0.1 * a, thickness=0.21, name="s")
    e = p.extend(aspect)
    assert e.whole_circle and e.thickness == 0.21 and e.name == "s" and e.extend(aspect) is e
    assert np.array_equal(e.coefficients(a), p.coefficients(a))
    # Viterna and Corrigan's equations, as they print them
    plate_drag = 1.11 + 0.018 * aspect
    cl, cd, _ = p.coefficients(high)
    a2 = (cl - plate_drag * np.sin(high) * np.cos(high)) * np.sin(high) / np.cos(high) ** 2
    b2 = (cd - plate_drag * np.sin(high) ** 2) / np.cos(high)
    nodes = e.angle[(e.angle > high) & (e.angle <= np.pi / 2)]
    truth_l = plate_drag / 2 * np.sin(2 * nodes) + a2 * np.cos(nodes) ** 2 / np.sin(nodes)
    truth_d = plate_drag * np.sin(nodes) ** 2 + b2 * np.cos(nodes)
    assert np.abs(e.coefficients(nodes)[:, 0] - truth_l).max() < 1e-12
    assert np.abs(e.coefficients(nodes)[:, 1] - truth_d).max() < 1e-12
    # mirrored past 90 degrees; continuous everywhere; the force never pushes against the flow
    behind = nodes[nodes > high]
    close = e.coefficients(np.pi - behind)
    assert np.abs(close[:, 0] + 0.7 * e.coefficients(behind)[:, 0]).max() < 0.05
    fine = np.linspace(-np.pi, np.pi, 20001)
    assert np.abs(np.diff(e.coefficients(fine), axis=0)).max() < 0.02
    assert e.coefficients(fine)[:, 1].min() > 0.0
    assert e.coefficients(np.pi / 2)[1] == pytest.approx(plate_drag, abs=2e-2)


def test_the_extension_of_a_plate_presses_in_the_middle_of_its_chord():
    a = np.linspace(-0.2, 0.25, 10)
    p = mb.aero.polar(a, 2 * np.pi * a, 0.01 + 0 * a, -0.02 + 0 * a).extend(10.0)
    cl, cd, cm = p.coefficients(np.pi / 2)
    assert cm == pytest.approx(-0.25 * cd, rel=0.02) and abs(cl) < 0.1
    assert not np.any(mb.aero.polar(a, 2 * np.pi * a, 0.01 + 0 * a).extend(10.0).moment)


AERODYN15 = """! --- AirfoilInfo v1.01.x Input File ---
"DEFAULT"  InterpOrd ! order
 1   NonDimArea ! area
 0   NumCoords  ! none
 2   NumTabs    ! tables
! table 1
 0.75 Re ! millions
 0 UserProp
False InclUAdata
 3 NumAlf ! lines
! Alpha Cl Cd Cm
 -10.0 -1.0 0.020 0.01
   0.0  0.1 0.010 0.00
  10.0  1.2 0.030 -0.01
! table 2
 3.0 Re
False InclUAdata
 2 NumAlf
 -5.0 -0.5 0.02
 5.00 0.7 1.0D-2
"""
AERODYN12 = """A section
second title
2   Number of airfoil tables in this file
 1.0 3.0   Reynolds numbers in millions
 0.0 0.0 Control setting
-10.0 -1.0 0.02 0.01 -1.1 0.03 0.02
10.0 1.2 0.03 -0.01 1.3 0.04 -0.02
EOT
"""


def test_files_of_aerodyn_and_columns(tmp_path):
    file = tmp_path / "s809.dat"
    file.write_text(AERODYN15)
    p = mb.aero.read_polar(file, thickness=0.21)
    assert p.name == "s809" and p.thickness == 0.21
    assert np.array_equal(p.angle, np.radians([-10.0, 0.0, 10.0]))
    assert np.array_equal(np.c_[p.lift, p.drag, p.moment], [[-1.0, 0.02, 0.01], [0.1, 0.01, 0.0], [1.2, 0.03, -0.01]])
    second = mb.aero.read_polar(file, table=2, name="other", interpolation="linear")
    assert second.name == "other" and np.array_equal(second.drag, [0.02, 0.01]) and not second.moment.any()
    file.write_text(AERODYN12)
    for table, lift in ((1, [-1.0, 1.2]), (2, [-1.1, 1.3])):
        assert np.array_equal(mb.aero.read_polar(file, table=table).lift, lift)
    assert np.array_equal(mb.aero.read_polar(file, table=2).moment, [0.02, -0.02])
    for text in ("# note\nalpha;cl;cd\n-0.3;1;2\n0.5;3;4\n", "-0.3 1 2\n\n0.5 3 4"):
        file.write_text(text)
        assert np.array_equal(mb.aero.read_polar(file).angle, np.radians([-0.3, 0.5]))
    file.write_text("angle [rad], lift, drag, moment\n-0.3, 1, 2, .5\n0.5, 3, 4, 5.\n")
    p = mb.aero.read_polar(file)
    assert np.array_equal(p.angle, [-0.3, 0.5]) and np.array_equal(p.moment, [0.5, 5.0])


def test_a_repeated_line_counts_once_and_a_contradiction_is_refused(tmp_path):
    file = tmp_path / "bad.csv"
    file.write_text("-8 1 2\n-3 2 1\n-3.0 2.0 1\n5 3 4\n")
    assert len(mb.aero.read_polar(file).angle) == 3
    file.write_text("-8 1 2\n-3 2 1\n-3.0 2.1 1\n5 3 4\n")
    with pytest.raises(ModelError, match="must increase"):
        mb.aero.read_polar(file)


@pytest.mark.parametrize(
    "text, table, message",
    [
        ("", 1, "no numbers"),
        ("a,b,c\n1,2,x\n", 1, "line 2"),
        ("1,2,3\n4,5\n", 1, "line 2: 3 numbers"),
        ("1,2,3\n4,5,nan\n", 1, "line 2"),
        ("1,2,3\n2,5,6\n", 2, "one table"),
        (AERODYN15, 3, "holds 2 tables, not 3"),
        (AERODYN12, 3, "holds 2 tables, not 3"),
        (AERODYN15.replace(" 3 NumAlf", " x NumAlf"), 1, "line 10: a count"),
        (AERODYN15.replace(" 2 NumAlf", " 9 NumAlf"), 2, "after 2 of 9"),
        (AERODYN12.split("-10.0")[0], 1, "no line has"),
    ],
)
def test_damaged_files_are_named(tmp_path, text, table, message):
    file = tmp_path / "bad.dat"
    file.write_text(text)
    with pytest.raises(ModelError, match=message):
        mb.aero.read_polar(file, table=table)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(ModelError, match=r"cannot read the polar 'none.dat'"):
        mb.aero.read_polar(tmp_path / "none.dat")


def test_sections_between_thicknesses_are_linear_in_them():
    sections = [plate(thickness=t, drag=d) for t, d in ((0.4, 0.5), (0.18, 0.02), (0.25, 0.11))]
    b = mb.aero.blade([1.1, 5.3, 9.7], [1.4, 1.2, 0.3], 0.0, sections, thickness=[0.37, 0.25, 0.19])
    r = np.array([1.1, 3.2, 5.3, 8.1])
    t = np.interp(r, [1.1, 5.3, 9.7], [0.37, 0.25, 0.19])
    a = RNG.uniform(-np.pi, np.pi, (6, 4))
    drag = np.interp(t, [0.18, 0.25, 0.4], [0.02, 0.11, 0.5])
    base = plate(drag=0.0).coefficients(a)[..., 1]
    assert np.abs(b.coefficients(r, a)[..., 1] - base - drag).max() < 1e-12
    assert np.abs(b.weights(r).sum(axis=1) - 1).max() < 1e-14
    # one polar per station: linear between the stations
    c = mb.aero.blade([1.1, 5.3, 9.7], 1.0, 0.0, [sections[0], sections[1], sections[1]])
    assert len(c.polars) == 2
    assert c.coefficients([3.2], [0.3])[0, 1] - plate(drag=0.0).coefficients(0.3)[1] == pytest.approx(0.26, abs=1e-12)


def test_slopes_of_a_blade_are_derivatives():
    b = mb.aero.blade([1.0, 2.0], 1.0, 0.0, [plate(), plate(drag=0.3)])
    a, h = np.array([0.377]), 1e-6
    w = b.weights([1.3])
    difference = (b.mix(w, a + h) - b.mix(w, a - h)) / (2 * h)
    assert np.abs(b.mix(w, a, slope=True) - difference).max() < 1e-7


@pytest.mark.parametrize(
    "change, message",
    [
        ({"stations": [1.0, 3.0, 2.9]}, r"station 3 \(2.9 m\) follows 3 m"),
        ({"stations": [1.0]}, "at least two"),
        ({"chord": [1.0, 0.0, 1.0]}, r"chord must be positive, at station 2 \(2 m\) it is 0 m"),
        ({"chord": [1.0, 1.0, -0.2]}, "at station 3"),
        ({"chord": 0.0}, "chord must be positive"),
        ({"chord": [1.0, 2.0]}, "one for each of 3 stations"),
        ({"twist": [0.1, np.nan, 0.1]}, "twist contains NaN"),
        ({"aerodynamic_center": 1.2}, "from 0 to 1"),
        ({"polar": "naca"}, "mb.aero.polar"),
        ({"polar": [plate()] * 2}, "2 polars for 3 stations"),
        ({"thickness": 0.2}, "no thickness"),
        ({"polar": [plate(thickness=0.2)] * 2, "thickness": 0.2}, "the same thickness"),
        ({"polar": [plate(thickness=0.2), plate(thickness=0.3)], "thickness": [0.2, 0.31, 0.3]}, "0.31 of station 2"),
    ],
)
def test_blades_that_cannot_be(change, message):
    good = {"stations": [1.0, 2.0, 3.0], "chord": 1.0, "twist": 0.0, "polar": plate()}
    mb.aero.blade(**good)
    with pytest.raises(ModelError, match=message):
        mb.aero.blade(**(good | change))


@pytest.mark.parametrize(
    "change, message",
    [
        ({"angle": [0.1, 0.1, 0.2]}, "must increase; entry 2"),
        ({"angle": [-10.0, 0.0, 10.0]}, "in radians"),
        ({"drag": [0.1, -0.1, 0.1]}, "negative at 0 rad"),
        ({"lift": [0.1, 0.2]}, "3 entries"),
        ({"lift": [0.1, np.nan, 0.2]}, "NaN"),
        ({"interpolation": "cubic"}, "interpolation of polars"),
        ({"thickness": 0.0}, "must be positive"),
    ],
)
def test_polars_that_cannot_be(change, message):
    good = {"angle": [-0.1, 0.0, 0.1], "lift": [-0.6, 0.0, 0.6], "drag": [0.1, 0.1, 0.1]}
    mb.aero.polar(**good)
    with pytest.raises(ModelError, match=message):
        mb.aero.polar(**(good | change))


def test_wind_with_shear():
    w = mb.aero.wind(7.3, (0.31, -0.83, 0.46), shear=0.17, reference_height=71.0, up=(0.1, 0.2, 0.97))
    p = RNG.normal(size=(4, 5, 3)) * 40
    up = np.array([0.1, 0.2, 0.97]) / np.linalg.norm([0.1, 0.2, 0.97])
    d = np.array([0.31, -0.83, 0.46]) / np.linalg.norm([0.31, -0.83, 0.46])
    truth = 7.3 * (np.maximum(p @ up, 0) / 71.0)[..., None] ** 0.17 * d
    assert np.abs(w.velocity(p) - truth).max() < 1e-12
    assert np.abs(w.velocity(71.0 * up) - 7.3 * d).max() < 1e-12
    assert np.array_equal(mb.aero.wind(5.0, "y").velocity(np.zeros((2, 3))), [[0, 5, 0], [0, 5, 0]])


@pytest.mark.parametrize(
    "change, message",
    [
        ({"speed": np.nan}, "speed must be a finite number, it is nan"),
        ({"speed": -1.0}, "not be negative"),
        ({"direction": "north"}, "direction"),
        ({"direction": (0, 0, 0)}, "direction"),
        ({"shear": 0.2, "reference_height": None}, "needs reference_height"),
        ({"shear": -0.2}, "from 0 to 1"),
        ({"reference_height": 0.0}, "positive"),
    ],
)
def test_winds_that_cannot_be(change, message):
    with pytest.raises(ModelError, match=message):
        mb.aero.wind(**({"speed": 8.0, "reference_height": 80.0} | change))


@pytest.mark.parametrize("module", ["polars", "polar_files", "blades", "winds"])
def test_examples_of_docstrings(module):
    found = doctest.testmod(importlib.import_module(f"mbrs.aero.{module}"))
    assert found.attempted > 0 and found.failed == 0
