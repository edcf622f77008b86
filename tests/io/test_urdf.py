"""URDF in and out: against Pinocchio and MuJoCo, round trips, and names for all that is left out."""

from __future__ import annotations

import warnings

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import DuplicateNameError, InertiaError, ModelError, NameNotFoundError, OmissionWarning
from mbrs.io._tree import FRICTION_RATE
from mbrs.io._urdf_writer import NO_LIMIT
from random_models import random_tree
from robot_models import mbrs_dynamics, random_urdf, tensor, text, urdf_link

pytest.importorskip("lxml")


def load(tmp_path, urdf, expect=None):
    path = tmp_path / "robot.urdf"
    path.write_text(urdf)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        m = mb.Model.load(path)
    omissions = [o for w in caught if issubclass(w.category, OmissionWarning) for o in w.message.omissions]
    return (m, omissions) if expect is None else m


def quiet(function, *args, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*args, **options)


@pytest.mark.parametrize("seed", range(6))
def test_mass_matrix_and_bias_are_those_of_pinocchio(tmp_path, seed):
    pin = pytest.importorskip("pinocchio", reason="pip install pin (380 MB)")
    rng = np.random.default_rng(seed)
    urdf = random_urdf(rng, n=7)
    m, _ = load(tmp_path, urdf)
    m.gravity = rng.normal(size=3) * (1, 2, 9)
    model = pin.buildModelFromXML(urdf)
    model.gravity.linear = np.array(m.gravity)
    data = model.createData()
    q, v = pin.neutral(model), rng.normal(size=model.nv)
    lin = quiet(mb.linearize, m)
    order = [model.joints[model.getJointId(c)].idx_v for c in lin.coordinates]
    M = np.triu(pin.crba(model, data, q))
    M = (M + np.triu(M, 1).T)[np.ix_(order, order)]
    assert np.abs(lin.M - M).max() < 1e-10 * np.abs(M).max()
    free = pin.aba(model, data, q, v, np.zeros(model.nv))[order]
    bias = pin.rnea(model, data, q, v, np.zeros(model.nv))[order]
    pin.forwardKinematics(model, data, q, v)
    rates = {}
    for body in m.bodies:
        twist = pin.getFrameVelocity(model, data, model.getFrameId(body.name), pin.LOCAL_WORLD_ALIGNED)
        rates[body.name] = (twist.linear, twist.angular)
    found = mbrs_dynamics(m, rates)
    assert np.abs(found - free).max() < 1e-10 * np.abs(free).max()
    assert np.abs(lin.M @ found + bias).max() < 1e-10 * np.abs(bias).max()


