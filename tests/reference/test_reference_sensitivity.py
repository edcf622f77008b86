"""Derivatives: complex steps against differences of the whole chain, eigenpairs against 50 digits, loops that would
break.
"""

from __future__ import annotations

import numpy as np
import pytest
from mbrs.errors import NotDifferentiableError
from mbrs.reference import (
    System,
    derivative,
    drawn_state,
    eigenvalue_derivative,
    equilibrium,
    frequency_derivative,
    frf,
    frf_derivative,
    group_matrix,
    linearize,
    modes,
    motion_rows,
    real_part,
    response,
    shape_derivative,
)
from mbrs.reference.assembly import mobility
from oracles.closure import closure_curvature, closure_defect
from oracles.precise import mp_eigenvalue_derivative
from reference_models import Builder, cubic_hexapod, hanging_four_bar, ladder, quaternion


def loaded_mechanism():
    """A sagging spatial loop with a slider, a bushing, a follower force; every group of numbers matters. Invented
    data.
    """
    b = Builder(gravity=(0.4, -9.81, 0.3))
    b.body(
        "crank",
        1.2,
        (0.02, 0.03, 0.025, 0.001),
        at=(0.1, 0.4, 0),
        q=quaternion((0, 1, 1), 0.3),
        com=(0.02, 0.01, -0.03),
    )
    b.body("rod", 0.9, (0.02, 0.04, 0.03), at=(0.6, 0.8, 0.1), q=quaternion((1, 0, 1), 0.8))
    b.body("slide", 2.0, (0.03, 0.03, 0.03), at=(1.1, 0.4, 0))
    b.joint("A", "revolute", None, "crank", (0, 0, 0), axis=(0, 0.1, 1), k=[30], c=[0.2], preload=[0.5])
    b.joint(
        "B", "universal", "crank", "rod", (0.2, 0.8, 0), axis=(1, 0.2, 0), axis2=(0, 0, 1), k=[20, 25], c=[0.1, 0.1]
    )
    b.joint("C", "spherical", "rod", "slide", (1.0, 0.8, 0.1), k=[15, 12, 10], c=[0.2, 0.1, 0.1])
    b.joint("D", "cylindrical", "slide", None, (1.2, 0, 0), axis=(0.2, 1, 0), k=[300, 20], c=[1, 0.1])
    K = np.diag([200.0, 300, 250, 5, 6, 7]) + 2
    q = quaternion((1, 2, 3), 0.4)
    b.bushing("mount", None, "rod", (0.6, 0.9, 0), K, c=0.01 * K, preload=np.arange(6) / 5, q=q)
    b.spring("spring", "crank", "slide", (0, 0.5, 0.1), (1, 0.3, 0), k=150.0, c=2.0, length=-0.05, preload=3.0)
    b.torsion("twist", "crank", "rod", (0.2, 0.8, 0), (0, 1, 1), 4.0, 0.1, 0.05, 0.3)
    b.load("pull", "force", "rod", (0.7, 0.8, 0), (1, -2, 1), follower=True)
    return b


def at_equilibrium(sys):
    return equilibrium(sys)[0]


PARAMETERS = [
    ("gravity", 1), ("crank", 0), ("crank", 4), ("crank", 8), ("crank", 10), ("crank", 14), ("slide", 1), ("slide", 12),
    ("A", 0), ("A", 3), ("A", 6), ("B", 1), ("B", 4), ("B", 6), ("B", 9), ("C", 2), ("C", 16), ("C", 28), ("D", 0),
    ("D", 3), ("D", 6), ("D", 16), ("D", 22), ("A", 28), ("mount", 0), ("mount", 4), ("mount", 7), ("mount", 11),
    ("mount", 47), ("mount", 83), ("spring", 0), ("spring", 4), ("spring", 6), ("spring", 7), ("spring", 8),
    ("spring", 9), ("twist", 3), ("twist", 6), ("twist", 8), ("twist", 9), ("pull", 0), ("pull", 4),
]  # fmt: skip


def unit(b, name, offset):
    """One number in x; joints' coincident points move together, so that the loop stays closed as drawn."""
    d = np.zeros(len(b.x))
    d[b.address[name] + offset] = 1.0
    if name in "ABCD" and offset < 6:
        d[b.address[name] + offset % 3 + np.array([0, 3])] = 1.0
    return d


