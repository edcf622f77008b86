"""MJCF: against MuJoCo on random trees and loops, its defaults, units and included files, and names for all that is left out."""

from __future__ import annotations

import warnings

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import DuplicateNameError, InertiaError, ModelError, NameNotFoundError, OmissionWarning
from robot_models import geoms, inertia_element, mbrs_dynamics, orientation, random_mjcf, text
from scipy.spatial.transform import Rotation

pytest.importorskip("lxml")


def load(tmp_path, mjcf):
    path = tmp_path / "robot.xml"
    path.write_text(mjcf)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        m = mb.Model.load(path)
    return m, [o for w in caught if issubclass(w.category, OmissionWarning) for o in w.message.omissions]


def quiet(function, *args, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*args, **options)


def mujoco_of(mjcf):
    mujoco = pytest.importorskip("mujoco", reason="pip install mujoco (100 MB)")
    model = mujoco.MjModel.from_xml_string(mjcf)
    return mujoco, model, mujoco.MjData(model)


def agree(mjcf, m, seed=0, moving=True):
    """Mass matrix, and the sum of all forces at random rates: bias, springs and dampers. Returns the largest relative differences."""
    mujoco, model, data = mujoco_of(mjcf)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    if moving:
        data.qvel[:] = np.random.default_rng(seed).normal(size=model.nv)
    mujoco.mj_forward(model, data)
    lin = quiet(mb.linearize, m)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    order = [model.joint(c).dofadr[0] for c in lin.coordinates]
    M = M[np.ix_(order, order)]
    rates, twist = {}, np.zeros(6)
    for body in m.bodies:
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, model.body(body.name).id, twist, 0)
        rates[body.name] = (twist[3:].copy(), twist[:3].copy())
    force = (data.qfrc_passive - data.qfrc_bias)[order]
    found = lin.M @ mbrs_dynamics(m, rates)
    return np.abs(lin.M - M).max() / np.abs(M).max(), np.abs(found - force).max() / np.abs(force).max()


@pytest.mark.parametrize("seed", range(10))
def test_mass_matrix_bias_springs_and_dampers_are_those_of_mujoco(tmp_path, seed):
    mjcf = random_mjcf(np.random.default_rng(seed), n=6)
    m, _ = load(tmp_path, mjcf)
    assert max(agree(mjcf, m, seed)) < 1e-10


@pytest.mark.parametrize("sequence", ["xyz", "zyx", "XYZ", "zXy", "ZXZ"])
def test_radians_and_orders_of_euler_angles(tmp_path, sequence):
    rng = np.random.default_rng(len(sequence) + ord(sequence[1]))
    compiler = f'<compiler angle="radian" eulerseq="{sequence}"/>'
    mjcf = random_mjcf(rng, n=5, compiler=compiler)
    m, _ = load(tmp_path, mjcf)
    assert max(agree(mjcf, m)) < 1e-10


@pytest.mark.parametrize("seed", range(40))
def test_inertias_are_those_of_mujoco(tmp_path, seed):
    """Every solid, placed in every way, and several in one body."""
    rng = np.random.default_rng(seed)
    part = geoms(rng) if seed % 4 else inertia_element(rng)
    mjcf = f'<mujoco><worldbody><body name="b"><joint name="j"/>{part}</body></worldbody></mujoco>'
    m, _ = load(tmp_path, mjcf)
    mujoco, model, _ = mujoco_of(mjcf)
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, model.body_iquat[1])
    R = R.reshape(3, 3)
    tensor = R @ np.diag(model.body_inertia[1]) @ R.T
    xx, yy, zz, xy, xz, yz = m["b"].values("inertia")
    found = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    assert m.value("b.mass") == pytest.approx(model.body_mass[1], rel=1e-12)
    assert np.abs(found - tensor).max() < 1e-11 * np.abs(tensor).max()
    assert np.abs(model.body_ipos[1] - m["b"].values("com")).max() < 1e-13


