"""Loads per length along a flexible body: resultants, deflections against closed forms, bad input."""

from __future__ import annotations

from functools import cache

import mbrs as mb
import numpy as np
import pytest
from mbrs import reference as ref
from mbrs.model.tables import tables
from mbrs.reference.kinematics import moving

L, EI = 2.0, 4000.0


@cache
def beam(parts=1):
    """With a node at the end of each part."""
    inner = {f"n{i}": L * i / parts for i in range(1, parts)}
    return mb.flexible.beam(L, mass=1.0, EI_flap=EI, EI_edge=4 * EI, modes=10, nodes=inner or None)


def wing(parts=1, orientation=None):
    """A uniform cantilever; x outwards."""
    m = mb.Model("wing")
    f = m.flexible_body("wing", beam(parts), orientation=orientation)
    m.fixed("clamp", m.ground, f.node("root"), at=(0, 0, 0))
    m.marker("end", f.node("tip"))
    return m, f


def tip(m):
    """Displacement of the tip at rest, world."""
    sys = ref.System(tables(m))
    state, _, _ = ref.equilibrium(sys)
    i = [b.name for b in sys.bodies].index("wing.tip")
    return state.r[i] - sys.bodies[i].centre


def test_uniform_and_triangular_loads_bend_as_the_books_say():
    """w L^4 / (8 EI); w L^4 / (30 EI) for a load that falls from w at the root to zero at the tip."""
    w = 3.0
    for ends, factor in (((w, w), 1 / 8), ((w, 0.0), 1 / 30)):
        m, f = wing()
        made = m.section_load(f, [0.0, L], [[0, 0, e] for e in ends])
        assert made.force == pytest.approx([0, 0, 0.5 * sum(ends) * L])
        moment = -(ends[0] * L**2 / 6 + ends[1] * L**2 / 3)  # -int x f dx about y
        assert made.moment == pytest.approx([0, moment, 0])
        moved = tip(m)
        assert moved[1:] == pytest.approx([0, factor * w * L**4 / EI], rel=1e-4)
        # the tip is drawn back by 1/2 int w'^2 dx
        x = np.linspace(0.0, L, 2001)
        p = np.poly1d([(ends[1] - ends[0]) / L, ends[0]])
        shear = p.integ() - p.integ()(L)  # EI w''' = int_L^x p
        bending = shear.integ() - shear.integ()(L)
        slope = bending.integ()(x) / EI
        assert moved[0] == pytest.approx(-0.5 * np.trapezoid(slope**2, x), rel=1e-3)


def test_a_load_in_parts_is_the_load():
    """Stations between the beam's own nodes; parts that add up give the same modal forces."""
    whole, part = wing()[0], wing()[0]
    one = whole.section_load("wing", [0.0, 0.33, 1.21, L], [[1, 2, 3.0], [0, 1, 0], [2, 2, 2], [1, 0, 1]])
    other = [
        part.section_load("wing", [0.0, 0.33], [[1, 2, 3.0], [0, 1, 0]], name="a"),
        part.section_load("wing", [0.33, 1.21], [[0, 1, 0], [2, 2, 2]], name="b"),
        part.section_load("wing", [1.21, L], [[2, 2, 2], [1, 0, 1]], name="c"),
    ]
    for name in ("force", "moment", "modal"):
        total = sum(getattr(o, name) for o in other)
        assert getattr(one, name) == pytest.approx(total, rel=1e-9, abs=1e-9), name


def test_moments_per_length():
    """m per length about y bends as m L^3 / (3 EI) at the tip: int m (x) x^2/2... = m L^3 / 3."""
    m, f = wing()
    m.section_load(f, [0.0, L], np.array([[0, 0, 0, 0, -5.0, 0]] * 2))
    assert tip(m)[2] == pytest.approx(5.0 * L**3 / (3 * EI), rel=1e-3)


def test_body_axes_turn_with_the_body():
    turned = mb.rotation((1, 2, 3), 1.1)
    straight, rotated = wing(), wing(orientation=turned)
    for m, f in (straight, rotated):
        m.section_load(f, [0.0, L], [[0, 1.0, 2.0], [0, 0.5, 3.0]])
    R = ref.so3.from_quaternion(turned)
    assert tip(rotated[0]) == pytest.approx(R @ tip(straight[0]), rel=1e-9)


def test_world_axes_go_through_the_nodes():
    """The same resultants whatever the nodes; the deflection comes with their number."""
    errors = []
    for n in (4, 8):
        m, f = wing(n, orientation=mb.rotation("y", 0.3))
        load = np.array([np.sin(0.3), 0, np.cos(0.3)]) * 3.0
        made = m.section_load(f, [0.0, L], [load, load], frame="world")
        assert made.force == pytest.approx(load * L) and made.modal is None
        errors.append(abs(np.linalg.norm(tip(m)) / (3.0 * L**4 / (8 * EI)) - 1))
    assert errors[1] < errors[0] / 3 and errors[1] < 0.01


