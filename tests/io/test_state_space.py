"""State spaces of python-control and SciPy, both ways."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
import scipy.signal
from mbrs.errors import ModelError


def space():
    s = mb.MechanicalSystem(M=np.diag([1.3, 0.7]), C=[[0.3, -0.1], [-0.1, 0.2]], K=[[3.1, -1.7], [-1.7, 2.9]])
    return mb.state_space(s, inputs=[0, 1], outputs=[1], kind="acceleration")


def same(a, b):
    assert all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))


def test_control_both_ways():
    control = pytest.importorskip("control")
    ours = space()
    again = mb.StateSpace.from_control(ours.to_control())
    same(ours, again)
    assert (again.inputs, again.outputs) == (ours.inputs, ours.outputs) and len(again.states) == 4
    given = control.ss(
        *(np.random.default_rng(1).normal(size=s) for s in ((3, 3), (3, 1), (2, 3), (2, 1))),
        inputs=["u"],
        outputs=["a", "b"],
    )
    made = mb.StateSpace.from_control(given)
    same(made, (given.A, given.B, given.C, given.D))
    assert made.outputs == ("a", "b")
    w = 0.7j
    plant = control.tf([1.0, 2.0], [1.0, 0.3, 4.0])
    made = mb.StateSpace.from_control(plant)
    value = made.C @ np.linalg.solve(w * np.eye(2) - made.A, made.B) + made.D
    assert value[0, 0] == pytest.approx((w + 2) / (w * w + 0.3 * w + 4), rel=1e-12)


def test_scipy_both_ways():
    ours = space()
    same(ours, mb.StateSpace.from_scipy(ours.to_scipy()))
    made = mb.StateSpace.from_scipy(scipy.signal.TransferFunction([1.0, 2.0], [1.0, 0.3, 4.0]))
    w = 0.7j
    value = made.C @ np.linalg.solve(w * np.eye(2) - made.A, made.B) + made.D
    assert value[0, 0] == pytest.approx((w + 2) / (w * w + 0.3 * w + 4), rel=1e-12) and made.inputs == ("u0",)


def test_what_is_no_state_space_in_continuous_time():
    control = pytest.importorskip("control")
    eye = np.eye(2)
    with pytest.raises(ModelError, match=r"continuous time; this one has the step 0\.1 s"):
        mb.StateSpace.from_control(control.ss(eye, eye, eye, eye, 0.1))
    with pytest.raises(ModelError, match="continuous time"):
        mb.StateSpace.from_scipy(scipy.signal.StateSpace(eye, eye, eye, eye, dt=0.1))
    for wrong in ("plant", None):
        with pytest.raises(ModelError, match="linear system"):
            mb.StateSpace.from_scipy(wrong)
        with pytest.raises(ModelError, match="linear system"):
            mb.StateSpace.from_control(wrong)
    with pytest.raises(ModelError, match="must hold real numbers and is complex"):
        mb.StateSpace.from_scipy(scipy.signal.StateSpace(1j * eye, eye, eye, eye))