def single(rng, joints, extra=""):
    return (
        f'<mujoco><compiler angle="radian"/><option gravity="0.3 -0.7 -9"/><worldbody><body name="b" pos="{text(rng.normal(size=3))}" '
        f"{orientation(rng)}>{joints}{inertia_element(rng)}</body></worldbody>{extra}</mujoco>"
    )


def turned_axes(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q.T


@pytest.mark.parametrize("kind", ["planar", "cylindrical", "universal"])
def test_joints_in_a_row_become_one(tmp_path, kind):
    """Slides and hinges of one body: the same matrix and forces by coordinate, signs included."""
    rng = np.random.default_rng(3)
    for _ in range(4):
        a, b, c = turned_axes(rng)
        at = text(rng.normal(size=3))
        tail = [f'stiffness="{9 * rng.random()}" damping="{rng.random()}" springref="{rng.normal()}"' for _ in range(3)]
        rows = {
            "planar": [("slide", a), ("slide", b), ("hinge", float(rng.choice([-1, 1])) * c)],
            "cylindrical": [("slide", -a), ("hinge", a)],
            "universal": [("hinge", a), ("hinge", b)],
        }[kind]
        joints = "".join(
            f'<joint name="j{i}" type="{t}" axis="{text(axis)}" pos="{at}" {tail[i]}/>'
            for i, (t, axis) in enumerate(rows)
        )
        mjcf = single(rng, joints)
        m, omissions = load(tmp_path, mjcf)
        assert [j.type for j in m.joints] == [kind] and not [o for o in omissions if "hinges" in o.feature]
        mujoco, model, data = mujoco_of(mjcf)
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        # order of mbrs: planar x y rz, cylindrical z rz, universal rz rx; the signs of coordinates cancel in what is compared
        lin = quiet(mb.linearize, m)
        assert np.abs(np.abs(lin.M) - np.abs(M)).max() < 1e-10 * np.abs(M).max()
        found = np.abs(lin.M @ mbrs_dynamics(m, {}))
        force = np.abs(data.qfrc_passive - data.qfrc_bias)
        assert np.abs(found - force).max() < 1e-10 * force.max()


@pytest.mark.parametrize("free", [False, True])
def test_three_hinges_and_three_slides(tmp_path, free):
    """One spherical or free joint moves as they do: no coordinates in common, so energies are compared."""
    rng = np.random.default_rng(4)
    a, b = turned_axes(rng), turned_axes(rng)
    joints = "".join(f'<joint name="s{i}" type="slide" axis="{text(b[i])}"/>' for i in range(3)) if free else ""
    joints += "".join(f'<joint name="h{i}" type="hinge" axis="{text(a[i])}" pos="0.1 0.2 0.3"/>' for i in range(3))
    mjcf = single(rng, joints)
    m, omissions = load(tmp_path, mjcf)
    assert [j.type for j in m.joints] == ["free" if free else "spherical"]
    assert len([o for o in omissions if "three" in o.feature]) == 1
    mujoco, model, data = mujoco_of(mjcf)
    model.opt.timestep, model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    steps = 2000
    for _ in range(steps):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    traj = quiet(mb.simulate, m, t=[0.0, steps * 1e-4], rtol=1e-11)
    assert np.abs(traj.position("b")[-1] - data.xpos[1]).max() < 1e-8


@pytest.mark.parametrize("kind", ["ball", "free"])
def test_balls_and_free_bodies(tmp_path, kind):
    """Springs of balls; their dampers act on another rate, which is said."""
    rng = np.random.default_rng(5)
    given = (
        '<freejoint name="j"/>' if kind == "free" else '<joint name="j" type="ball" pos="0.1 -0.2 0.3" stiffness="4"/>'
    )
    mjcf = single(rng, given)
    m, omissions = load(tmp_path, mjcf.replace("stiffness", 'damping="0.3" stiffness'))
    assert kind == "free" or m["j"].values("c")[:3] == [0.3] * 3
    assert (kind == "ball") == any("rate of the rotation vector" in o.feature for o in omissions)
    m, _ = load(tmp_path, mjcf)
    mujoco, model, data = mujoco_of(mjcf)
    model.opt.timestep, model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    for _ in range(2000):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    traj = quiet(mb.simulate, m, t=[0.0, 0.2], rtol=1e-11)
    assert np.abs(traj.position("b")[-1] - data.xpos[1]).max() < 1e-8
    q = data.xquat[1]
    assert min(np.abs(traj.orientation("b")[-1] - q).max(), np.abs(traj.orientation("b")[-1] + q).max()) < 1e-8


def test_armatures_are_rotors(tmp_path):
    """a / 2 q'^2: the same accelerations as MuJoCo's, without a spring or weight of their own."""
    rng = np.random.default_rng(6)
    mjcf = random_mjcf(rng, n=4, forces=False)
    for i, a in enumerate((0.31, 0.0, 1.7, 0.42)):
        mjcf = mjcf.replace(f'name="joint{i}"', f'name="joint{i}" armature="{a}"')
    m, omissions = load(tmp_path, mjcf)
    assert {o.object for o in omissions if "armature" in o.feature} == {f"joint 'joint{i}'" for i in (0, 2, 3)}
    mujoco, model, data = mujoco_of(mjcf)
    mujoco.mj_forward(model, data)
    traj = quiet(mb.simulate, m, t=[0.0, 1e-3], method="explicit", step=1e-4)
    # x = a t^2 / 2 over a short time
    for i in range(4):
        acceleration = data.qacc[model.joint(f"joint{i}").dofadr[0]]
        assert 2e6 * traj.joint(f"joint{i}")[-1] == pytest.approx(
            acceleration, rel=2e-2, abs=2e-2 * np.abs(data.qacc).max()
        )
    assert mb.System(m).dof == 4
    M = np.zeros((4, 4))
    mujoco.mj_fullM(model, data, M)
    assert np.allclose(np.linalg.eigvalsh(quiet(mb.linearize, m).M), np.linalg.eigvalsh(M), rtol=1e-10)


def four_bar(equality, tail="", body=""):
    """A planar chain of three bars whose end is held by an equality."""
    inner = ""
    for i, (x, z) in reversed(list(enumerate([(0.0, 0.0), (0.3, 0.4), (0.7, 0.1)]))):
        inner = (
            f'<body name="bar{i}" pos="{x} 0 {z}"><joint name="j{i}" axis="0 1 0" damping="0.01"/>'
            f'<geom type="capsule" fromto="0 0 0 0.3 0 0.1" size="0.02"/>{inner}{body if i == 2 else ""}</body>'
        )
    return f'<mujoco model="bars"><worldbody>{inner}</worldbody><equality>{equality}</equality>{tail}</mujoco>'


def test_connect_closes_a_loop(tmp_path):
    mjcf = four_bar('<connect name="pin" body1="bar2" anchor="0.25 0 0.05" solref="0.01 1"/>')
    m, omissions = load(tmp_path, mjcf)
    pin = m["pin"]
    assert pin.type == "spherical" and mb.System(m).dof == 1
    assert ("equality 'pin'", "softness, now exact") in {(o.object, o.feature) for o in omissions}
    # drawn at the anchor of bar2, whose frame is not turned: the sum of the positions
    assert np.allclose(pin.values("at_a"), [1.0 + 0.25, 0.0, 0.5 + 0.05], atol=1e-15)
    # MuJoCo's acceleration with its constraint stiff
    _, model, data = mujoco_of(mjcf.replace('solref="0.01 1"', 'solref="0.0005 1" solimp="0.9999 0.9999 0.001"'))
    model.opt.timestep, model.opt.iterations = 1e-5, 200
    mujoco = pytest.importorskip("mujoco")
    mujoco.mj_forward(model, data)
    traj = quiet(mb.simulate, m, t=[0.0, 1e-4], method="explicit", step=1e-5)
    joints = [traj.joint(f"j{i}")[-1] * 2e8 for i in range(3)]
    assert np.allclose(joints, data.qacc, rtol=2e-2)


@pytest.mark.parametrize("digits", [5, 6, 7, 9, 12])
def test_loops_move_however_many_digits_draw_them(tmp_path, digits):
    """A planar four-bar in a leaning plane, each number cut: the closing point is a ball, so that its plane is held twice."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))

        def cut(v):
            return " ".join(f"{x:.{digits}f}" for x in v)

        # bodies with frames of their own, so that each axis is cut in another way
        frames = Rotation.random(3, random_state=seed).as_matrix()
        corners = [turn @ p for p in ([0.0, 0.0, 0.0], [0.31, 0.43, 0.0], [1.03, 0.54, 0.0])]
        inner = ""
        for i in reversed(range(3)):
            outer = frames[i - 1] if i else np.eye(3)
            place = outer.T @ (corners[i] - (corners[i - 1] if i else 0.0))
            quat = np.roll(Rotation.from_matrix(outer.T @ frames[i]).as_quat(), 1)
            inner = (
                f'<body name="bar{i}" pos="{cut(place)}" quat="{cut(quat)}"><joint name="j{i}" axis="{cut(frames[i].T @ turn[:, 2])}"/>'
                f'<geom type="sphere" pos="0.1 0.2 0" size="0.05"/>{inner}</body>'
            )
        anchor = cut(frames[2].T @ turn @ (0.25, 0.05, 0.0))
        close = f'<equality><connect body1="bar2" anchor="{anchor}"/></equality>'
        m, _ = load(tmp_path, f"<mujoco><worldbody>{inner}</worldbody>{close}</mujoco>")
        assert m.tolerance <= max(1e-7, 3.1 * 10.0**-digits)
        assert quiet(mb.System, m).dof == 1


def test_digits_that_stand_for_themselves_leave_the_tolerance(tmp_path):
    m, _ = load(tmp_path, four_bar('<connect body1="bar2" anchor="0.25 0 0.05"/>'))
    assert m.tolerance == 1e-7
    coarse = four_bar('<connect body1="bar2" anchor="0.25 0 0.05"/>').replace('axis="0 1 0"', 'axis="0 12345 0"')
    assert load(tmp_path, coarse)[0].tolerance < 1e-3
    m, _ = load(tmp_path, four_bar('<connect body1="bar2" anchor="10234.5 0 0.05"/>'))
    assert m.tolerance == 1e-3


def test_sites_close_a_loop_as_well(tmp_path):
    site = '<site name="end" pos="0.25 0 0.05"/>'
    mjcf = four_bar('<connect site1="end" site2="post"/>', body=site).replace(
        "<worldbody>", '<worldbody><site name="post" pos="1.25 0 0.55"/>'
    )
    m, _ = load(tmp_path, mjcf)
    assert m["connect 1"].type == "spherical" and mb.System(m).dof == 1 and m["post"].kind == "marker"


def test_welds_hold_bodies_as_drawn(tmp_path):
    m, _ = load(tmp_path, four_bar('<weld body1="bar2" body2="bar0"/>'))
    assert m["weld 1"].type == "fixed" and mb.System(m).dof == 1
    m, _ = load(tmp_path, four_bar('<weld body1="bar2" relpose="-1 0 -0.5 1 0 0 0"/>'))
    assert m["weld 1"].type == "fixed" and mb.System(m).dof == 0
    with pytest.raises(ModelError, match="holds its bodies away from where they are drawn"):
        load(tmp_path, four_bar('<weld body1="bar2" relpose="-1 0 -0.4 1 0 0 0"/>'))


def test_joint_equalities_are_couplers_and_drives(tmp_path):
    m, _ = load(
        tmp_path, four_bar('<joint name="gear" joint1="j1" joint2="j0" polycoef="0 -2.5 0 0 0"/><joint joint1="j2"/>')
    )
    assert (
        m["gear"].kind == "coupler"
        and m.value("gear.ratio") == -2.5
        and m["joint 2"].kind == "drive"
        and mb.System(m).dof == 1
    )
    traj = quiet(mb.simulate, m, t=[0.0, 0.3], rtol=1e-9)
    assert (
        traj.joint("j1")[-1] == pytest.approx(-2.5 * traj.joint("j0")[-1], abs=1e-10)
        and abs(traj.joint("j2")[-1]) < 1e-12
    )
    with pytest.raises(ModelError, match="couples its joints by a curve"):
        load(tmp_path, four_bar('<joint joint1="j1" joint2="j0" polycoef="0 1 0.1 0 0"/>'))


def test_couplers_keep_the_signs_of_joints_in_a_row(tmp_path):
    """A slide against the hinge that it shares a cylindrical joint with follows a hinge of another body, along the file's own axis."""
    rng = np.random.default_rng(12)
    a = rng.normal(size=3)
    a /= np.linalg.norm(a)
    b = f'<body name="b"><joint name="s" type="slide" axis="{text(-a)}"/><joint name="h" axis="{text(a)}"/>{geoms(rng)}</body>'
    c = f'<body name="c" pos="1 2 3"><joint name="j" axis="{text(rng.normal(size=3))}"/>{geoms(rng)}</body>'
    gear = '<equality><joint joint1="s" joint2="j" polycoef="0 0.7 0 0 0"/></equality>'
    m, _ = load(tmp_path, f"<mujoco><worldbody>{b}{c}</worldbody>{gear}</mujoco>")
    traj = quiet(mb.simulate, m, t=[0.0, 0.2], rtol=1e-9)
    # the frame of b lies on the axis, so that only the slide moves it
    along = (traj.position("b")[-1] - traj.position("b")[0]) @ -a
    assert abs(along) > 1e-4 and along == pytest.approx(0.7 * traj.joint("j")[-1], rel=1e-8)


def test_a_tendon_between_two_sites_is_a_spring(tmp_path):
    site = '<site name="end" pos="0.25 0 0.05"/>'
    ends = '<site site="end"/><site site="post"/>'
    tendon = f'<tendon><spatial name="rope" stiffness="70" damping="3" springlength="0.9">{ends}</spatial></tendon>'
    mjcf = four_bar("", tail=tendon, body=site).replace(
        "<worldbody>", '<worldbody><site name="post" pos="1.4 0.2 0.9"/>'
    )
    m, _ = load(tmp_path, mjcf)
    assert m["rope"].type == "spring_damper" and (m.value("rope.k"), m.value("rope.c"), m.value("rope.length")) == (
        70.0,
        3.0,
        0.9,
    )
    assert max(agree(mjcf, m)) < 1e-10


def test_defaults_and_their_classes(tmp_path):
    """Nested classes, childclass, and what an element says itself; MuJoCo sees the same numbers."""
    mjcf = """<mujoco><compiler angle="radian"/>
    <default><joint damping="0.5" axis="0.3 0.4 0.5"/><geom size="0.1" type="sphere" density="700"/>
      <default class="stiff"><joint stiffness="30"/><default class="soft"><joint stiffness="3"/><geom size="0.2"/></default></default>
    </default>
    <worldbody><body name="a" pos="1 2 3" childclass="stiff"><joint name="ja"/><geom pos="0.1 0 0.3"/>
      <body name="b" pos="0.5 0.2 0.1"><joint name="jb" class="soft" springref="0.4"/><geom class="soft" pos="0 0.3 0.1"/>
        <body name="c" pos="0.1 0.7 0.1" childclass="main"><joint name="jc" damping="2"/><geom pos="0.2 0.3 0.1"/></body></body></body>
    </worldbody></mujoco>"""
    m, omissions = load(tmp_path, mjcf)
    assert [m.value(f"{j}.c") for j in ("ja", "jb", "jc")] == [0.5, 0.5, 2.0]
    assert m.value("ja.k") == 30.0 and m.value("jb.k") == 3.0 and not m["jc"].has("k")
    assert max(agree(mjcf, m)) < 1e-10
    assert {o.feature for o in omissions} == {"contact of geoms"}


def test_frames_shift_what_they_hold(tmp_path):
    rng = np.random.default_rng(8)
    frame = f'<frame pos="{text(rng.normal(size=3))}" euler="20 -30 50">'
    mjcf = (
        random_mjcf(rng, n=3)
        .replace("<worldbody>", f"<worldbody>{frame}")
        .replace("</worldbody>", "</frame></worldbody>")
    )
    m, _ = load(tmp_path, mjcf)
    assert max(agree(mjcf, m)) < 1e-10
    solids = f"<frame {orientation(rng)}>{frame}{geoms(rng)}</frame></frame>"
    mjcf = f'<mujoco><worldbody><body name="b"><joint name="j" axis="1 2 3"/>{solids}</body></worldbody></mujoco>'
    m, _ = load(tmp_path, mjcf)
    assert max(agree(mjcf, m)) < 1e-10


def test_included_files_come_from_the_folder_of_the_model_only(tmp_path):
    rng = np.random.default_rng(9)
    whole = random_mjcf(rng, n=3)
    start, end = whole.index("<worldbody>"), whole.index("</worldbody>") + len("</worldbody>")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "bodies.xml").write_text(f"<mujocoinclude>{whole[start:end]}</mujocoinclude>")
    m, _ = load(tmp_path, whole[:start] + '<include file="parts/bodies.xml"/>' + whole[end:])
    assert max(agree(whole, m)) < 1e-10
    (tmp_path.parent / "outside.xml").write_text("<mujocoinclude/>")
    for name in ("../outside.xml", str(tmp_path.parent / "outside.xml"), "/etc/passwd", "parts/../../outside.xml"):
        with pytest.raises(ModelError, match="outside the folder of the model"):
            load(tmp_path, f'<mujoco><include file="{name}"/></mujoco>')
    (tmp_path / "link.xml").symlink_to(tmp_path.parent / "outside.xml")
    with pytest.raises(ModelError, match="outside the folder of the model"):
        load(tmp_path, '<mujoco><include file="link.xml"/></mujoco>')
    (tmp_path / "again.xml").write_text('<mujocoinclude><include file="again.xml"/></mujocoinclude>')
    for text_ in ('<mujoco><include file="robot.xml"/></mujoco>', '<mujoco><include file="again.xml"/></mujoco>'):
        with pytest.raises(ModelError, match=r"includes '.*' again"):
            load(tmp_path, text_)
    with pytest.raises(ModelError, match=r"does not exist"):
        load(tmp_path, '<mujoco><include file="absent.xml"/></mujoco>')


