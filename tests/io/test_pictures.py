"""Pictures of robots: visuals of URDF and geoms of MJCF become shapes, where the file draws them; what cannot be read is named."""

from __future__ import annotations

import warnings

import mbrs as mb
import numpy as np
import pytest
from mbrs.model.tables import tables

pytest.importorskip("lxml")
ARM = """<robot name="arm">
  <material name="steel"><color rgba="0.2 0.4 0.6 1"/></material>
  <link name="base"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="3"/>
    <inertia ixx="0.05" iyy="0.05" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual name="tube"><origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.7"/><geometry><cylinder radius="0.05" length="0.4"/></geometry>
      <material name="steel"/></visual>
    <visual><geometry><mesh filename="package://arm/meshes/tip.stl" scale="0.5 0.5 0.5"/></geometry></visual>
    <visual><geometry><mesh filename="package://arm/../secret.stl"/></geometry></visual>
    <visual><geometry><mesh filename="http://somewhere/a.stl"/></geometry></visual></link>
  <link name="tool"><visual><origin xyz="0 0 0.1"/><geometry><sphere radius="0.07"/></geometry>
      <material name=""><color rgba="1 0 0 1"/></material></visual></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><origin xyz="0.3 0.1 0.5" rpy="0.4 0.1 -0.9"/>
    <axis xyz="0.2 1 0.3"/></joint>
  <joint name="flange" type="fixed"><parent link="upper"/><child link="tool"/><origin xyz="0.2 0 0.4" rpy="0.5 0.6 0.7"/></joint>
</robot>"""


def load(path):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        model = mb.Model.load(path)
    return model, [(o.object, o.feature) for w in told for o in getattr(w.message, "omissions", ())]


def rpy(r, p, y):
    def about(i, a):
        return np.array(_matrix(mb.rotation("xyz"[i], a)))

    return about(2, y) @ about(1, p) @ about(0, r)


def _matrix(q):
    w, x, y, z = (float(v) for v in q)
    s = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * (w * s + s @ s)


def arm(tmp_path):
    (tmp_path / "arm" / "urdf").mkdir(parents=True)
    (tmp_path / "arm" / "meshes").mkdir()
    (tmp_path / "arm" / "meshes" / "tip.stl").write_text("solid none\nendsolid none\n")
    (tmp_path / "secret.stl").write_text("solid none\nendsolid none\n")
    path = tmp_path / "arm" / "urdf" / "arm.urdf"
    path.write_text(ARM)
    return path


def test_visuals_of_urdf_are_where_the_file_draws_them(tmp_path):
    m, omissions = load(arm(tmp_path))
    upper = rpy(0.4, 0.1, -0.9)
    origin = np.array([0.3, 0.1, 0.5])
    drawn = tables(m)["body_shape"]["upper"]
    tube, mesh, ball = drawn
    assert (tube["type"], tube["radius"], tube["length"], tube["colour"]) == ("cylinder", 0.05, 0.4, "#336699")
    assert mesh["type"] == "mesh" and mesh["file"].endswith("tip.stl") and mesh["scale"] == 0.5
    assert ball["type"] == "sphere" and ball["colour"] == "#ff0000"  # of the tool, which is welded to the arm
    m.bodies[0].shape = [shape for shape in m.bodies[0].shape if shape["type"] != "mesh"]
    seen = m.scene.bodies[0].solids
    centre = origin + upper @ [0.1, 0.2, 0.3]
    assert seen[0].vertices.mean(axis=0) == pytest.approx(centre)
    along = upper @ rpy(0.3, -0.2, 0.7) @ [0.0, 0.0, 1.0]
    assert np.abs((seen[0].vertices - centre) @ along) == pytest.approx(np.full(40, 0.2))
    assert seen[1].vertices.mean(axis=0) == pytest.approx(
        origin + upper @ (np.array([0.2, 0, 0.4]) + rpy(0.5, 0.6, 0.7) @ [0, 0, 0.1])
    )
    assert sorted(omissions) == [
        ("link 'base'", "picture of ground"),
        ("link 'upper'", "picture"),
        ("link 'upper'", "picture"),
    ]