def test_tables_over_time_in_the_core():
    """A step of load, then none: the modal force follows its table; core and reference at several times."""
    m, f = wing()
    times = np.linspace(0.0, 0.4, 9)
    made = m.section_load(
        f, [0.5, L], np.sin(7 * times)[:, None, None] * np.array([[0, 1.0, 4.0], [0, 0, 2.0]]), times=times
    )
    assert made.force.shape == (9, 3) and made.modal.shape == (9, 10)
    traj = mb.simulate(m, t=np.linspace(0, 0.4, 21), rtol=1e-9)
    sys = ref.System(tables(m))
    for t in (0.05, 0.21):
        sys.t = t
        Q = ref.dynamics.loads(sys, moving(ref.drawn_state(sys), np.zeros(6 * sys.nb))).value[0]
        from scipy.interpolate import CubicSpline

        exact = CubicSpline(times, made.modal, bc_type="natural")(t)
        assert sys.flexible[0].held(Q.reshape(-1, 6)[:, :3]) == pytest.approx(exact, rel=1e-9, abs=1e-9)
    # linear modes: each coordinate by itself
    from scipy.integrate import solve_ivp

    k = np.diag(f.modal.K)
    load = CubicSpline(times, made.modal, bc_type="natural")
    right = lambda t, y: np.r_[y[10:], load(t) - k * y[:10]]  # noqa: E731
    exact = solve_ivp(right, (0, 0.4), np.zeros(20), rtol=1e-10, atol=1e-13).y[:10, -1]
    assert traj.modal("wing")[-1] == pytest.approx(exact, rel=1e-4, abs=1e-4 * np.abs(exact).max())


BAD = {
    "needs a flexible body": lambda m, f: m.section_load("clamp", [0, 1], np.zeros((2, 3))),
    "stations must increase": lambda m, f: m.section_load(f, [1, 0], np.zeros((2, 3))),
    "must have the shape": lambda m, f: m.section_load(f, [0, 1], np.zeros((3, 3))),
    "give times=": lambda m, f: m.section_load(f, [0, 1], np.zeros((4, 2, 3))),
    "times must increase": lambda m, f: m.section_load(f, [0, 1], np.zeros((2, 2, 3)), times=[1.0, 0.0]),
    "must lie on the body": lambda m, f: m.section_load(f, [0, 3], np.ones((2, 3))),
    "NaN": lambda m, f: m.section_load(f, [0, 1], np.full((2, 3), np.nan)),
    "must hold numbers": lambda m, f: m.section_load(f, [0, 1], "wind"),
    "frame must be 'body' or 'world'": lambda m, f: m.section_load(f, [0, 1], np.ones((2, 3)), frame="blade"),
    "span all stations": lambda m, f: m.section_load(floating(m), [0, 1], np.ones((2, 3)), frame="world"),
    "kind= is": lambda m, f: m.section_load(f, [0, 1], np.ones((2, 2, 3)), times=[0.0, 1.0], kind="quintic"),
}


def floating(m):
    """A flexible body whose nodes leave out a part of its line."""
    from dataclasses import replace

    b = mb.flexible.beam(L, mass=1.0, EI_flap=EI, EI_edge=EI, modes=2)
    kept = {part: getattr(b, part)[1:] for part in ("node_position", "node_shape", "node_quadratic")}
    short = replace(b, nodes=("tip",), **kept)
    return m.flexible_body("short", short)


@pytest.mark.parametrize("words", BAD)
def test_bad_input_changes_nothing(words):
    m, f = wing()
    before = len(m.loads)
    with pytest.raises(mb.ModelError, match=words.replace("(", r"\(")):
        BAD[words](m, f)
    assert len(m.loads) == before and len(m.motions) == 0


def test_saved_and_copied(tmp_path):
    """Loads on the frame and on modal coordinates come back from a file and from a pickle."""
    import pickle

    from scenes import same_tables

    m, f = wing()
    m.section_load(f, [0.5, L], np.ones((3, 2, 3)) * np.arange(1, 4)[:, None, None], times=[0.0, 0.2, 0.4])
    m.modal_force("push", f, mode=2, value=mb.Sine(3.0, frequency=2.0))
    m.force("hold", f, value=(1.0, 2.0, 3.0), on="frame", at=(0.3, 0.1, 0.0))
    m.torque("turn", f, value=(0.0, 2.0, 3.0), on="frame")
    again = mb.Model.load(m.save(tmp_path / "wing.toml"))
    assert same_tables(tables(again), tables(m)) == []
    assert same_tables(tables(pickle.loads(pickle.dumps(m))), tables(m)) == []
    assert m.value("push.q_amplitude") == 3.0 and m.value("hold.value").tolist() == [1.0, 2.0, 3.0]


def test_loads_on_frame_and_mode_say_what_is_wrong():
    m, f = wing()
    for words, call in {
        "mode must be 1 to 10": lambda: m.modal_force("a", f, mode=11, value=1.0),
        "needs a flexible body": lambda: m.modal_force("a", "clamp", mode=1, value=1.0),
        "on must be 'frame'": lambda: m.force("a", f, value=(1, 0, 0), on="node"),
    }.items():
        with pytest.raises(mb.ModelError, match=words):
            call()
    assert not m.loads


def test_a_force_on_the_frame_moves_no_shape():
    """Held at the root, the rod stays straight whatever pulls at its frame, and bends by value / K of a modal force."""
    m, f = wing()
    m.force("pull", f, value=(10.0, 20.0, 30.0), on="frame")
    m.modal_force("push", f, mode=1, value=6.0)
    eq = mb.equilibrium(m)
    sys = ref.System(tables(m))
    state = ref.equilibrium(sys)[0]
    q = sys.flexible[0].held(state.r)
    assert q == pytest.approx(np.r_[6.0 / f.modal.K[0, 0], np.zeros(9)], abs=1e-9)
    assert np.linalg.norm(eq.poses["position"][1]) == pytest.approx(np.linalg.norm(state.r[1]), rel=1e-9)
