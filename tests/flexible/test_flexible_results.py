"""Flexible bodies through every analysis: results, sensitivities, gradients, effects, files, wrong input."""

from __future__ import annotations

import pickle

import mbrs as mb
import numpy as np
import pytest
from flexible_models import MECHANISMS, cantilever, four_bar, hanging_by_the_tip, pendulum, rod
from mbrs.errors import ModelError
from mbrs.model.tables import tables
from mbrs.system.compiled import compiled


def differences(model, at, of, step):
    """Central difference of a function of the model by the number at an address."""
    ends = []
    for sign in (1.0, -1.0):
        other = model.copy()
        other.set({at: other.value(at) + sign * step})
        ends.append(of(other))
    return (ends[0] - ends[1]) / (2.0 * step)


@pytest.mark.parametrize("name", sorted(MECHANISMS))
def test_every_analysis_runs(name):
    model = MECHANISMS[name](damping=1e-3)
    body = next(b.name for b in model.bodies if b.kind == "flexible body")
    at = None if name == "tumbling" else mb.equilibrium(model)
    if at is not None:
        assert at.error < 1e-9
        modes = mb.modes(model, at=at)
        assert "rod.q1" in modes.coordinates or any(".q" in c for c in modes.coordinates)
        shares = modes.energy()
        assert body in shares.bodies and np.allclose(np.nansum(shares.kinetic_body, axis=0), 1.0)
        h = mb.frf(model, f"{body}.tip.force.z", f"{body}.tip.motion.z", frequency=[0.5, 2.0], at=at)
        dense = mb.linearize(model, at=at)
        row = dense.port_row(model[body].node("tip").motion("z"))[0]
        for i, f in enumerate((0.5, 2.0)):
            w = 2 * np.pi * f
            damping = sum(x for x in (dense.C, dense.G) if x is not None) if dense.C is not None else 0.0
            Z = dense.K + (0.0 if dense.N is None else dense.N) - w * w * dense.M + 1j * w * damping
            assert h.value[0, 0, i] == pytest.approx(row @ np.linalg.solve(Z, row), rel=1e-8)
        assert str(at) and str(modes)
    traj = mb.simulate(model, t=0.05)
    assert traj.status == "finished" and traj.modal(body).shape == (len(traj.t), 4)
    assert traj.node_positions(body)[:, 2] == pytest.approx(traj.position(f"{body}.tip"), abs=1e-12)
    assert str(traj) and traj.to_xarray() is not None


def test_reactions_balance_weight_and_load():
    model = cantilever()
    model.gravity = (0, 0, -9.81)
    model.force("pull", model["rod"].node("tip"), value=(0.0, 3.0, 0.0))
    eq = mb.equilibrium(model)
    wrench = eq.reactions["clamp"]
    weight = model["rod"].modal.mass * 9.81
    assert wrench[:3] == pytest.approx([0.0, -3.0, weight], abs=1e-9)
    q = eq.state.q[-4:]
    b = model["rod"].modal
    # about the clamp: the weight at the deformed centre of mass, the load at the deformed tip
    com = b.mass * b.com + b.S @ q + 0.5 * b.KG[:3] @ q @ q
    moment = -np.cross(com, (0, 0, -9.81)) - np.cross(eq.position("rod.tip"), (0, 3.0, 0))
    assert wrench[3:] == pytest.approx(moment, abs=1e-9)
    traj = mb.simulate(model, t=[0.0, 0.01], at=eq)
    assert traj.reaction("clamp")[-1] == pytest.approx(wrench, abs=1e-6)


def test_reactions_at_moving_nodes():
    model = hanging_by_the_tip()
    eq = mb.equilibrium(model)
    rod_weight, ball_weight = model["rod"].modal.mass * 9.81, 0.5 * 9.81
    assert eq.reactions["socket"][:3] == pytest.approx([0, 0, 5.0 - rod_weight - ball_weight], abs=1e-8)
    # along the slide its spring carries
    along = eq.rotation("ball") @ (1, 1, 0)
    assert np.cross(eq.reactions["slide"][:3] - (0, 0, -ball_weight), along) == pytest.approx(np.zeros(3), abs=1e-8)
    traj = mb.simulate(model, t=[0.0, 1e-3], at=eq)
    for name in ("socket", "slide"):
        assert traj.reaction(name)[-1] == pytest.approx(eq.reactions[name], abs=1e-6)
    loop = mb.equilibrium(four_bar())
    total = loop.reactions["A"][:3] + loop.reactions["D"][:3]
    weight = 9.81 * (0.4 + 0.6 + loop.model["coupler"].modal.mass)
    assert total == pytest.approx([0, 0, weight], abs=1e-8)


