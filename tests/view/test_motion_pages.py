"""Plots and the animation of motions: what they draw is what the trajectory says."""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
from pathlib import Path

import mbrs as mb
import motion_problems as zoo
import numpy as np
import pytest
from mbrs.errors import ModelError
from mbrs.model.scene import scene_from_tables
from mbrs.model.tables import tables
from mbrs.view import modes as viewer
from mbrs.view.motion import frames, motion


@pytest.fixture(scope="module")
def four_bars():
    return mb.simulate(mb.examples.four_bars(2), t=1.0, rtol=1e-8)


@pytest.fixture(scope="module")
def stone():
    return mb.simulate(zoo.free_body().model, t=np.linspace(0.0, 1.0, 11), rtol=1e-9)


KINDS = ["motion", "coordinates", "positions", "velocities", "energy", "residual", "steps", "error", "reactions"]


@pytest.mark.slow
@pytest.mark.parametrize("what", KINDS)
def test_every_plot_draws(four_bars, what, tmp_path):
    figure = four_bars.plot(what)
    figure.savefig(tmp_path / "a.png")
    lines = [line for ax in figure.axes for line in ax.lines]
    assert lines and all(np.all(np.isfinite(line.get_ydata())) for line in lines)


def test_curves_are_the_trajectory(four_bars):
    figure = four_bars.plot("coordinates", of=["foot0"])
    (line,) = figure.axes[0].lines
    assert np.array_equal(line.get_ydata(), four_bars.joint("foot0"))
    assert line.get_label() == "foot0"
    total = next(line for line in four_bars.plot("energy").axes[0].lines if line.get_label() == "total")
    assert np.array_equal(total.get_ydata(), four_bars.energy.total)


def test_a_free_body_is_plotted_by_its_place_and_has_no_reactions(stone):
    labels = [line.get_label() for line in stone.plot().axes[0].lines]
    assert "stone.z" in labels
    with pytest.raises(ModelError, match="no joints"):
        stone.plot("reactions")
    with pytest.raises(ModelError, match="known are motion"):
        stone.plot("magic")


def test_fixed_steps_have_no_local_errors(four_bars):
    fixed = mb.simulate(mb.examples.four_bars(1), t=0.02, step=0.01)
    with pytest.raises(ModelError, match="rtol"):
        fixed.plot("error")


def test_power_names_its_elements():
    traj = mb.simulate(zoo.bushings().model, t=0.2, rtol=1e-6)
    labels = {line.get_label() for line in traj.plot("power").axes[0].lines}
    assert labels == {"b0", "b1", "b2"}
    with pytest.raises(ModelError, match="no element"):
        traj.plot("power", of=["nothing"])


def test_frames_between_outputs_follow_the_motion(stone):
    """Cubics over steps of .1 s against a run with outputs at the frames: fourth order in the distance of outputs."""
    times = np.linspace(0.0, 1.0, 41)
    fine = mb.simulate(zoo.free_body().model, t=times, rtol=1e-9)
    position, quaternion, speed = frames(stone, times)
    gap = np.abs(position - fine.poses["position"]).max()
    same = np.abs(np.sum(quaternion * fine.poses["orientation"], axis=-1))
    print(f"frames: {gap:.1e} m, turned off by {2 * np.arccos(np.clip(same, 0, 1)).max():.1e} rad")
    assert gap < 1e-12  # a parabola
    assert 2 * np.arccos(np.clip(same, 0, 1)).max() < 2e-3
    assert np.abs(np.linalg.norm(quaternion, axis=-1) - 1).max() < 1e-12
    assert np.abs(speed - np.linalg.norm(fine.poses["velocity"], axis=-1)).max() < 0.01 * speed.max()


def test_whole_turns_between_outputs_are_not_lost():
    """Nine radians from one output to the next: angular velocities tell how often it turned."""
    m = mb.Model("spin")
    m.body("top", mass=1.0, inertia=(1, 1, 2), at=(0, 0, 0), angular_velocity=(0, 0, 90.0))
    traj = mb.simulate(m, t=[0.0, 0.1, 0.2], rtol=1e-8)
    times = np.linspace(0.0, 0.2, 33)
    angle = 2 * np.arctan2(frames(traj, times)[1][:, 0, 3], frames(traj, times)[1][:, 0, 0])
    assert np.abs(np.exp(1j * angle) - np.exp(90j * times)).max() < 1e-9