def test_everything_left_out_is_named(tmp_path):
    rng = np.random.default_rng(10)
    extra = """<actuator><motor name="m0" joint="joint0"/><position name="m1" joint="joint1"/></actuator>
    <sensor><gyro name="s0" site="site0"/></sensor><contact><exclude name="e" body1="body0" body2="body1"/></contact>
    <asset><mesh name="hand" file="hand.stl"/></asset><visual><map znear="0.1"/></visual><keyframe><key name="k0" qpos="0 0"/></keyframe>
    <tendon><fixed name="f0"><joint joint="joint0" coef="1"/></fixed></tendon><equality><tendon name="q0" tendon1="f0"/></equality>"""
    mjcf = random_mjcf(rng, n=2, extra=extra).replace(
        'name="joint0"', 'name="joint0" range="-1 1" frictionloss="0.3" solreflimit="0.02 1"'
    )
    mjcf = mjcf.replace('<body name="body0"', '<body name="body0" gravcomp="0.5"').replace(
        "<option ", '<option timestep="0.01" '
    )
    _, omissions = load(tmp_path, mjcf)
    found = {str(o) for o in omissions}
    for wanted in (
        "<motor> of motor 'm0'", "<position> of position 'm1'", "<gyro> of gyro 's0'", "<exclude> of exclude 'e'", "<mesh> of mesh 'hand'",
        "<visual> of the file", "<key> of key 'k0'", "<fixed> of fixed 'f0'", "<tendon> of tendon 'q0'", "limit of joint 'joint0'",
        "gravcomp= of body 'body0'", "<option timestep=> of the file", "solreflimit= of joint 'joint0'",
        "friction, now smooth: F tanh(rate / 0.001) of joint 'joint0'",
    ):  # fmt: skip
        assert wanted in found, (wanted, found)


