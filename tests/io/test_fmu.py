"""Functional mock-up units: valid for fmpy, and their motions are those of mbrs."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from hexapods import hexapod
from mbrs.errors import ModelError

fmpy = pytest.importorskip("fmpy")
pytest.importorskip("pythonfmu")
validation = pytest.importorskip("fmpy.validation")

AXIS = np.array([0.36, -0.48, 0.8])


def arm():
    """A heavy arm on an oblique hinge with a spring, and a slider on it; gravity is not along an axis."""
    m = mb.Model("arm", gravity=(1.1, -0.7, -9.6))
    a = m.body("a", mass=1.3, inertia=(0.02, 0.03, 0.025), at=(0.31, 0.12, -0.05))
    b = m.body("b", mass=0.4, inertia=(0.01, 0.01, 0.012), at=(0.5, 0.2, 0.0))
    m.parameter("c", 0.21, unit="N m s")
    m.revolute("hinge", m.ground, a, at=(0, 0, 0), axis=AXIS, k=31.0, c=m["c"])
    m.prismatic("rail", a, b, at=(0.5, 0.2, 0.0), axis=(0.6, 0.8, 0.0), k=190.0, c=0.6)
    m.marker("tip", b, at=(0.55, 0.2, 0.1))
    return m


def run(path, stop, step, given, outputs):
    assert validation.validate_fmu(str(path)) == []
    return fmpy.simulate_fmu(
        str(path), stop_time=stop, output_interval=step, step_size=step, start_values=given, output=outputs
    )


def test_a_linear_unit_steps_exactly(tmp_path):
    """Names that FMI does not take as they are are quoted; held forces are no error, whatever the step."""
    m, _ = hexapod()
    p = m["payload"]
    inputs, outputs = [p.force(AXIS), p.torque("x")], ["payload.motion.z", "payload.motion.ry"]
    path = mb.state_space(m, inputs, outputs).save(tmp_path / "linear.fmu")
    loads = {inputs[0]: lambda t: 3.0, inputs[1]: lambda t: -0.2}
    y = mb.response(m, t=np.linspace(0.0, 0.3, 31), loads=loads, outputs=outputs)
    given = {"'payload.force.(0.36,-0.48,0.8)'": 3.0, "payload.torque.x": -0.2}
    found = run(path, 0.3, 0.01, given, outputs)
    for name, wanted in zip(outputs, y.value, strict=True):
        assert np.abs(found[name] - wanted).max() < 1e-10 * np.abs(wanted).max()


def test_a_whole_model_moves_as_it_does_here(tmp_path):
    """Large motion under gravity with a held force, and another value of a parameter; two units in one process."""
    m = arm()
    path = mb.fmu(m, tmp_path / "arm.fmu", "a.force.y", ["tip.motion.x", m["a"].motion(AXIS[[1, 2, 0]])], rtol=1e-9)
    other = mb.fmu(mb.examples.cubic_hexapod(), tmp_path / "iso.fmu", "payload.force.z", "payload.motion.z", step=1e-3)
    oblique = "'a.motion.(-0.48,0.8,0.36)'"
    found = run(path, 0.5, 0.05, {"a.force.y": 4.0, "c": 0.37}, ["tip.motion.x", oblique])
    m.set({"c": 0.37})
    m.force("push", "a", at=m["a"].values("at"), value=(0, 4.0, 0))
    traj = mb.simulate(m, found["time"], rtol=1e-10)
    x = traj.point("tip")[:, 0] - 0.55
    assert np.abs(x).max() > 0.02 and np.abs(found["tip.motion.x"] - x).max() < 1e-7
    along = (traj.position("a") - traj.position("a")[0]) @ AXIS[[1, 2, 0]]
    assert np.abs(found[oblique] - along).max() < 1e-7
    assert run(other, 0.02, 0.01, {}, ["payload.motion.z"])["payload.motion.z"] == pytest.approx([0.0] * 3, abs=1e-15)


def test_velocities_joints_and_reactions_are_outputs(tmp_path):
    m = arm()
    names = ["a.velocity.x", "b.angular_velocity.z", "hinge.coordinate", "rail.rate", "hinge.reaction[4]"]
    path = mb.fmu(m, tmp_path / "arm.fmu", "a.force.y", names, rtol=1e-9)
    fmi = [*names[:4], "'hinge.reaction[4]'"]
    found = run(path, 0.3, 0.1, {}, fmi)
    traj = mb.simulate(m, found["time"], rtol=1e-10)
    wanted = [
        traj.velocity("a")[:, 0],
        traj.angular_velocity("b")[:, 2],
        traj.joint("hinge"),
        traj.joint_rate("rail"),
        traj.reaction("hinge")[:, 4],
    ]
    for name, values in zip(fmi, wanted, strict=True):
        assert np.abs(found[name] - values).max() < 1e-6 * np.abs(values).max(), name
    for wrong in ("hinge.velocity.x", "a.coordinate", "hinge.coordinate[1]", "hinge.reaction", "a.velocity"):
        with pytest.raises(ModelError, match="does not fit"):
            mb.fmu(m, tmp_path / "arm.fmu", "a.force.y", wrong)


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
def test_what_a_unit_cannot_hold_is_named(tmp_path):
    m = arm()
    for arguments, words in (
        ((tmp_path / "a.zip", "a.force.x", "a.motion.x"), "ends in .fmu"),
        ((tmp_path / "a.fmu", "base.x", "a.motion.x"), "inputs of an FMU are forces"),
        ((tmp_path / "a.fmu", "a.force.x", "a.motion.rx"), "is not a displacement"),
    ):
        with pytest.raises(ModelError, match=words):
            mb.fmu(m, *arguments)
    with pytest.raises(ModelError, match="has no speed="):
        mb.fmu(m, tmp_path / "a.fmu", "a.force.x", "a.motion.x", speed=3)
    with pytest.raises(ModelError, match="parameters= names 'd'"):
        mb.fmu(m, tmp_path / "a.fmu", "a.force.x", "a.motion.x", parameters=["d"])
    with pytest.raises(ModelError, match=r"an FMU holds the result of mb\.state_space, not a ModalResult"):
        mb.modes(m).save(tmp_path / "a.fmu")