ADDRESSES = {
    "rod.K[0,0]": 1e-4,
    "rod.C[1,1]": 1e-6,
    "rod.at[0]": 1e-5,
    "guy.k": 1e-3,
    "guy.at_b[2]": 1e-5,
    "cardan.at[0]": 1e-5,
    "ball.mass": 1e-5,
    "push.value[1]": 1e-4,
    "hinge.axis": None,
}


def test_sensitivities_of_equilibrium_and_modes():
    model = pendulum(damping=1e-3, bending=(11.0, 17.0))
    names = [a for a, step in ADDRESSES.items() if step]
    eq = mb.equilibrium(model)
    modes = mb.modes(model, at=eq)
    found = mb.sensitivity(modes, names)
    moved = mb.sensitivity(eq, names)
    for i, name in enumerate(names):
        by_difference = differences(
            model, name, lambda m: mb.modes(m, at=mb.equilibrium(m)).eigenvalue, ADDRESSES[name]
        )
        scale = np.abs(modes.eigenvalue) / max(abs(model.value(name)), 1.0)
        assert np.max(np.abs(found.eigenvalue[:, i] - by_difference) / (np.abs(by_difference) + scale)) < 1e-5, name
        tip = differences(model, name, lambda m: mb.equilibrium(m).position("rod.tip"), ADDRESSES[name])
        assert moved.position[moved.bodies.index("rod.tip"), :, i] == pytest.approx(tip, abs=1e-6), name


def test_sensitivity_of_a_transfer_function_at_a_node():
    model = pendulum(damping=1e-3)

    def receptance(m):
        return mb.frf(
            m, "rod.mid.force.y", ["rod.tip.motion.y", m["P"].motion("z")], frequency=[1.3], at=mb.equilibrium(m)
        )

    names = ["rod.K[0,0]", "P.at[1]", "rod.orientation"]
    h = receptance(model)
    found = mb.sensitivity(h, names[:2]).value
    for i, step in enumerate((1e-4, 1e-5)):
        by_difference = differences(model, names[i], lambda m: receptance(m).value, step)
        assert found[..., i] == pytest.approx(by_difference, rel=1e-5, abs=1e-8 * np.max(np.abs(h.value)))


def value_of(model, psi, names):
    value, _ = mb.gradient(model, psi, names, t=0.05, step=5e-3, scheme="ali3p")
    return value


@pytest.mark.parametrize("method", ["direct", "adjoint"])
def test_gradients_of_a_motion(method):
    model = pendulum(damping=1e-3)
    names = ["rod.K[0,0]", "guy.k", "ball.mass", "cardan.at[0]"]
    psi = mb.Integral(lambda s: np.sum(s.point("P") ** 2) + 0.1 * np.sum(s.velocity("rod.tip") ** 2))
    _value, gradient = mb.gradient(model, psi, names, t=0.05, step=5e-3, scheme="ali3p", method=method)
    for i, (name, step) in enumerate(zip(names, (1e-3, 1e-3, 1e-4, 1e-5), strict=True)):
        by_difference = differences(model, name, lambda m: value_of(m, psi, names[:1]), step)
        assert gradient[i] == pytest.approx(by_difference, rel=2e-5, abs=1e-9), name


def test_modal_damping_takes_energy():
    model = cantilever(damping=5e-3)
    model.force("pull", model["rod"].node("tip"), value=(0.0, 0.0, mb.Ramp(0.0, 1.0)))
    traj = mb.simulate(model, t=np.linspace(0, 1.0, 201), rtol=1e-8)
    power = traj.energy.power["rod"]
    work = np.sum(0.5 * (power[1:] + power[:-1]) * np.diff(traj.t))
    load = traj.position("rod.tip")[-1, 2]
    assert load - traj.energy.kinetic[-1] == pytest.approx(work, rel=2e-3)
    assert traj.energy.total[-1] < load  # of what the load gave a part is gone
    assert "rod" in traj.energy.stored