@pytest.mark.oracle
def test_followed_equilibrium_against_differences():
    """Central differences of order four of equilibrium and linearisation, for numbers of every sort."""
    b = loaded_mechanism()
    tables = b.tables()
    assert mobility(System(tables)).dof == 2
    h, worst = 1e-3, 0.0
    base = linearize(System(tables), at_equilibrium(System(tables)))
    independent = base.partition.independent.tolist()
    for name, offset in PARAMETERS:
        d = unit(b, name, offset)
        lin, rate = derivative(tables, d, lambda s: equilibrium(s, base.state)[0], independent)
        parts = {"M": [], "C": [], "K": [], "N": [], "T": [], "r": []}
        for step in (-2, -1, 1, 2):
            sys = System(tables, tables["x"] + step * h * d)
            near = linearize(sys, equilibrium(sys, base.state)[0], independent)
            for key, values in parts.items():
                values.append(near.state.r if key == "r" else getattr(near, key))
        rates = {"M": rate.M, "C": rate.C, "K": rate.K, "N": rate.N, "T": rate.T, "r": rate.position}
        for key, (a, c, e, g) in parts.items():
            expected = (a - 8 * c + 8 * e - g) / (12 * h)
            error = np.max(np.abs(rates[key] - expected)) / (np.max(np.abs(getattr(lin, key, lin.state.r))) + 1)
            worst = max(worst, error)
            assert error < 1e-7, (name, offset, key)
    print("worst", worst)


@pytest.mark.oracle
@pytest.mark.parametrize("state_of", [at_equilibrium])
def test_eigenpairs_against_fifty_digits(state_of):
    b = loaded_mechanism()
    tables = b.tables()
    for name, offset in PARAMETERS[::4]:
        lin, d = derivative(tables, unit(b, name, offset), state_of)
        lin = real_part(lin)
        m = modes(lin.M, lin.C, lin.G, lin.K, lin.N)
        assert not m.symmetric  # the follower force
        check_pairs(lin, m, d)


def check_pairs(lin, m, d):
    ds = eigenvalue_derivative(lin, m, d)
    for i, s in enumerate(m.eigenvalue):
        dphi = shape_derivative(lin, m, d, i)
        exact, shape = mp_eigenvalue_derivative(lin.M, lin.D, lin.S, d.M, d.D, d.S, s, m.shape[:, i], m.symmetric)
        assert abs(ds[i] - exact) <= 1e-8 * (abs(exact) + abs(s))
        np.testing.assert_allclose(dphi, shape, atol=1e-8 * (np.max(np.abs(shape)) + np.max(np.abs(m.shape[:, i]))))


def test_symmetric_eigenpairs_against_fifty_digits():
    rng = np.random.default_rng(2)
    b = cubic_hexapod()
    start = b.address["leg0"]
    b.x[start + 6] *= 1.3
    b.x[b.address["leg3"] + 6] *= 0.8
    b.x[b.address["leg4"] + 7] *= 3
    tables = b.tables()
    direction = np.zeros(len(b.x))
    direction[start : start + 8] = rng.normal(size=8) * np.r_[np.full(6, 0.1), 1e4, 1]
    direction[b.address["payload"] + np.array([10, 12])] = 1.0, 0.01
    lin, d = derivative(tables, direction)
    lin = real_part(lin)
    m = modes(lin.M, lin.C, lin.G, lin.K, lin.N)
    assert m.symmetric and not m.groups
    check_pairs(lin, m, d)
    undamped = modes(lin.M, None, None, lin.K, None)
    d.C, d.G, lin.C, lin.G = (np.zeros((6, 6)) for _ in range(4))
    check_pairs(lin, undamped, d)


def test_closed_form_sensitivities_of_the_hexapod():
    """df/dk = f / 2k with all legs' k together; a repeated group splits along one leg but its trace is the closed
    form's.
    """
    b = cubic_hexapod()
    tables = b.tables()
    all_legs = np.zeros(len(b.x))
    for i in range(6):
        all_legs[b.address[f"leg{i}"] + 6] = 1.0
    lin, d = derivative(tables, all_legs)
    lin = real_part(lin)
    lin.C, d.C = np.zeros((6, 6)), np.zeros((6, 6))
    m = modes(lin.M, None, None, lin.K, None)
    df, _ = frequency_derivative(m.eigenvalue, eigenvalue_derivative(lin, m, d))
    np.testing.assert_allclose(df, m.frequency / 2e5, rtol=1e-10)
    one = np.zeros(len(b.x))
    one[b.address["leg0"] + 6] = 1.0
    _, d1 = derivative(tables, one)
    split = np.linalg.eigvals(group_matrix(lin, m, d1, m.groups[0])).imag
    assert np.sum(split) == pytest.approx(3 * m.eigenvalue[0].imag / 2e5 / 6)
    assert np.min(np.abs(split)) < 1e-12 * np.max(np.abs(split)) + 1e-18
    with pytest.raises(NotDifferentiableError):
        shape_derivative(lin, m, d1, 0)


