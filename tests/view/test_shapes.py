"""Shapes of bodies: surfaces, files, parameters; they are seen in every picture and change no result."""

from __future__ import annotations

import pickle

import mbrs as mb
import numpy as np
import pytest
from mbrs.model.tables import tables
from mbrs.view.meshes import MOST_TRIANGLES, lighter
from mbrs.view.shapes import cone, sphere, surface, tube
from mbrs.view.still import still

TURN = mb.rotation((0.31, -0.83, 0.46), 0.7)


def volume(vertices, faces):
    """Signed, by the divergence theorem: positive if every face is seen from outside counter-clockwise."""
    total = 0.0
    for loop in faces:
        for i in range(1, len(loop) - 1):
            total += np.linalg.det(vertices[[loop[0], loop[i], loop[i + 1]]]) / 6.0
    return total


def inscribed(n):
    """Area of a regular polygon of n corners in a circle of radius 1."""
    return 0.5 * n * np.sin(2 * np.pi / n)


@pytest.mark.parametrize("seed", range(3))
def test_surfaces_have_their_volumes(seed):
    rng = np.random.default_rng(seed)
    origin, rotation = rng.normal(size=3), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    more = {"at": rng.normal(size=3), "orientation": rng.normal(size=4)}
    size = rng.uniform(0.1, 2.0, 3)

    def of(table):
        solid = surface({**table, **more}, origin, rotation)
        return volume(solid.vertices, solid.faces)

    assert of({"type": "box", "size": size}) == pytest.approx(np.prod(size))
    pipe = of({"type": "cylinder", "radius": size[0], "length": size[1], "axis": rng.normal(size=3)})
    assert pipe == pytest.approx(inscribed(20) * size[0] ** 2 * size[1])
    ball = of({"type": "sphere", "radius": size})
    assert 0.9 < ball / (4 / 3 * np.pi * np.prod(size)) < 1.0
    vertices, faces = cone(size[0], size[1], 12)
    assert volume(vertices, faces) == pytest.approx(inscribed(12) * size[0] ** 2 * size[1] / 3)
    start, end = rng.normal(size=(2, 3))
    assert volume(*tube(start, end, 0.1, 9)) == pytest.approx(inscribed(9) * 0.01 * np.linalg.norm(end - start))


def shown():
    m = mb.Model("shown", gravity=(0, 0, -9.81))
    a = m.parameter("a", 0.7, unit="m")
    b = m.body("b", mass=1.0, inertia=(0.1, 0.2, 0.25), at=(0.3, 0.1, -0.2), orientation=TURN, shape=[
        mb.Box((a, 0.2, 2 * a), at=(0, a, 0), orientation=TURN, colour="#aa3311"), mb.Cylinder(0.1, a, "-y"),
        mb.Sphere((0.1, a / 2, 0.3)),
    ])  # fmt: skip
    m.body("c", mass=1.0, inertia=(0.1, 0.2, 0.25), shape=mb.Sphere(0.3))
    m.bushing("k", m.ground, b, at=(0, 0, 0), k=(9e3, 8e3, 7e3, 60, 50, 40))
    m.bushing("kc", m.ground, "c", at=(0, 0, 0), k=(9e3, 8e3, 7e3, 60, 50, 40))
    return m


def test_shapes_come_back_from_files_pickles_and_copies():
    m = shown()
    text = m.file_text()
    assert (
        "shape = [" in text
        and 'type = "box"' in text
        and '"a*2.0"' in text.replace("2.0*a", "a*2.0").replace("2*a", "a*2.0")
    )
    for other in (mb.Model.load, None):
        again = m.copy() if other is None else pickle.loads(pickle.dumps(m))
        assert again.file_text() == text and tables(again)["body_shape"] == tables(m)["body_shape"]


def test_a_file_gives_the_same_shapes(tmp_path):
    m = shown()
    again = mb.Model.load(m.save(tmp_path / "shown.toml"))
    assert again.file_text() == m.file_text() and tables(again)["body_shape"] == tables(m)["body_shape"]
    again.set({"a": 1.1})
    assert tables(again)["body_shape"]["b"][0]["size"] == [1.1, 0.2, 2.2]
    (tmp_path / "by_hand.toml").write_text(
        '[[body]]\nname = "b"\nmass = 1\ninertia = [1, 1, 1]\nshape = { type = "cylinder", radius = 0.1, length = 2, axis = "x" }\n'
    )
    assert tables(mb.Model.load(tmp_path / "by_hand.toml"))["body_shape"]["b"][0]["axis"] == [1.0, 0.0, 0.0]
    for wrong, message in (('type = "bocks", size = [1, 1, 1]', "did you mean 'box'"), ('type = "box", radius = 1', "cannot have"),
                           ('type = "box", size = [1, -1, 1]', "must be positive")):  # fmt: skip
        text = f'[[body]]\nname = "b"\nmass = 1\ninertia = [1, 1, 1]\nshape = {{ {wrong} }}\n'
        (tmp_path / "wrong.toml").write_text(text)
        with pytest.raises(mb.errors.ModelError, match=f"line 5.*{message}"):
            mb.Model.load(tmp_path / "wrong.toml")


