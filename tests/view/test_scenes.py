"""Models drawn without computing: symbols of joints, springs and loads, figures, and the page of a model that does not move."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mbrs as mb
import numpy as np
import pytest
from mbrs import view
from mbrs.model.schema import JOINTS
from mbrs.view.drawing import grain
from mbrs.view.still import still
from mbrs.view.symbols import GLYPHS, links, marks

FOLDER = Path(view.__file__).parent


NAMES = "abcdefghijklmn"


def random_turn(rng):
    return np.linalg.qr(rng.normal(size=(3, 3)))[0] * np.array([1.0, 1.0, 1.0])


def every_kind(seed, turn=None, shift=(0.0, 0.0, 0.0), size=1.0, loads=True):
    """A model with every joint, element and load, at no convenient place; turned, moved and scaled as asked."""
    rng = np.random.default_rng(seed)
    turn, shift = np.eye(3) if turn is None else turn, np.asarray(shift)

    def place(p):
        return turn @ (size * np.asarray(p)) + shift

    m = mb.Model("every", gravity=turn @ [0.3, -9.1, 2.0])
    for name in NAMES:
        m.body(name, mass=1.3, inertia=(0.2, 0.3, 0.4), at=place(rng.normal(size=3)))
    for k, kind in enumerate(JOINTS.values()):
        a, b = (m.ground, "a") if k % 3 == 0 else (NAMES[k - 1], NAMES[k])
        given, axis = {}, rng.normal(size=3)
        pair = rng.normal(size=(2, 3))
        given["at"] = [place(p) for p in pair] if kind.points == "two" else place(pair[0])
        if "axis" in kind.known:
            given["axis"] = turn @ axis
        if "axis2" in kind.known:
            given["axis2"] = turn @ np.cross(axis, rng.normal(size=3))
        if "radius" in kind.known:
            given["radius"] = 0.3 * size
        if "pitch" in kind.known:
            given["pitch"] = 0.07 * size
        if "k" in kind.known and kind.free:
            given["k"] = rng.uniform(1, 2, len(kind.free)) if len(kind.free) > 1 else 1.7
        getattr(m, kind.type)(f"J {kind.type}", a, b, **given)
    for name, more in (
        ("spring", {"k": 3.1}), ("damper", {"c": 0.4}), ("both", {"k": 3.1, "c": 0.4}), ("stop", {"law": mb.Gap(1e4, 0.1)}),
        ("rubs", {"law": mb.CoulombTanh(0.3, 0.01), "k": 2.0}),
    ):  # fmt: skip
        m.spring_damper(name, m.ground, "c", at=[place(p) for p in rng.normal(size=(2, 3))], **more)
    m.bushing("rubber", "a", "b", at=place(rng.normal(size=3)), k=(1.0,) * 6)
    m.torsion("coil", "b", "d", at=place(rng.normal(size=3)), axis=turn @ rng.normal(size=3), k=2.0)
    if loads:
        m.force("pull", "c", at=place(rng.normal(size=3)), value=turn @ [1.0, 2.0, -2.0])
        m.force("push", "d", value=turn @ [0.3, 0.0, 0.4])
        m.torque("twist", "e", value=turn @ [0.0, 0.6, 0.8], frame="body")
        m.force("shaker", "b", value=(mb.Sine(-2.0, frequency=3.0), 0.0, 0.0))
        m.torque("unknown", "b", value=lambda t: (t, 0.0, t * t))
    return m


@pytest.mark.parametrize("seed", range(3))
def test_loads_have_no_size(seed):
    """A load far from the origin of the world neither reaches there nor widens the picture."""
    with_loads, without = every_kind(seed).scene, every_kind(seed, loads=False).scene
    assert with_loads.points == pytest.approx(without.points, rel=1e-11, abs=1e-11)
    assert with_loads.size == pytest.approx(without.size)
    for a, b in zip(with_loads.bodies, without.bodies, strict=True):
        assert a.points == pytest.approx(b.points, rel=1e-11, abs=1e-11)
    assert [load.name for load in with_loads.loads] == ["pull", "push", "twist", "shaker", "unknown"]


@pytest.mark.parametrize("seed", range(4))
def test_symbols_turn_move_and_grow_with_the_world(seed):
    rng = np.random.default_rng([seed, 5])
    turn = random_turn(rng)
    turn *= np.sign(np.linalg.det(turn))
    shift, size = 100.0 * rng.normal(size=3), float(np.exp(rng.normal()))
    plain, other = every_kind(seed).scene, every_kind(seed, turn, shift, size).scene
    for a, b in zip(plain.joints, other.joints, strict=True):
        assert b.at == pytest.approx(size * turn @ a.at + shift) and b.at_b == pytest.approx(
            size * turn @ a.at_b + shift
        )
    here = {mark.name: mark for mark in marks(plain, 0.01) if mark.group != "spring" and not _is_ground(mark)}
    there = {mark.name: mark for mark in marks(other, 0.01 * size) if mark.group != "spring" and not _is_ground(mark)}
    assert here.keys() == there.keys()
    straight = 0
    for name, mark in here.items():
        if name in ("J free", "J fixed", "shaker", "unknown"):  # along the axes of the world
            continue
        # arrows are as long as a share of the box around the scene
        grown = np.linalg.norm(there[name].lines[0]) / np.linalg.norm(mark.lines[0]) if mark.group == "load" else size
        assert there[name].at == pytest.approx(size * turn @ mark.at + shift)
        for line, image in zip(mark.lines, there[name].lines, strict=True):
            if len(line) == 2 and name != "J knife_edge":
                straight += 1
                assert image == pytest.approx(grown * line @ turn.T, rel=1e-9, abs=1e-9 * grown)
    assert straight > 6


def _is_ground(mark):
    return mark.body is None and len(mark.lines) >= 12


def test_a_scene_in_motion_carries_everything():
    """Bodies turned as a whole: the same as the model drawn there, loads of the world excepted."""
    rng = np.random.default_rng(3)
    turn = random_turn(rng)
    turn *= np.sign(np.linalg.det(turn))
    m = mb.Model("one")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0.3, 0.1, 0.7), shape=mb.Box((0.3, 0.2, 0.1), at=(0.1, 0.2, 0.3)))
    c = m.body("c", mass=1.0, inertia=(1, 1, 1), at=(-0.3, 0.4, 0.2))
    m.universal("U", b, c, at=(0.2, 0.5, 0.1), axis=(1, 2, 3), axis2=(3, 0, -1))
    m.torsion("T", b, c, at=(0.2, 0.5, 0.1), axis=(1, 2, -3), k=1.0)
    m.force("world", b, at=(0.1, 0.2, 0.9), value=(1, 2, 3))
    m.force("follower", b, at=(0.1, 0.2, 0.9), value=(1, 2, 3), frame="body")
    drawn = m.scene
    moved = drawn.moved([turn @ one.origin for one in drawn.bodies], [turn @ one.rotation for one in drawn.bodies])
    assert moved.joints[0].axis == pytest.approx(turn @ drawn.joints[0].axis)
    assert moved.joints[0].axis2 == pytest.approx(turn @ drawn.joints[0].axis2)
    assert moved.links[0].axis == pytest.approx(turn @ drawn.links[0].axis)
    assert moved.bodies[0].solids[0].vertices == pytest.approx(drawn.bodies[0].solids[0].vertices @ turn.T)
    assert [load.at for load in moved.loads] == [pytest.approx(turn @ load.at) for load in drawn.loads]
    assert moved.loads[0].value == pytest.approx([1, 2, 3]) and moved.loads[1].value == pytest.approx(turn @ [1, 2, 3])


def test_parts_of_springs_are_told_apart():
    found = {link.name: link.parts for link in links(every_kind(1).scene)}
    assert found["spring"] == ("spring",) and found["damper"] == ("damper",) and found["both"] == ("spring", "damper")
    assert found["stop"] == ("gap",) and found["rubs"] == ("spring", "law") and found["rubber"] == ("bushing", "spring")
    assert found["J distance"] == ("rod",)
    m = mb.Model("apart")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1))
    m.revolute("open", m.ground, b, at=((0.3, 0.1, 0.2), (0.0, 0.4, 0.1)), axis=(1, 2, 3))
    assert [link.parts for link in links(m.scene)] == [("open",)]
    assert {part for parts in found.values() for part in parts} - {"bushing"} <= set(GLYPHS)


def test_arrows_point_along_loads_and_the_largest_is_the_longest():
    rng = np.random.default_rng(8)
    m = mb.Model("loads")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(3.0, 1.0, 2.0))
    m.marker("far", b, at=(4.0, -1.0, 2.5))
    values = rng.normal(size=(6, 3)) * np.exp(rng.normal(size=(6, 1)))
    for i, value in enumerate(values):
        m.force(f"f{i}", b, value=value)
    scene = m.scene
    arrows = {mark.name: mark for mark in marks(scene, grain(scene))}
    tip = np.array([arrows[f"f{i}"].solids[0][0][-1] for i in range(6)])
    length, size = np.linalg.norm(tip, axis=1), np.linalg.norm(values, axis=1)
    assert tip / length[:, None] == pytest.approx(values / size[:, None], abs=1e-12)
    assert np.array_equal(np.argsort(length), np.argsort(size)) and length.max() < 0.2 * scene.size
    assert "N, on b" in arrows["f0"].label


def test_loads_that_vary_show_their_direction_if_it_is_known():
    scene = every_kind(0).scene
    value = {load.name: load.value for load in scene.loads}
    assert value["shaker"] == pytest.approx([-2.0, 0.0, 0.0]) and value["unknown"].tolist() == [0.0, 0.0, 0.0]
    assert {load.name for load in scene.loads if load.varies} == {"shaker", "unknown"}


def test_drawing_computes_nothing():
    code = (
        "import sys, mbrs as mb\n"
        "for m in (mb.examples.four_bar(), mb.examples.quadruped(), mb.examples.wind_rotor()):\n"
        "    m.plot(); m.animate().html(); print(m)\n"
        "assert 'mbrs._core' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_the_figure_names_what_it_draws():
    m = mb.examples.four_bar()
    made = m.plot()
    assert plt.fignum_exists(made.number)
    axes = made.axes[0]
    assert {t.get_text() for t in axes.texts} >= {"crank", "coupler", "A", "D", "mount", "motor", "pull"}
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")  # a flat model is seen squarely
    figure, ax = plt.subplots()
    assert m.plot(ax=ax, view=(0.3, 0.2), names=False) is figure and not ax.texts and len(ax.patches) > 20
    for wrong in ("zz", (1,), (np.nan, 0.0), 3.0):
        with pytest.raises(mb.errors.ModelError, match="view= must be"):
            m.plot(view=wrong)
    with pytest.raises(mb.errors.ModelError, match="has no body"):
        mb.Model("empty").plot()


@pytest.mark.parametrize("thin", range(3))
def test_flat_models_are_seen_squarely(thin):
    m = mb.Model("flat")
    rng = np.random.default_rng(thin)
    for i in range(4):
        at = rng.normal(size=3)
        at[thin] = 0.7
        m.body(f"b{i}", mass=1.0, inertia=(1, 1, 1), at=at)
    axes = m.plot().axes[0]
    assert axes.get_xlabel() + axes.get_ylabel() == " [m]".join([c for c in "xyz" if c != "xyz"[thin]] + [""])
    azimuth, elevation = still(m.scene).data["view"]
    eye = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    assert int(np.argmax(np.abs(eye))) == thin


def test_an_axis_along_x_is_not_looked_at_from_above():
    m = mb.Model("shaft")
    for i in range(3):
        m.body(f"b{i}", mass=1.0, inertia=(1, 1, 1), at=(0.7 * i, 0.0, 0.0))
    azimuth, elevation = still(m.scene).data["view"]
    assert abs(elevation) < 0.6 and abs(np.sin(azimuth)) > 0.5


def test_the_page_of_a_model(tmp_path):
    m = every_kind(2)
    text = m.animate(tmp_path / "model.html").read_text(encoding="utf-8")
    assert text.lower().startswith("<!doctype html>") and "http://" not in text and "https://" not in text
    data = m.animate().data
    assert {one["t"] for one in (*data["marks"], *data["links"])} == {
        *(j.name for j in m.joints), *(e.name for e in m.elements), *(f.name for f in m.loads)
    }  # fmt: skip
    assert [body["n"] for body in data["bodies"]] == [b.name for b in m.bodies]
    assert "iframe" in m.animate()._repr_html_()


PAGE = """
const calls = [];
const context = new Proxy({}, {
  get: (o, k) => k in o ? o[k] : () => { calls.push(k); return { width: 40 }; },
  set: (o, k, v) => { o[k] = v; return true; },
});
class Element {
  constructor(tag) {
    Object.assign(this, { tag, children: [], style: {}, classList: { add() {}, toggle() {} }, listeners: {}, offsetWidth: 50 });
  }
  append(...more) { this.children.push(...more); }
  appendChild(one) { this.children.push(one); return one; }
  setAttribute() {}
  click() { this.onclick(); }
  addEventListener(name, f) { this.listeners[name] = f; }
  getContext() { return context; }
  getBoundingClientRect() { return { left: 0, top: 0, width: 900, height: 600 }; }
  get clientWidth() { return 900; }
  get clientHeight() { return 600; }
}
global.document = { createElement: (tag) => new Element(tag) };
global.window = { devicePixelRatio: 1 };
global.ResizeObserver = class { observe() {} };
let frame = null;
global.requestAnimationFrame = (f) => { frame = f; };
const find = (node, test) => node instanceof Element ? [...(test(node) ? [node] : []), ...node.children.flatMap((c) => find(c, test))] : [];
const viewer = require(FOLDER + "/viewer.js");
const painted = [], paint = viewer.paint;
const scene = SCENE, root = new Element("div");
require(FOLDER + (scene.motion ? "/motion.js" : scene.modes ? "/viewer.js" : "/still.js"))(root, scene);
frame(0);
const canvas = find(root, (n) => n.tag === "canvas")[0], tip = find(root, (n) => n.className === "mbrs-tip")[0];
const labels = () => {
  const found = new Set();
  for (let x = 0; x < 900; x += 3) for (let y = 0; y < 600; y += 3) {
    canvas.onpointermove({ pointerId: 1, clientX: x, clientY: y });
    if (!tip.hidden) found.add(tip.textContent);
  }
  return [...found];
};
const first = labels();
const all = find(root, (n) => n.tag === "label").map((n) => [n.children[n.children.length - 1], n.children[0]]);
const boxes = all.filter((p) => typeof p[0] === "string");
for (const [text, input] of boxes) {
  if (!["joints", "springs", "loads"].includes(text)) continue;
  input.checked = false;
  input.listeners.input();
}
frame(20);
console.log(JSON.stringify({ first, second: labels(), boxes: boxes.map((b) => b[0]), calls: calls.length }));
"""


def run_page(data):
    code = PAGE.replace("FOLDER", json.dumps(str(FOLDER))).replace("SCENE", json.dumps(data))
    made = subprocess.run(["node", "-"], input=code, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr[-2000:]
    return json.loads(made.stdout)


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_names_are_under_the_pointer_and_groups_can_be_hidden():
    m = mb.examples.four_bar()
    seen = run_page(m.animate().data)
    names = {label.split(" (")[0] for label in seen["first"]}
    assert names == {"crank", "coupler", "rocker", "A", "B", "C", "D", "mount", "motor", "pull"}
    assert "A (revolute): ground - crank" in seen["first"] and "motor (torque): 0.5 N m, on crank" in seen["first"]
    assert {label.split(" (")[0] for label in seen["second"]} == {"crank", "coupler", "rocker"}
    assert seen["boxes"] == ["names", "joints", "springs", "loads", "see through"] and seen["calls"] > 1000


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
def test_modes_and_motions_paint_the_same_symbols():
    m = mb.examples.quarter_car()
    for data in (mb.modes(m).animate(phase=0.0).data, mb.simulate(m, t=0.1).animate(at=0.05).data):
        seen = run_page(data)
        names = {label.split(" (")[0] for label in seen["first"]}
        assert names >= {"suspension", "tyre", "wheel guide", "body guide"} and "springs" in seen["boxes"]
        assert {label.split(" (")[0] for label in seen["second"]} == {b.name for b in m.bodies}
    beam = mb.flexible.beam(2.0, mass=1.0, EI_flap=400.0, EI_edge=1600.0, modes=3, attach=["tip"])
    m = mb.Model("wing")
    wing = m.flexible_body("wing", beam, orientation=mb.rotation((0.31, -0.83, 0.46), 0.7))
    m.fixed("clamp", m.ground, wing.node("root"))
    wing.node("tip")
    for made in (m, mb.modes(m), mb.simulate(m, t=0.01)):
        assert "wing" in run_page(made.animate().data)["first"]


def test_points_that_rounding_parts_are_drawn_as_one():
    def drawn(noise):
        rng = np.random.default_rng(5)
        at = rng.normal(size=3)
        m = mb.Model("point")
        for i in range(2):
            here = at + noise * rng.normal(size=3)
            b = m.body(f"b{i}", mass=1.0, inertia=(1, 1, 1), at=here)
            m.prismatic(f"guide {i}", m.ground, b, at=(at, here), axis="z")
        return m.animate().data

    exact, noisy = drawn(0.0), drawn(1e-14)
    assert noisy["grain"] == pytest.approx(exact["grain"], rel=1e-6) and len(noisy["links"]) == len(exact["links"])


def test_mode_shapes_bend_flexible_bodies():
    """The end of the drawn line moves as the node does that lies there."""
    beam = mb.flexible.beam(2.0, mass=1.0, EI_flap=400.0, EI_edge=1600.0, modes=4, attach=["tip"])
    m = mb.Model("wing")
    wing = m.flexible_body("wing", beam, orientation=mb.rotation((0.31, -0.83, 0.46), 0.7))
    m.revolute("hinge", m.ground, wing.node("root"), axis=(0.3, 0.1, 0.9), k=70.0)
    wing.node("tip")
    modes = mb.modes(m)
    from mbrs.view.modes import _lines

    line = _lines(modes, modes.geometry, modes.n)["wing"]
    tip, root = modes.body_shape("wing.tip"), modes.body_shape("wing")
    assert line[-1] == pytest.approx(tip[:3], abs=1e-9 * np.abs(tip).max())
    assert line[0] == pytest.approx(root[:3], abs=1e-9 * np.abs(tip).max())


def test_the_page_opens_on_a_mode_that_vibrates():
    m = mb.Model("free")
    a = m.body("a", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0))
    m.bushing("k", a, b, at=(0.5, 0, 0), k=(1e3, 1e3, 1e3, 10, 10, 10))
    modes = mb.modes(m)
    assert modes.animate().data["start"] == int(np.argmax(modes.frequency > 0.0)) == 6
    assert modes.animate(select=0).data["start"] == 0