@pytest.mark.parametrize("seed", range(4))
def test_mass_matrix_and_bias_are_those_of_mujoco(tmp_path, seed):
    mujoco = pytest.importorskip("mujoco", reason="pip install mujoco (100 MB)")
    rng = np.random.default_rng(100 + seed)
    urdf = random_urdf(rng, n=6).replace("continuous", "revolute")
    urdf = urdf.replace(
        'name="random">', 'name="random"><mujoco><compiler fusestatic="false" balanceinertia="false"/></mujoco>'
    )
    m, omissions = load(tmp_path, urdf)
    m.gravity = rng.normal(size=3) * (1, 2, 9)
    assert [o.feature for o in omissions if o.object == "the file"] == ["<mujoco>"]
    model = mujoco.MjModel.from_xml_string(urdf)
    model.opt.gravity[:] = m.gravity
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    data.qvel[:] = rng.normal(size=model.nv)
    mujoco.mj_forward(model, data)
    lin = quiet(mb.linearize, m)
    order = [model.joint(c).dofadr[0] for c in lin.coordinates]
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    M = M[np.ix_(order, order)]
    assert np.abs(lin.M - M).max() < 1e-10 * np.abs(M).max()
    rates, twist = {}, np.zeros(6)
    for body in m.bodies:
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, model.body(body.name).id, twist, 0)
        rates[body.name] = (twist[3:].copy(), twist[:3].copy())
    bias = data.qfrc_bias[order]
    assert np.abs(lin.M @ mbrs_dynamics(m, rates) + bias).max() < 1e-10 * np.abs(bias).max()


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_of_several_coordinates_are_those_of_pinocchio(tmp_path, kind):
    """A base on a floating or planar joint, two links on it: the mass matrices are congruent by the axes of the velocities."""
    pin = pytest.importorskip("pinocchio", reason="pip install pin (380 MB)")
    rng = np.random.default_rng(3)
    urdf = (
        random_urdf(rng, n=2, kinds=("continuous",))
        .replace('"base"', '"hull"')
        .replace('<link name="hull"/>', urdf_link(rng, "hull"))
    )
    axis = '<axis xyz="0 0 1"/>'
    joint = (
        f'<link name="world"/><joint name="root" type="{kind}"><parent link="world"/><child link="hull"/>'
        f'<origin xyz="{text(rng.normal(size=3))}" rpy="{text(rng.normal(size=3))}"/>{axis if kind == "planar" else ""}</joint></robot>'
    )
    urdf = urdf.replace("</robot>", joint)
    m, _ = load(tmp_path, urdf)
    model = pin.buildModelFromXML(urdf)
    data = model.createData()
    M = np.triu(pin.crba(model, data, pin.neutral(model)))
    M = M + np.triu(M, 1).T
    lin = quiet(mb.linearize, m)
    n = 6 if kind == "floating" else 3
    names = {"floating": ("x", "y", "z", "rx", "ry", "rz"), "planar": ("x", "y", "rz")}[kind]
    order = [lin.coordinates.index(f"root.{c}") for c in names]
    order += [lin.coordinates.index(model.names[i]) for i in range(1, model.njoints) if model.names[i] != "root"]
    turn = np.eye(model.nv)
    if kind == "floating":  # joint axes of mbrs are the world's, those of Pinocchio the body's
        R = quiet(mb.System, m) and np.array(m["hull"].values("orientation"))
        w, u = R[0], R[1:]
        R = (
            (w * w - u @ u) * np.eye(3)
            + 2 * np.outer(u, u)
            + 2 * w * np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
        )
        turn[:3, :3] = turn[3:6, 3:6] = R
        found = turn.T @ lin.M[np.ix_(order, order)] @ turn
    else:
        found = lin.M[np.ix_(order, order)]
        # x and y of the plane are free to choose: compare what does not depend on it
        flat = lambda A: (np.linalg.eigvalsh(A), np.linalg.eigvalsh(A[:2, :2]), np.diag(A)[2:])  # noqa: E731
        for a, b in zip(flat(found), flat(M), strict=True):
            assert np.abs(a - b).max() < 1e-10 * np.abs(M).max()
        return
    assert n + 2 == model.nv and np.abs(found - M).max() < 1e-10 * np.abs(M).max()


@pytest.mark.parametrize("seed", range(5))
def test_round_trip_of_files_with_every_joint(tmp_path, seed):
    rng = np.random.default_rng(seed)
    kinds = ("revolute", "continuous", "prismatic", "planar", "floating", "fixed")
    m, _ = load(tmp_path, random_urdf(rng, n=8, kinds=kinds))
    m.gravity = (0.3, -2.0, -9.0)
    path = quiet(m.save, tmp_path / "again.urdf")
    again = quiet(mb.Model.load, path)
    again.gravity = m.gravity
    assert [j.type for j in again.joints] == [j.type for j in m.joints]
    assert {b.name for b in again.bodies} == {b.name for b in m.bodies}
    same_motion(m, again)


def same_motion(m, again):
    """Roots of the linearisation (in any order of coordinates) and the frames of bodies agree."""
    a, b = quiet(mb.linearize, m), quiet(mb.linearize, again)
    for name in ("M", "K"):
        one, two = getattr(a, name), getattr(b, name)
        if set(a.coordinates) == set(b.coordinates):
            order = [b.coordinates.index(c) for c in a.coordinates]
            assert np.abs(one - two[np.ix_(order, order)]).max() < 1e-10 * np.abs(one).max()
        else:
            assert np.allclose(np.linalg.eigvalsh(one), np.linalg.eigvalsh(two), rtol=0, atol=1e-10 * np.abs(one).max())