@pytest.mark.exact
def test_shapes_change_no_result():
    m, bare = shown(), shown()
    for body in bare.bodies:
        body.shape = []
    assert "body_shape" not in tables(bare)
    assert np.array_equal(mb.modes(m).roots, mb.modes(bare).roots)
    assert np.array_equal(tables(m)["x"], tables(bare)["x"])


def test_shapes_are_in_every_picture(tmp_path):
    m = shown()
    assert "box + cylinder + sphere" in str(m)
    at = m.scene.bodies[0].solids[0].vertices
    data = still(m.scene).data
    assert sum(one["b"] == 0 for one in data["solids"]) == 3 and data["solids"][0]["c"] == "#aa3311"
    modes, motion = mb.modes(m), mb.simulate(m, t=0.02)
    for made in (modes.animate().data, motion.animate().data):
        flat = np.reshape(made["solids"][0]["v"], (-1, 3)) + made["bodies"][0]["o"]
        assert flat == pytest.approx(at, abs=1e-4)
    again = mb.load(modes.save(tmp_path / "modes.json"))
    assert again.animate().data["solids"] == modes.animate().data["solids"]
    assert any(patch.get_facecolor()[0] > 0.4 > patch.get_facecolor()[2] for patch in m.plot().axes[0].patches)


def test_wrong_shapes_are_named():
    m = mb.Model("wrong")
    for made, message in (
        (lambda: mb.Box((1.0, -2.0, 3.0)), r"p\.shape\.size must be positive"),
        (lambda: mb.Cylinder(0.0, 1.0), "radius must be positive"),
        (lambda: mb.Sphere(np.inf), "radius must be a finite"),
        (lambda: mb.Mesh("a.exe"), "must be a file that ends in"),
        (lambda: mb.Box((1, 1, 1), colour="red"), "colour must be"),
        (lambda: "cube", "must be mb.Box"),
        (lambda: [mb.Sphere(1.0), 3], "or a list of them"),
        (lambda: mb.Box((1, 1, 1), orientation=(0, 0, 0)), "orientation"),
    ):
        with pytest.raises(mb.errors.ModelError, match=message):
            m.body("p", mass=1.0, inertia=(1, 1, 1), shape=made())
    assert not m.bodies


def ring(n):
    """A closed surface of 2 n^2 triangles that is not convex."""
    u, v = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(n) / n, indexing="ij")
    r = 0.7 + 0.2 * np.cos(v)
    points = np.stack([r * np.cos(u), r * np.sin(u), 0.2 * np.sin(v)], axis=-1).reshape(-1, 3)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i, np.roll(i, -1, 0), np.roll(np.roll(i, -1, 0), -1, 1), np.roll(i, -1, 1)
    return points, np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])


def test_large_surfaces_become_light_and_keep_their_form():
    points, triangles = ring(150)
    whole = volume(points, triangles)
    light, few = lighter(points, triangles, MOST_TRIANGLES)
    assert 0.2 * MOST_TRIANGLES < len(few) <= MOST_TRIANGLES and volume(light, few) == pytest.approx(whole, rel=0.05)
    points, triangles = ring(20)
    same, all_ = lighter(points, triangles, MOST_TRIANGLES)
    assert len(all_) == len(triangles) and volume(same, all_) == pytest.approx(volume(points, triangles))


@pytest.mark.parametrize("module", ["trimesh", "meshio"])
def test_surfaces_from_files(module, tmp_path, monkeypatch):
    pytest.importorskip(module)
    if module == "meshio":
        monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    points, triangles = ring(12)
    lines = [
        *(f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()),
        *(f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()),
    ]
    file = tmp_path / f"ring_{module}.obj"
    file.write_text("\n".join(lines) + "\n")
    m = mb.Model("mesh")
    for name, scale in (("plain", 2.0), ("mirrored", (1.0, 1.0, -1.0))):
        m.body(name, mass=1.0, inertia=(1, 1, 1), orientation=TURN, shape=mb.Mesh(file, scale))
    plain, mirrored = (body.solids[0] for body in m.scene.bodies)
    assert volume(plain.vertices, plain.faces) == pytest.approx(8 * volume(points, triangles))
    assert volume(mirrored.vertices, mirrored.faces) == pytest.approx(volume(points, triangles))


def test_meshes_that_cannot_be_read_are_named_and_left_out(tmp_path):
    (tmp_path / "bad.obj").write_bytes(b"\x00\xff nonsense")
    m = mb.Model("mesh")
    m.body("gone", mass=1.0, inertia=(1, 1, 1), shape=mb.Mesh(tmp_path / "absent.stl"))
    m.body("bad", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0), shape=mb.Mesh(tmp_path / "bad.obj"))
    with pytest.warns(mb.errors.MbrsWarning, match="cannot read the mesh") as told:
        scene = m.scene
    assert {"'gone'", "'bad'"} <= {w for one in told for w in str(one.message).split()}
    with pytest.warns(mb.errors.MbrsWarning):
        assert len(still(scene).data["solids"]) == 2 and m.plot().axes


def test_spheres_are_closed():
    vertices, faces = sphere(1.0, 12)
    edges = [(loop[i], loop[(i + 1) % len(loop)]) for loop in faces for i in range(len(loop))]
    assert len(set(edges)) == len(edges) and set(edges) == {(b, a) for a, b in edges} and len(vertices) == 62