BODY = '<body name="b"><joint name="j"/><geom size="0.1"/></body>'
CAPSULE = BODY.replace("<geom", '<geom type="capsule"').replace("0.1", "1e-200 1e-200")
MESH, CLASS = BODY.replace("<geom", '<geom type="mesh"'), BODY.replace("<joint", '<joint class="c"')


@pytest.mark.parametrize(
    "inner, error, message",
    [
        ('<worldbody><body name="b"><joint name="j"/></body></worldbody>', InertiaError, "body 'b' moves and has no mass"),
        ('<worldbody><body><joint axis="0 0 0"/></body></worldbody>', ModelError, "has the axis zero"),
        ('<worldbody><body><joint type="screw"/></body></worldbody>', ModelError, "known are hinge, slide, ball, free"),
        (f"<worldbody>{BODY}{BODY}</worldbody>", DuplicateNameError, "body 'b' has a name that another one has"),
        (f'<worldbody>{BODY.replace("0.1", "-0.1")}</worldbody>', ModelError, "needs 1 positive number in 'size'"),
        (f'<worldbody>{BODY.replace("0.1", "1e-200")}</worldbody>', ModelError, "has a size whose volume is not a number"),
        (f"<worldbody>{CAPSULE}</worldbody>", ModelError, "has a size whose volume is not a number"),
        (f'<worldbody>{CAPSULE.replace("e-200", "e200")}</worldbody>', ModelError, "has a size whose volume is not a number"),
        (f'<worldbody>{MESH}</worldbody>', ModelError, "is a mesh, whose mass is not computed"),
        (f'<worldbody>{CLASS}</worldbody>', NameNotFoundError, "class 'c', which no <default>"),
        ('<worldbody><composite type="cable"/></worldbody>', ModelError, "makes parts by rules that are not read"),
        ('<worldbody><body quat="0 0 0 0"/></worldbody>', ModelError, "has no direction in 'quat'"),
        ('<worldbody><body quat="1 0 0 0" euler="1 0 0"/></worldbody>', ModelError, "several orientations: quat, euler"),
        ('<compiler settotalmass="3"/>', ModelError, "changes masses by 'settotalmass'"),
        ('<compiler eulerseq="xyw"/>', ModelError, "eulerseq"),
        (f'<worldbody>{BODY}</worldbody><equality><connect body1="c" anchor="0 0 0"/></equality>', NameNotFoundError, "the body 'c'"),
        (f'<worldbody>{BODY}</worldbody><equality><joint joint1="c"/></equality>', NameNotFoundError, "the joint 'c'"),
        (f'<worldbody>{BODY}</worldbody><equality><connect body1="b" body2="b" anchor="0 0 0"/></equality>', ModelError, "to itself"),
    ],
)  # fmt: skip
def test_mistakes_are_named_with_file_line_and_element(tmp_path, inner, error, message):
    with pytest.raises(error, match=r"^robot\.xml: line 2: ") as caught:
        load(tmp_path, f"<mujoco>\n{inner}</mujoco>")
    assert message in str(caught.value) and len(str(caught.value)) < 500
