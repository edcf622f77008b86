"""Mode viewer: solids, scenes, data of the page, and the arithmetic of viewer.js where node is installed."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import ModelError
from mbrs.model.scene import scene_from_tables
from mbrs.view import modes as viewer
from mbrs.view.scene import BodyGeometry, JointGeometry, LinkGeometry, SceneGeometry
from mbrs.view.solids import body_solid
from small_results import chain_modes, isolator_modes


def _volume(vertices: np.ndarray, faces: list[list[int]]) -> float:
    """Signed volume by the divergence theorem: positive only if every face is seen counter-clockwise from outside."""
    total = 0.0
    for loop in faces:
        for i in range(1, len(loop) - 1):
            total += np.dot(vertices[loop[0]], np.cross(vertices[loop[i]], vertices[loop[i + 1]])) / 6.0
    return total


CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)


@pytest.mark.parametrize("detailed", [True, False])
@pytest.mark.parametrize(
    ("points", "volume"),
    [
        (np.zeros((0, 3)), 0.08**3),  # twice as thick as a link, or it would not show
        (np.array([[-1.0, 0, 0], [1.0, 0, 0]]), 2.04 * 0.04**2),
        (np.array([[-1.0, -2, 0], [1.0, 2, 0], [1, -2, 0], [-1, 2, 0]]), 2.04 * 4.04 * 0.04),
        (CUBE - 0.5, 1.04**3),
    ],
)
def test_solids_are_closed_and_as_thick_as_said(points: np.ndarray, volume: float, detailed: bool) -> None:
    vertices, faces = body_solid(np.zeros(3), np.eye(3), points, 0.02, detailed)
    assert _volume(vertices, faces) == pytest.approx(volume, rel=1e-6)
    edges = [(loop[i], loop[(i + 1) % len(loop)]) for loop in faces for i in range(len(loop))]
    assert len(set(edges)) == len(edges) and {(b, a) for a, b in edges} == set(edges)
    assert len(faces) == 6


def test_random_hulls_are_closed_and_hold_their_points() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        points = rng.normal(size=(rng.integers(1, 9), 3)) * rng.uniform(0.01, 1.0, 3) + 5.0
        vertices, faces = body_solid(np.full(3, 5.0), np.eye(3), points, 0.02)
        assert _volume(vertices, faces) > 0.0
        edges = {(loop[i], loop[(i + 1) % len(loop)]) for loop in faces for i in range(len(loop))}
        assert {(b, a) for a, b in edges} == edges
        for loop in faces:
            normal = sum(np.cross(vertices[loop[i]], vertices[loop[(i + 1) % len(loop)]]) for i in range(len(loop)))
            assert np.all((points - 5.0 - vertices[loop[0]]) @ normal <= 1e-9)


def _tables() -> dict[str, object]:
    """Two bodies, a revolute joint, a spring to ground, a torsion spring, a marker, laid out as docs/tables.md says."""
    body = np.zeros(23)
    body[3] = 1.0
    second = body.copy()
    second[0:3], second[3:7] = (1, 0, 0), (np.cos(0.25), 0, 0, np.sin(0.25))
    joint = np.zeros(37)
    joint[0:3] = joint[3:6] = (0.5, 0, 0)
    joint[8] = 2.0
    spring = np.zeros(10)
    spring[3:6] = (1.2, 0, 0)
    torsion = np.zeros(10)
    torsion[0:3], torsion[5] = (0.5, 0, 0), 1.0
    marker = np.array([1.4, 0, 0, 1, 0, 0, 0.0])
    parts = [body, second, joint, spring, torsion, marker]
    start = np.concatenate([[0], np.cumsum([len(p) for p in parts])])
    return {
        "x": np.concatenate(parts),
        "body_name": ["a", "b"], "body_x": start[0:2],
        "joint_name": ["J"], "joint_type": [1], "joint_a": [0], "joint_b": [1],
        "joint_flags": [0], "joint_x": start[2:3],
        "element_name": ["k", "t"], "element_type": [0, 2], "element_a": [-1, 0], "element_b": [1, 1],
        "element_flags": [1, 1], "element_x": start[3:5],
        "marker_name": ["P"], "marker_body": [1], "marker_x": start[5:6],
        "load_name": [], "load_body": [], "load_x": [],
    }  # fmt: skip


def test_scene_from_tables() -> None:
    scene = scene_from_tables(_tables())
    assert [b.name for b in scene.bodies] == ["a", "b"]
    assert scene.bodies[1].rotation @ [1, 0, 0] == pytest.approx([np.cos(0.5), np.sin(0.5), 0])
    assert sorted(p[0] for p in scene.bodies[1].points) == pytest.approx([0.5, 0.5, 1.2, 1.4])
    spring, torsion = scene.links
    assert (spring.a, spring.b, spring.kind) == (None, "b", "spring_damper") and spring.at_b[0] == 1.2
    assert torsion.kind == "torsion" and torsion.at_a[0] == torsion.at_b[0] == 0.5
    assert scene.joints[0].kind == "revolute" and scene.joints[0].axis[2] == 2.0
    assert scene.size == pytest.approx(1.4)


def test_a_scene_moves_with_its_bodies() -> None:
    scene = scene_from_tables(_tables())
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    rotation = np.array([scene.bodies[0].rotation, quarter @ scene.bodies[1].rotation])
    moved = scene.moved([[0, 0, 0], [5, 0, 0]], rotation)
    # points of b lay at x = 1.2 - 1 and so on along x from its origin; a quarter turn puts them along y
    assert moved.links[0].at_b == pytest.approx([5.0, 0.2, 0.0]) and moved.links[0].at_a == pytest.approx([0, 0, 0])
    # each of the two points of a joint goes with its own body
    assert moved.joints[0].at_b == pytest.approx([5.0, -0.5, 0.0]) and moved.joints[0].at == pytest.approx([0.5, 0, 0])
    assert moved.joints[0].axis == pytest.approx([0, 0, 2])
    assert sorted(moved.bodies[1].points[:, 1]) == pytest.approx([-0.5, -0.5, 0.2, 0.4])
    assert moved.links[1].at_a == pytest.approx([0.5, 0, 0]) and moved.links[1].at_b == pytest.approx([5.0, -0.5, 0])
    with pytest.raises(ModelError, match=r"positions \(2, 3\)"):
        scene.moved(np.zeros((1, 3)), rotation)


def test_scenes_refuse_what_cannot_be_drawn() -> None:
    body = BodyGeometry("a", (0, 0, 0))
    with pytest.raises(ModelError, match="refers to body 'b'"):
        SceneGeometry((body,), (LinkGeometry("k", None, "b", (0, 0, 0), (1, 0, 0)),))
    with pytest.raises(ModelError, match="same name"):
        SceneGeometry((body, body))
    with pytest.raises(ModelError, match="origin of body 'x'"):
        BodyGeometry("x", (0, 0, np.nan))
    with pytest.raises(ModelError, match="point of joint 'J'"):
        JointGeometry("J", "revolute", None, "a", (0, 0))


def _data(text: str) -> dict:
    found = re.search(r'<script type="application/json">(.*?)</script>', text, re.S)
    assert found
    return json.loads(found.group(1))


def _shape(mode: dict) -> np.ndarray:
    raw = np.frombuffer(base64.b64decode(mode["shape"]), dtype="<f4").reshape(-1, 6, 2).astype(float)
    return raw[..., 0] + 1j * raw[..., 1]


def test_page_holds_modes_and_needs_no_network(tmp_path: Path) -> None:
    path = viewer.modes(isolator_modes(), tmp_path / "modes.html")
    text = path.read_text(encoding="utf-8")
    data = _data(text)
    assert not re.search(r"https?:|src=|href=|@import|url\(|fetch|XMLHttp|WebSocket|eval\(", text)
    assert "default-src 'none'" in text
    assert [m["f"] for m in data["modes"]] == ["15.915", "15.915", "15.915", "18.378", "18.378", "36.755"]
    assert data["bodies"][0]["n"] == "payload" and len(data["links"]) == 6


def test_the_largest_motion_is_a_tenth_of_the_scene_or_a_limited_turn() -> None:
    data = viewer.modes(isolator_modes()).data
    z = _shape(data["modes"][2])[0]
    assert np.linalg.norm(z[:3]) == pytest.approx(0.1 * data["size"], rel=1e-6) and np.abs(z[3:]).max() < 1e-9
    m = mb.examples.cubic_hexapod()
    m.fixed("held", m.ground, m.body("far", mass=1.0, inertia=(1, 1, 1), at=(10, 0, 0)), at=(10, 0, 0))
    turn = _shape(viewer.modes(mb.modes(m)).data["modes"][3])[0]
    assert np.linalg.norm(turn[3:6]) == pytest.approx(0.6, rel=1e-6)


@pytest.mark.parametrize("axis", [(1.0, 0, 0), (0.6, -0.48, 0.64)])
def test_motion_is_as_large_in_every_direction(axis) -> None:
    m = mb.Model("slides")
    m.prismatic("p", m.ground, m.body("a", mass=1.3, inertia=(0.1, 0.2, 0.3)), at=(0, 0, 0), axis=axis, k=31.0)
    m.fixed("held", m.ground, m.body("far", mass=1.0, inertia=(1, 1, 1), at=(3, 1, 2)), at=(3, 1, 2))
    data = viewer.modes(mb.modes(m)).data
    assert np.linalg.norm(_shape(data["modes"][0])[0][:3]) == pytest.approx(0.1 * data["size"], rel=1e-6)


def test_phase_differences_survive_scaling() -> None:
    shape = np.array([1.0, 0.5j, -0.25, 0, 0, 0]) * np.exp(1.1j)
    drawn = _shape(viewer.modes(replace(isolator_modes(), shape=np.tile(shape[:, None], 6))).data["modes"][0])[0]
    assert drawn[1] / drawn[0] == pytest.approx(0.5j, abs=1e-6) and drawn[2] / drawn[0] == pytest.approx(
        -0.25, abs=1e-6
    )
    assert drawn[0].imag == pytest.approx(0.0, abs=1e-9) and drawn[0].real > 0.0


def test_names_cannot_break_out_of_the_page() -> None:
    evil, m = "</script><b>", mb.Model("evil")
    m.free("loose", m.ground, m.body(evil, mass=1.0, inertia=(1, 1, 1)), at=(0, 0, 0), k=(1, 2, 3, 4, 5, 6))
    text = viewer.modes(mb.modes(m)).html()
    assert evil not in text and _data(text)["bodies"][0]["n"] == evil


def test_bad_requests_are_named() -> None:
    modes = isolator_modes()
    with pytest.raises(ModelError, match="counts from 0"):
        viewer.modes(modes, select=6)
    with pytest.raises(ModelError, match="no mode"):
        viewer.modes(modes, n=0)
    flat = SimpleNamespace(geometry=modes.geometry, frequency=modes.frequency, body_shape=lambda name: np.zeros((3, 6)))
    with pytest.raises(ModelError, match=r"body_shape\('payload'\) must be"):
        viewer.modes(flat)
    with pytest.raises(ModelError, match="plain matrices"):
        viewer.modes(mb.modes(mb.MechanicalSystem([[1.0]], None, [[1.0]])))


def test_nan_and_motionless_shapes_still_make_a_page() -> None:
    shape = np.zeros((6, 6))
    shape[0, 0] = np.nan
    assert np.all(_shape(viewer.modes(replace(isolator_modes(), shape=shape)).data["modes"][0]) == 0.0)


@pytest.mark.slow
def test_large_scenes_share_faces() -> None:
    data = viewer.modes(chain_modes(1000)).data
    assert len(data["bodies"]) == 1000 and len(data["faces"]) <= 2  # the last rod has one joint


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_viewer_arithmetic_agrees_with_numpy() -> None:
    script = Path(viewer.__file__).with_name("viewer.js")
    rng = np.random.default_rng(5)
    shape = rng.normal(size=(3, 6)) + 1j * rng.normal(size=(3, 6))
    origins = rng.normal(size=(3, 3))
    flat = np.stack([shape.real, shape.imag], axis=-1).ravel().tolist()
    code = f"""
    const v = require({json.dumps(str(script))});
    const state = v.pose({json.dumps(flat)}, 3, 0.7, 1.3), origins = {json.dumps(origins.tolist())};
    const moved = [1, -1].map((body) => v.moved([1, 2, 3], body, state, origins));
    console.log(JSON.stringify([Array.from(state), ...moved]));
    """
    state, moved, ground = json.loads(subprocess.run(["node", "-e", code], capture_output=True, check=True).stdout)
    expected = 1.3 * np.real(shape * np.exp(0.7j))
    state = np.reshape(state, (3, 12))
    assert state[:, :3] == pytest.approx(expected[:, :3])
    for row, theta in zip(state, expected[:, 3:], strict=True):
        assert row[3:].reshape(3, 3) == pytest.approx(_exponential(theta), abs=1e-12)
    rotation = state[1, 3:].reshape(3, 3)
    assert moved == pytest.approx(origins[1] + state[1, :3] + rotation @ (np.array([1, 2, 3]) - origins[1]))
    assert ground == [1, 2, 3]


def _exponential(theta: np.ndarray) -> np.ndarray:
    from scipy.linalg import expm

    x, y, z = theta
    return expm(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]))