def test_flexibility_is_an_effect():
    model = cantilever()
    model.gravity = (0, 0, -9.81)
    assert mb.effects(model)["flexibility"].on and "4 modal coordinates" in mb.effects(model)["flexibility"].why
    bent, straight = mb.equilibrium(model), mb.equilibrium(model, without=("flexibility",))
    assert bent.position("rod.tip")[2] < -0.1
    assert straight.bodies == ("rod",) and straight.linearization.n == 0
    assert "flexible bodies" in mb.linearize(model, at=bent).stats.counts
    assert "flexible bodies" not in straight.stats.counts
    free = mb.Model("swung")
    body = free.flexible_body("rod", rod(), angular_velocity=(5.0, 0, 0))
    free.revolute("h", free.ground, body.node("frame"), axis="x")
    results = {
        w: mb.linearize(free, without=w) for w in ((), ("gyroscopic",), ("centrifugal",), ("gyroscopic", "centrifugal"))
    }
    q = [c.startswith("rod.q") for c in results[()].coordinates]
    k = {w: r.K[np.ix_(q, q)] for w, r in results.items()}
    # turning about its own axis a straight rod loses Omega^2 M, and its two planes of bending are coupled
    modal = free["rod"].modal
    assert k[("centrifugal",)] == pytest.approx(modal.K)
    assert k[()] == pytest.approx(modal.K - 25.0 * modal.M)
    assert results[()].G is not None and results[("gyroscopic",)].G is None
    still = mb.simulate(free, t=0.1, without=("flexibility",))
    assert still.bodies == ("rod",) and still.q.shape[1] == 1


def test_a_rigid_model_pays_nothing():
    m = mb.Model("rigid")
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 1))
    m.revolute("h", m.ground, p, at=(0, 0, 0), axis="x", k=3.0)
    assert not any("flexible" in key or "node" in key for key in tables(m))
    core = compiled(m)
    assert core.n_q == core.n_bodies == 1
    assert "flexible bodies" not in mb.linearize(m).stats.counts


def test_models_are_saved_and_copied(tmp_path):
    for name, make in MECHANISMS.items():
        model = make(damping=1e-3)
        again = mb.Model.load(model.save(tmp_path / f"{name}.toml"))
        for other in (again, model.copy(), pickle.loads(pickle.dumps(model))):
            mine, theirs = tables(model), tables(other)
            assert mine.keys() == theirs.keys()
            for key in mine:
                assert np.array_equal(mine[key], theirs[key]), (name, key)
    eq = mb.equilibrium(hanging_by_the_tip())
    assert pickle.loads(pickle.dumps(eq)).poses["position"] == pytest.approx(eq.poses["position"])


def test_a_state_carries_modal_coordinates():
    model = pendulum()
    whole = mb.simulate(model, t=[0.0, 0.1, 0.2], rtol=1e-9)
    second = mb.simulate(model, t=[0.1, 0.2], at=whole.state(0.1), rtol=1e-9)
    assert second.modal("rod")[-1] == pytest.approx(whole.modal("rod")[-1], abs=1e-7)
    assert mb.linearize(model, at=whole.state(0.1)).n == 7


def test_modes_can_be_chosen():
    body, m = rod((2, 3, 4)), mb.Model("chosen")
    few = m.flexible_body("few", body, modes=[0, 3])
    assert few.n_modes == 2 and pytest.approx(body.K[np.ix_([0, 3], [0, 3])]) == few.modal.K
    assert pytest.approx(body.S[:, :2]) == m.flexible_body("first", body, modes=2).modal.S
    for wrong in (0, 7, [0, 0], [9], "all", [1.5, "a"]):
        with pytest.raises(ModelError, match="modes"):
            m.flexible_body("wrong", body, modes=wrong)


def test_wrong_input_names_the_object():
    m = mb.Model("wrong")
    body = m.flexible_body("rod", rod())
    p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0.25, 0, 0))
    for action, text in (
        (lambda: m.fixed("w", p, body, at=(0.25, 0, 0)), "rod.node"),
        (lambda: m.fixed("w", p, body), "at is missing"),
        (lambda: m.fixed("w", p, m.ground), "at is missing"),
        (lambda: m.fixed("w", p, "rod.tipp"), "tip"),
        (lambda: body.node("nose"), "nose"),
        (lambda: body.node(3), "3"),
        (lambda: m.force("f", body, value=(1, 0, 0)), "node"),
        (lambda: m.fixed("w", body.node("tip"), body.node("tip")), "itself"),
        (lambda: m.flexible_body("r2", {"mass": 1.0}), "ModalBody"),
        (lambda: m.flexible_body("rod", rod()), "taken"),
        (lambda: m.set({"rod.mass": 3.0}), "mass"),
        (lambda: mb.Model("other").fixed("w", "ground", body.node("tip")), "another model"),
    ):
        with pytest.raises(ModelError, match=text):
            action()
    assert [j.name for j in m.joints] == []