@pytest.mark.parametrize("seed", range(8))
def test_models_with_joints_that_urdf_lacks_move_as_before(tmp_path, seed):
    """Cylindrical, universal and spherical joints pass through massless links, reversed ones too."""
    rng = np.random.default_rng(seed)
    kinds = ("revolute", "prismatic", "cylindrical", "universal", "spherical", "fixed")
    m = random_tree(rng, n=5, kinds=kinds, forces=False)
    path = quiet(m.save, tmp_path / "tree.urdf")
    again = quiet(mb.Model.load, path)
    again.gravity = m.gravity
    assert {j.type for j in again.joints} == {j.type for j in m.joints}
    t = np.linspace(0.0, 0.2, 3)
    # energies do not depend on coordinates or frames: the motion is the same one
    a, b = quiet(mb.simulate, m, t=t, rtol=1e-11), quiet(mb.simulate, again, t=t, rtol=1e-11)
    assert np.abs(a.energy.kinetic - b.energy.kinetic).max() < 1e-8 * a.energy.kinetic.max()


def two_joints(rng, first, second, meet=True, axes=None):
    """ground - massless link - body."""
    u = rng.normal(size=3) if axes is None else axes[0]
    v = np.cross(u, rng.normal(size=3)) if axes is None else axes[1]
    shift = np.zeros(3) if meet else 0.1 * np.cross(u, v)
    return (
        f'<robot name="r"><link name="base"/><link name="cross"/>{urdf_link(rng, "tip")}'
        f'<joint name="a" type="{first}"><parent link="base"/><child link="cross"/><origin xyz="0.1 0.2 0"/><axis xyz="{text(u)}"/></joint>'
        f'<joint name="b" type="{second}"><parent link="cross"/><child link="tip"/><origin xyz="{text(shift)}"/><axis xyz="{text(v)}"/>'
        '<dynamics damping="0.25"/></joint></robot>'
    )


def test_a_massless_cross_makes_a_universal_joint(tmp_path):
    rng = np.random.default_rng(5)
    m, omissions = load(tmp_path, two_joints(rng, "continuous", "continuous"))
    assert [j.type for j in m.joints] == ["universal"] and [o.object for o in omissions] == ["link 'cross'"]
    assert m.joints[0].values("c")[:2] == [0.0, 0.25]
    u = rng.normal(size=3)
    m, _ = load(tmp_path, two_joints(rng, "prismatic", "continuous", axes=(u, -2.0 * u)))
    assert [j.type for j in m.joints] == ["cylindrical"] and m.joints[0].values("c")[:2] == [0.0, 0.25]


def test_joints_in_a_row_that_no_joint_replaces_are_refused(tmp_path):
    rng = np.random.default_rng(6)
    for urdf in (
        two_joints(rng, "continuous", "continuous", meet=False),
        two_joints(rng, "prismatic", "continuous"),
        two_joints(rng, "continuous", "continuous", axes=rng.normal(size=(2, 3))),
    ):
        with pytest.raises(ModelError, match=r"robot.urdf: line 1: link 'tip' has 2 joints in a row .*'a'.*'b'"):
            load(tmp_path, urdf)


def test_mimic_damping_friction_and_limits(tmp_path):
    rng = np.random.default_rng(7)
    urdf = random_urdf(rng, n=4, kinds=("revolute",))
    for i, inner in (
        (0, '<dynamics damping="0.7" friction="0.4"/>'),
        (2, '<mimic joint="joint1" multiplier="-1.75" offset="0.0"/>'),
    ):
        urdf = insert(urdf, f'name="joint{i}"', inner)
    m, omissions = load(tmp_path, urdf)
    (coupler,) = m.couplers
    assert m.value("joint0.c") == 0.7 and m.value(f"{coupler.name}.ratio") == -1.75
    found = {(o.object, o.feature) for o in omissions}
    assert {(f"joint 'joint{i}'", "limit") for i in range(4)} <= found
    assert ("joint 'joint0'", f"friction, now smooth: F tanh(rate / {FRICTION_RATE:g})") in found
    assert mb.System(m).dof == 3
    # the force at a rate w is F tanh(w / rate) + c w
    law = m.laws_of["joint", 0][0]
    assert law.name == "CoulombTanh" and law.values() == [0.4, FRICTION_RATE]
    again = quiet(mb.Model.load, quiet(m.save, tmp_path / "again.urdf"))
    assert again.value("joint0.c") == 0.7 and again.couplers[0].values() == coupler.values()
    assert again.laws_of["joint", 0][0].values() == [0.4, FRICTION_RATE]