@pytest.mark.slow
def test_transfer_function_and_response_derivatives():
    """dH from the formula against a fourth-order difference of H; the response by a complex step through the
    exponential.
    """
    b = loaded_mechanism()
    tables, omega = b.tables(), np.array([2.0, 15.0, 60.0])
    d = unit(b, "C", 1)
    lin, rate = derivative(tables, d, at_equilibrium)
    lin, sys = real_part(lin), System(tables)
    independent = lin.partition.independent.tolist()
    rows = motion_rows(sys, lin, "rod")
    drows = rate.T[6:12]
    F, L, dF, dL = rows[:3].T, rows, drows[:3].T, drows
    dH = frf_derivative((lin.M, lin.D, lin.S, F, L), (rate.M, rate.D, rate.S, dF, dL), omega)
    t = np.linspace(0, 1, 11)
    force = np.sin(9 * t)[:, None] * [1.0, 0, 2.0]
    step = 1e-30j
    dy = (
        response(lin.M + step * rate.M, lin.D + step * rate.D, lin.S + step * rate.S, F + step * dF, t, force)[0].imag
        / 1e-30
    )
    values, h = [], 1e-3
    for k in (-2, -1, 1, 2):
        near = System(tables, tables["x"] + k * h * d)
        there = linearize(near, equilibrium(near)[0], independent)
        R = motion_rows(near, there, "rod")
        values.append(
            (
                frf(there.M, there.D, there.S, R[:3].T, R, omega),
                response(there.M, there.D, there.S, R[:3].T, t, force)[0],
            )
        )
    for derivative_found, (a, c, e, g) in zip((dH, dy), zip(*values, strict=True), strict=True):
        expected = (a - 8 * c + 8 * e - g) / (12 * h)
        np.testing.assert_allclose(derivative_found, expected, atol=1e-7 * np.max(np.abs(expected)))


def test_a_parameter_that_breaks_a_redundant_loop():
    """Tilting one hinge of a planar four-bar takes its freedom away; stretching it in its plane does not."""
    b = hanging_four_bar()
    tables, tilt, stretch = b.tables(), np.zeros(len(b.x)), np.zeros(len(b.x))
    tilt[b.address["B"] + 6] = 1.0
    stretch[b.address["B"] + np.array([1, 4])] = 1.0
    assert closure_defect(tables, tilt) > 0.1
    assert closure_defect(tables, stretch) < 1e-12
    b = ladder(2, "revolute")
    direction = np.zeros(len(b.x))
    direction[b.address["high11"] + np.array([2, 5])] = 1.0  # along the parallel axes
    assert closure_defect(b.tables(), direction) < 1e-12


def flat(lengths):
    """A four-bar lying flat along x, hinges about z."""
    b, x = Builder(), np.cumsum([0.0, *lengths])
    names = [None, "b0", "b1", "b2", None]
    for i in range(3):
        b.body(f"b{i}", 1.0, (0.1, 0.1, 0.1), at=((x[i] + x[i + 1]) / 2, 0, 0))
    for i in range(4):
        b.joint(f"j{i}", "revolute", names[i], names[i + 1], (x[i], 0, 0))
    return System(b.tables())


def test_a_singular_pose_shows_in_second_order():
    """The flat parallelogram has two apparent freedoms; the upright one has one, with no curvature left over."""
    sys = flat([1.0, 2.0, -1.0])  # down the crank, along the coupler, back: all on one line
    H = closure_curvature(sys, drawn_state(sys))
    assert mobility(sys).dof == 2
    assert np.max(np.abs(H)) > 0.1
    upright = System(hanging_four_bar().tables())
    assert np.max(np.abs(closure_curvature(upright, drawn_state(upright)))) < 1e-12