def test_nodes_find_themselves():
    m = mb.Model("found")
    body = m.flexible_body("rod", rod(), at=(1, 2, 3), orientation=mb.rotation("z", np.pi / 2))
    joint = m.fixed("clamp", m.ground, body, at=(1, 2, 3))
    assert joint.b_node == 0 and body.node("tip").at == pytest.approx([1, 3, 3])
    m.spring_damper("between", body.node("mid"), body.node("tip"), at=((1, 2.5, 3), (1, 3, 3)), k=1.0)
    assert mb.linearize(m).bodies == ("rod", "rod.mid", "rod.tip")


def test_a_loop_is_not_cut_inside_a_flexible_body():
    found = mb.System(four_bar())
    kinds = {body: kind for body, _, _, kind in found.tree}
    assert kinds["coupler.tip"] == "node" and len(found.loops) == 1


def test_ports_at_nodes_that_nothing_is_attached_to():
    model = pendulum(damping=1e-3)
    eq = mb.equilibrium(model)
    lin = mb.linearize(model, at=eq)
    assert "rod.frame" not in lin.bodies
    # the same node from its shape, and from its frame
    for direction in ("x", "z", "ry", "rz"):
        by_frame = lin.port_row(model["rod"].node("mid").motion(direction))
        other = mb.linearize(pendulum(damping=1e-3), at=eq)
        hidden = [b for b in other.bodies if b != "rod.mid"]
        object.__setattr__(other, "bodies", tuple(hidden[:2] + ["?"] + hidden[2:]))
        by_shape = other.port_row(model["rod"].node("mid").motion(direction))
        assert by_shape[0] == pytest.approx(by_frame[0], abs=1e-12)
        assert by_shape[2] == pytest.approx(by_frame[2], abs=1e-12)
    h = mb.frf(cantilever(), "rod.mid.force.z", "rod.mid.motion.z", frequency=[0.1, 0.2])
    assert np.all(np.isfinite(h.value))
    rigid = mb.frf(model, "rod.mid.force.y", model["P"].motion("y"), frequency=[0.1, 0.2], without=("flexibility",))
    assert np.all(np.isfinite(rigid.value))


def test_large_deflections_are_said():
    """Linear theory in the frame: its weight bends it by 0.54 m of 2 m; a stiffer beam says nothing."""
    import warnings

    def hanging(stiffness):
        m = mb.Model("wing", gravity=(0, 0, -9.81))
        beam = mb.flexible.beam(2.0, mass=1.0, EI_flap=stiffness, EI_edge=4 * stiffness, modes=2)
        m.fixed("clamp", m.ground, m.flexible_body("wing", beam).node("root"), at=(0, 0, 0))
        return m

    with pytest.warns(mb.MbrsWarning, match="'wing' deflects by 0.27"):
        mb.simulate(hanging(40.0), 0.3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mb.simulate(hanging(400.0), 0.3)


def test_loads_on_modal_coordinates_go_with_them():
    """Without flexibility a section load is its resultant, which goes on following its table; a modal force is nothing."""
    m = mb.Model("wing")
    beam = mb.flexible.beam(2.0, mass=1.0, EI_flap=400.0, EI_edge=1600.0, modes=3, inertia_flap=0.01, inertia_edge=0.01)
    wing = m.flexible_body("wing", beam)
    m.modal_force("push", wing, mode=1, value=mb.Sine(1.0, 2.0))
    m.section_load(
        wing, [0.0, 2.0], [np.zeros((2, 3)), np.tile([0.0, 0.0, 3.0], (2, 1))], times=[0.0, 1.0], kind="linear"
    )
    rigid = mb.simulate(m, [1.0], without=("flexibility",))
    # 6 N t on 2 kg: t^3 / 2 of the centre of mass, which is 1 m out
    assert rigid.point((1, 0, 0), of="wing")[-1] == pytest.approx([1.0, 0.0, 0.5], abs=1e-7)
    assert rigid.flexible == []
    assert "flexibility" in str(mb.effect_study(mb.simulate, m, t=0.1))