def test_page_is_one_file_with_the_motion_in_it(four_bars, tmp_path):
    path = four_bars.animate(tmp_path / "run.html")
    text = path.read_text(encoding="utf-8")
    assert text.lower().startswith("<!doctype html>") and "http://" not in text and "https://" not in text
    scene = motion(four_bars).data
    n, bodies = scene["motion"]["count"], len(four_bars.bodies)
    p = np.frombuffer(base64.b64decode(scene["motion"]["p"]), dtype="<f4").reshape(n, bodies, 3)
    moved = p[-1] - p[0]
    expected = np.array([four_bars.position(b)[-1] - four_bars.position(b)[0] for b in four_bars.bodies])
    assert np.abs(moved - expected).max() < 1e-5
    assert [name for name, _, _ in scene["paths"]] == ["tip"]
    way = np.frombuffer(base64.b64decode(scene["paths"][0][2]), dtype="<f4").reshape(n, 3)
    assert np.abs(way[-1] - four_bars.point("tip")[-1]).max() < 1e-5


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"pace": 0.0}, "pace="),
        ({"pace": np.nan}, "pace="),
        ({"at": 9.0}, "outside"),
        ({"paths": ["x"]}, "no marker"),
        ({"follow": "x"}, "no body"),
    ],
)
def test_bad_input(four_bars, options, words):
    with pytest.raises(ModelError, match=words):
        motion(four_bars, **options)


@pytest.mark.skipif(shutil.which("node") is None, reason="node is not installed")
def test_the_page_plays_what_it_holds():
    """Half way between two frames: positions in the middle, rotations half way."""
    script = Path(viewer.__file__).with_name("motion.js")
    half = np.cos(0.2), np.sin(0.2)
    motion_data = {
        "from": 1.0,
        "step": 0.5,
        "count": 2,
        "n": 1,
        "p": [0, 0, 0, 2, 4, 6],
        "q": [1, 0, 0, 0, half[0], 0, 0, half[1]],
    }
    code = f"const m = require({json.dumps(str(script))}); console.log(JSON.stringify(Array.from(m.at({json.dumps(motion_data)}, 1.25))))"
    state = json.loads(subprocess.run(["node", "-e", code], capture_output=True, check=True).stdout)
    assert state[:3] == [1, 2, 3]
    c, s = np.cos(0.2), np.sin(0.2)
    assert np.allclose(np.reshape(state[3:], (3, 3)), [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-12)


def test_what_rolls_is_round():
    """A rolling disc, and a wheel whose hinge drives a rack: points of the rim at their radius about their axis."""
    m = mb.Model("rack")
    p = m.body("pinion", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0.5, 0, 0))
    r = m.body("bar", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0.5, -0.1, 0))
    turn = m.revolute("turn", m.ground, p, at=(0.5, 0, 0), axis=(0, 0.6, 0.8))
    m.coupler("mesh", turn, m.prismatic("slide", m.ground, r, at=(0.5, -0.1, 0), axis="x"), -0.1)
    rim = scene_from_tables(tables(m)).bodies[0].points[-24:] - [0.5, 0, 0]
    assert np.allclose(np.linalg.norm(rim, axis=1), 0.1) and np.allclose(rim @ [0, 0.6, 0.8], 0.0)
    disc = scene_from_tables(tables(mb.examples.rolling_disc())).bodies[0]
    assert len(disc.points) >= 24 and np.ptp(np.linalg.norm(disc.points[-25:-1] - disc.origin, axis=1)) < 1e-12


def test_the_view_travels_with_a_body():
    """A body that flies beside another: the box around what is seen stays small."""
    m = mb.Model("convoy")
    for k in range(2):
        m.body(f"b{k}", mass=1.0, inertia=(1, 1, 1), at=(0, k, 0), velocity=(30.0, 0, 0))
    m.body("left behind", mass=1.0, inertia=(1, 1, 1), at=(0, 2, 0))
    traj = mb.simulate(m, t=[0.0, 0.5, 1.0], rtol=1e-6)
    still, along = motion(traj).data, motion(traj, follow="b0").data
    assert still["follow"] == -1 and along["follow"] == 0
    assert still["size"] > 30.0 and along["size"] < 3.0


def test_flexible_bodies_are_drawn_as_they_bend():
    """The line of a beam ends where its node is, at every frame; between outputs too."""
    b = mb.flexible.beam(2.0, mass=1.0, EI_flap=400.0, EI_edge=1600.0, modes=3, attach=["tip"])
    m = mb.Model("wing", gravity=(0, 0, -9.81))
    wing = m.flexible_body("wing", b, orientation=mb.rotation("z", 0.4))
    m.revolute("hinge", m.ground, wing.node("root"), at=(0, 0, 0), axis="y")
    traj = mb.simulate(m, t=0.6, rtol=1e-6)
    scene = motion(traj).data
    ((name, k, packed),) = scene["elastic"]
    n = scene["motion"]["count"]
    line = np.frombuffer(base64.b64decode(packed), dtype="<f4").reshape(n, k, 3)
    times = scene["motion"]["from"] + scene["motion"]["step"] * np.arange(n)
    fine = mb.simulate(m, t=times, rtol=1e-6)
    off = np.abs(line[:, -1] - fine.node_positions("wing")[:, b.nodes.index("tip")]).max()
    print(f"end of the line: {off:.1e} m off, bent by {np.abs(fine.modal('wing')).max():.2f}")
    assert name == "wing" and k > 10 and off < 1e-4
    assert np.abs(np.diff(line, 2, axis=1)).max() > 1e-3  # it bends
    assert motion(mb.simulate(mb.examples.slider_crank(), t=0.1)).data["elastic"] == []