def insert(urdf, before, inner):
    """An element into the joint whose attribute is named."""
    at = urdf.index(">", urdf.index(f"<joint {before}")) + 1
    return urdf[:at] + inner + urdf[at:]


def test_an_offset_of_a_mimic_moves_the_drawn_joint(tmp_path):
    rng = np.random.default_rng(8)
    urdf = insert(
        random_urdf(rng, n=2, kinds=("continuous",)),
        'name="joint1"',
        '<mimic joint="joint0" multiplier="2" offset="0.3"/>',
    )
    m, _ = load(tmp_path, urdf)
    traj = quiet(mb.simulate, m, t=[0.0, 0.1])
    assert np.allclose(traj.joint("joint1") - 2.0 * traj.joint("joint0"), 0.3, atol=1e-9)


def test_everything_left_out_is_named(tmp_path):
    rng = np.random.default_rng(9)
    extra = (
        '<transmission name="t0"><type>x</type></transmission><gazebo reference="link0"><a/></gazebo><material name="red"/>'
        '<sensor name="eye" update_rate="3"/>'
    )
    urdf = random_urdf(rng, n=2, extra=extra).replace(
        '<link name="link1">', '<link name="link1"><visual><geometry/></visual><collision name="c"/>'
    )
    _, omissions = load(
        tmp_path, insert(urdf, 'name="joint0"', '<safety_controller k_velocity="1"/><calibration rising="0"/>')
    )
    found = {str(o) for o in omissions}
    for wanted in (
        "<transmission> of transmission 't0'", "<gazebo> of the file", "<sensor> of sensor 'eye'",
        "picture of link 'link1'", "<collision> of link 'link1'", "<safety_controller> of joint 'joint0'",
        "<calibration> of joint 'joint0'",
    ):  # fmt: skip
        assert wanted in found, found


def test_what_urdf_cannot_hold_is_named(tmp_path):
    for build, what in (
        (mb.examples.four_bar, "URDF has no closed loops, and joint"),
        (mb.examples.rolling_disc, "rolling_disc joint"),
    ):
        with pytest.raises(ModelError, match=what):
            build().save(tmp_path / "m.urdf")
    assert not (tmp_path / "m.urdf").exists()
    m = mb.examples.cubic_hexapod()
    with pytest.warns(OmissionWarning, match=r"spring_damper: element 'leg0', .*; parameters") as caught:
        m.save(tmp_path / "m.urdf")
    omissions = [o for w in caught for o in w.message.omissions]
    assert {o.object for o in omissions if o.feature == "spring_damper"} == {f"element 'leg{i}'" for i in range(6)}


def test_a_prismatic_joint_without_limits_has_none_after_a_round_trip(tmp_path):
    rng = np.random.default_rng(10)
    m, omissions = load(tmp_path, random_urdf(rng, n=1, kinds=("prismatic",)))
    assert any(o.feature == "limit" for o in omissions)
    with warnings.catch_warnings():
        warnings.simplefilter("error", OmissionWarning)
        mb.Model.load(m.save(tmp_path / "again.urdf"))
    assert repr(NO_LIMIT) in (tmp_path / "again.urdf").read_text()


def test_names_that_links_and_joints_share(tmp_path):
    rng = np.random.default_rng(11)
    urdf = random_urdf(rng, n=2).replace("joint0", "link0").replace("link1", "a.b[0]")
    m, omissions = load(tmp_path, urdf)
    assert m["link0"].kind == "body" and m["link0 joint"].kind == "joint" and m["a_b_0_"].kind == "body"
    assert {o.object for o in omissions if "name" in o.feature} == {"joint 'link0'", "link 'a.b[0]'"}


def mutated(urdf, *changes):
    for old, new in changes:
        assert old in urdf
        urdf = urdf.replace(old, new, 1)
    return urdf


