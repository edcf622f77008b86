"""Orientations as matrices of expressions: the rotation itself, and its derivative by the parameters, at every angle."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.model.directions import directions
from mbrs.model.tables import tables
from scipy.spatial.transform import Rotation


def model(angle, fixed):
    m = mb.Model("turned")
    a = m.parameter("a", angle, unit="rad")
    c, s = np.cos(a), np.sin(a)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]], dtype=object)
    m.body("b", mass=1.0, inertia=(1, 2, 2.5), orientation=(fixed @ turn).tolist())
    return m


def drawn(m):
    start = tables(m)["body_x"][0]
    q = tables(m)["x"][start + 3 : start + 7]
    return q, Rotation.from_quat(np.roll(q, -1)).as_matrix()


@pytest.mark.parametrize("seed", range(6))
def test_a_matrix_of_expressions_is_the_rotation_and_has_its_derivative(seed):
    rng = np.random.default_rng(seed)
    fixed = Rotation.random(rng=rng).as_matrix()
    angle = float(rng.uniform(-np.pi, np.pi))
    m = model(angle, fixed)
    q, R = drawn(m)
    assert pytest.approx(fixed @ Rotation.from_rotvec([0, 0, angle]).as_matrix(), abs=1e-12) == R
    dq = directions(m, ["a"]).dense[:, 0][tables(m)["body_x"][0] + 3 :][:4]
    # dR = R(q + h dq)' by complex step of the homogeneous form
    w, x, y, z = q + 1e-30j * dq
    S = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    dR = ((np.eye(3) + 2 * (w * S + S @ S) / (w * w + x * x + y * y + z * z)).imag) / 1e-30
    turn = Rotation.from_rotvec([0, 0, angle]).as_matrix()
    assert dR == pytest.approx(fixed @ turn @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 0]]), abs=1e-12)
    m.set({"a": angle + 0.2})
    assert drawn(m)[1] == pytest.approx(fixed @ Rotation.from_rotvec([0, 0, angle + 0.2]).as_matrix(), abs=1e-12)


def test_a_matrix_that_is_no_rotation_is_refused():
    m = mb.Model("m")
    a = m.parameter("a", 0.3)
    with pytest.raises(mb.errors.ModelError, match="orthonormal"):
        m.body("b", mass=1, inertia=(1, 1, 1), orientation=[[a, 0, 0], [0, 1, 0], [0, 0, 1]])