def test_shapes_go_to_urdf_and_back(tmp_path):
    rng = np.random.default_rng(4)
    m = mb.Model("robot")
    b = m.body("b", mass=1.3, inertia=(0.1, 0.2, 0.25), at=rng.normal(size=3), orientation=rng.normal(size=4), shape=[
        mb.Box((0.3, 0.2, 0.1), at=rng.normal(size=3), orientation=rng.normal(size=4), colour="#336699"),
        mb.Cylinder(0.1, 0.7, rng.normal(size=3), at=rng.normal(size=3)), mb.Sphere(0.2, at=rng.normal(size=3)),
        mb.Sphere((0.1, 0.2, 0.3)),
    ])  # fmt: skip
    m.revolute("A", m.ground, b, at=rng.normal(size=3), axis=rng.normal(size=3))
    with pytest.warns(mb.OmissionWarning) as told:
        m.save(tmp_path / "robot.urdf")
    assert [(o.object, o.feature) for o in told[0].message.omissions] == [("body 'b'", "ellipsoid")]
    again, omissions = load(tmp_path / "robot.urdf")
    assert not omissions
    for mine, its in zip(m.scene.bodies[0].solids[:3], again.scene.bodies[0].solids, strict=True):
        assert mine.colour == its.colour and mine.vertices.mean(axis=0) == pytest.approx(its.vertices.mean(axis=0))
        far = [np.sort(np.linalg.norm(s.vertices - s.vertices.mean(axis=0), axis=1)) for s in (mine, its)]
        assert far[0] == pytest.approx(far[1])
        inertia = [np.cov(s.vertices.T) for s in (mine, its)]  # where the shape points
        assert inertia[0] == pytest.approx(inertia[1], abs=1e-9)


def test_geoms_of_mjcf_are_where_mujoco_draws_them(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    text = """<mujoco><compiler angle="radian"/>
    <default><geom rgba="0.2 0.4 0.6 1"/><default class="hidden"><geom group="3"/></default></default>
    <worldbody><geom type="plane" size="1 1 1"/>
      <body name="a" pos="0.3 -0.2 0.5" euler="0.3 0.5 -0.7"><joint axis="0.3 0.4 0.5"/>
        <geom name="box" type="box" size="0.1 0.2 0.3" pos="0.1 0.4 0.2" euler="0.2 0.1 0.9"/>
        <geom name="pill" type="capsule" size="0.05" fromto="0 0 0 0.3 0.4 -0.1"/>
        <geom name="egg" type="ellipsoid" size="0.1 0.2 0.3" pos="0.5 0 0" contype="0" conaffinity="0" rgba="1 0 0 1"/>
        <geom name="unseen" class="hidden" type="sphere" size="0.2"/>
        <body name="b" pos="0.1 0.7 0.1" quat="0.8 0.1 -0.3 0.2"><geom name="can" type="cylinder" size="0.1 0.25" pos="0 0.2 0"/></body>
      </body></worldbody></mujoco>"""
    (tmp_path / "a.xml").write_text(text)
    m, omissions = load(tmp_path / "a.xml")
    told = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(told)
    mujoco.mj_kinematics(told, data)
    solids = [(s, body.name) for body in m.scene.bodies for s in body.solids]
    assert len(solids) == 6  # a capsule is a tube and two balls
    for name, place, size in (("box", 0, [0.2, 0.4, 0.6]), ("pill", 1, [0.1, 0.1, np.sqrt(0.26)]), ("egg", 4, [0.2, 0.4, 0.6]),
                              ("can", 5, [0.2, 0.2, 0.5])):  # fmt: skip
        solid = solids[place][0]
        local = (solid.vertices - data.geom(name).xpos) @ data.geom(name).xmat.reshape(3, 3)
        assert np.ptp(local, axis=0) == pytest.approx(size, rel=0.03), name
        assert 0.5 * (local.max(axis=0) + local.min(axis=0)) == pytest.approx(np.zeros(3), abs=0.01), name
    assert solids[4][0].colour == "#ff0000" and solids[0][0].colour == "#336699"
    assert ("geom 'egg'", "contact") not in omissions and ("geom 'box'", "contact") in omissions
    assert ("body 'world'", "picture of the world") in omissions


def test_meshes_of_mjcf_stay_within_the_folder(tmp_path):
    (tmp_path / "robot" / "meshes").mkdir(parents=True)
    for place in ("robot/meshes/hand.stl", "secret.stl"):
        (tmp_path / place).write_text("solid none\nendsolid none\n")
    body = '<body name="{0}"><freejoint/><inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/><geom type="mesh" mesh="{1}"/></body>'
    (tmp_path / "robot" / "a.xml").write_text(
        '<mujoco><compiler meshdir="meshes"/><asset><mesh file="hand.stl" scale="1 1 -2"/><mesh name="out" file="../../secret.stl"/>'
        f"</asset><worldbody>{body.format('a', 'hand')}{body.format('b', 'out')}{body.format('c', 'none')}</worldbody></mujoco>"
    )
    m, omissions = load(tmp_path / "robot" / "a.xml")
    shapes = tables(m)["body_shape"]
    assert (
        list(shapes) == ["a"] and shapes["a"][0]["scale"] == [1.0, 1.0, -2.0] and "hand.stl" in shapes["a"][0]["file"]
    )
    assert {("body 'b'", "picture"), ("body 'c'", "picture")} <= set(omissions)