@pytest.mark.parametrize(
    "changes, error, message",
    [
        ([('type="revolute"', 'type="screw"')], ModelError, "has 'type' = 'screw'; known are fixed, revolute"),
        ([('<parent link="base"/>', "")], ModelError, "joint 'joint0' lacks its <parent"),
        ([('<parent link="base"/>', '<parent link="nobody"/>')], NameNotFoundError, "'nobody', which does not exist"),
        ([('<parent link="base"/>', '<parent link="link0"/>')], ModelError, "link 'link0' is in a circle"),
        ([('name="link1"', 'name="link0"')], DuplicateNameError, "link 'link0' has a name that another one has"),
        ([('<mass value="', '<mass value="-')], ModelError, "<mass> of link 'link0' must be positive"),
        ([('<mass value="', '<mass value="one')], ModelError, "needs 1 finite number in 'value'"),
        ([('<axis xyz="', '<axis xyz="1 ')], ModelError, "needs 3 finite numbers in 'xyz'"),
        ([('<origin xyz="', '<origin quat_xyzw="0 0 0 1" xyz="')], ModelError, "has the attribute 'quat_xyzw', which is not read"),
        ([("<inertial>", "<!--"), ("</inertial>", "-->")], InertiaError, "link 'link0' moves and has no mass"),
        ([("<robot", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"'), ("</robot>", '<xacro:arm/></robot>')], ModelError, "xacro"),
    ],
)  # fmt: skip
def test_mistakes_are_named_with_file_line_and_element(tmp_path, changes, error, message):
    rng = np.random.default_rng(12)
    urdf = random_urdf(rng, n=2, kinds=("revolute",)).replace('parent link="link0"', 'parent link="base"')
    with pytest.raises(error, match=r"^robot\.urdf: line 1: ") as caught:
        load(tmp_path, mutated(urdf, *changes))
    assert message in str(caught.value) and len(str(caught.value)) < 500


def test_an_inertia_that_no_body_has_names_the_link(tmp_path):
    urdf = (
        '<robot name="r"><link name="a"/>\n<link name="b"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="3"/></inertial></link>'
        '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>'
    )
    with pytest.raises(InertiaError, match=r"^robot\.urdf: line 2: link 'b': b\.inertia has principal moments"):
        load(tmp_path, urdf)


def test_a_root_with_mass_is_welded_to_ground(tmp_path):
    rng = np.random.default_rng(14)
    urdf = random_urdf(rng, n=2, kinds=("continuous",)).replace('<link name="base"/>', urdf_link(rng, "base"))
    m, _ = load(tmp_path, urdf)
    assert [j.type for j in m.joints] == ["fixed", "revolute", "revolute"] and mb.System(m).dof == 2
    again = quiet(mb.Model.load, quiet(m.save, tmp_path / "again.urdf"))
    m.gravity = again.gravity = (0.3, -2.0, -9.0)
    same_motion(m, again)


def test_the_mass_of_welded_links_moves_their_massless_carrier(tmp_path):
    """A joint on a link without mass that carries one by a fixed joint: lumps, and a marker where the inner one was."""
    rng = np.random.default_rng(13)
    i = tensor(rng, 2.0).tolist()
    p = rng.normal(size=3)
    urdf = (
        '<robot name="r"><link name="base"/><link name="carrier"/><link name="load"><inertial><mass value="2.0"/>'
        f'<inertia ixx="{i[0][0]}" ixy="{i[0][1]}" ixz="{i[0][2]}" iyy="{i[1][1]}" iyz="{i[1][2]}" izz="{i[2][2]}"/></inertial></link>'
        '<joint name="turn" type="continuous"><parent link="base"/><child link="carrier"/><axis xyz="0 1 0"/></joint>'
        f'<joint name="weld" type="fixed"><parent link="carrier"/><child link="load"/><origin xyz="{text(p)}"/></joint></robot>'
    )
    m, _ = load(tmp_path, urdf)
    assert [b.name for b in m.bodies] == ["carrier"] and {k.name for k in m.markers} == {"base", "load"}
    # a mass times a square: three factors with noise
    rel = 1e-13 + 3 * jitter.level()
    assert quiet(mb.linearize, m).M[0, 0] == pytest.approx(i[1][1] + 2.0 * (p[0] ** 2 + p[2] ** 2), rel=rel)
