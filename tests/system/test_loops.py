"""Closed loops: mobility, redundancy, assembly, singular poses and loops that cannot close."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import problems
import pytest
from agreement import advanced, difference, drawn, reference_state, show, spinning
from mbrs import reference as ref
from mbrs.model.tables import tables
from mbrs.system.compiled import compiled
from mbrs.system.state import State
from random_models import random_loop

TOLERANCE = 1e-10


@pytest.mark.some(1)
@pytest.mark.parametrize("joint, per_layer", [("revolute", 1), ("cylindrical", 4), ("spherical", 6)])
def test_ladders(joint, per_layer):
    """Degrees of freedom and rank of docs/theory.md (23.4): N, 4N and 6N for N layers, drawn and bent."""
    layers = 3
    m = mb.examples.ladder(layers, joint)
    system = mb.System(m)
    assert system.dof == per_layer * layers
    assert (system.n_rows, system.rank) == {"revolute": (15, 6), "cylindrical": (12, 6), "spherical": (9, 9)}[joint]
    assert sum(system.redundant.values()) == system.n_rows - system.rank
    rng = np.random.default_rng(0)
    state = advanced(m, rng, 0.2)
    worst = difference(m, state)
    moving = difference(m, spinning(m, state, rng, 0.5))
    show(f"bent ladder {joint}", worst)
    show(f"moving ladder {joint}", moving)
    assert max(*worst.values(), *moving.values()) < TOLERANCE


def test_a_ladder_of_sliders_moves_along_their_common_axis():
    """All prismatic joints along z: every body slides by itself, the loops constrain nothing that the tree does not."""
    system = mb.System(mb.examples.ladder(2, "prismatic"))
    assert (system.dof, system.rank, system.n_rows, sum(system.redundant.values())) == (6, 0, 10, 10)


def test_bricard_moves():
    """Six hinges in a loop: one redundant constraint and one degree of freedom, over a large part of its motion."""
    p = problems.bricard()
    system = mb.System(p.model)
    assert (system.dof, system.rank, sum(system.redundant.values())) == (1, 4, 1)
    m, state, gaps, found = p.model, drawn(p.model), [], []
    angles = []
    before = None
    for _ in range(12):
        # which coordinate is the independent one may change on the way: go on in the same sense
        along = compiled(m).linearize(state.q, np.zeros(0), [])["T"][:, 0]
        step = 0.15 / np.abs(along).max() * (1.0 if before is None or before @ along > 0.0 else -1.0)
        before = along * np.sign(step)
        state = State(compiled(m).advance(state.q, np.array([step])), np.zeros(0))
        sys = ref.System(tables(m))
        pose = reference_state(m, state, sys)
        gaps.append(np.abs(ref.assembly.constraint_values(sys, pose, sys.cut)).max())
        found.append(max(difference(m, state).values()))
        angles.append(pose.R[0])
    turned = np.arccos((np.trace(angles[-1]) - 1) / 2)
    show("Bricard", {"gap": max(gaps), "difference": max(found), "turned (rad)": turned})
    assert max(gaps) < 1e-12
    assert max(found) < 1e-9
    assert turned > 1.0


def test_bricard_at_equilibrium_and_in_motion():
    p = problems.bricard()
    rng = np.random.default_rng(1)
    state = advanced(p.model, rng, 0.3)
    worst = difference(p.model, spinning(p.model, state, rng, 0.4))
    show("moving Bricard", worst)
    assert max(worst.values()) < 1e-9
    modes = mb.modes(p.model)
    assert modes.n == 1 and modes.kind[0] == "vibration"


def test_spatial_hinges_of_a_planar_loop():
    """A four-bar: three of the six cut equations follow from the others, by name."""
    system = mb.System(mb.examples.four_bar())
    assert (system.dof, system.rank, sum(system.redundant.values())) == (1, 2, 3)
    assert set(system.redundant) == {"C"} or set(system.redundant) == {"D"} or len(system.redundant) == 1
    assert "redundant constraints: 3 of 5" in str(system)
    (loop,) = system.loops
    assert sorted(loop.bodies) == ["coupler", "crank", "ground", "rocker"]


@pytest.mark.parametrize("reverse", [False, True])
def test_hanging_four_bar(reverse):
    p = problems.hanging_four_bar(reverse)
    error = abs(mb.modes(p.model).frequency[0] - p.answer["frequency"][0])
    print(f"hanging four-bar, reversed {reverse}: error {error:.1e} Hz")
    assert error < 1e-12
    assert round(float(p.answer["frequency"][0]), 6) == 0.546066


def test_flat_parallelogram_is_a_singular_pose():
    """It can go on as a parallelogram or cross over: an error that says so, not one of the two at random."""
    for action in (mb.System, mb.linearize, mb.modes, mb.equilibrium):
        with pytest.raises(mb.SingularError, match=r"singular pose.*draw it slightly off"):
            action(problems.parallelogram(0.0, gravity=False).model)


def test_parallelogram_near_its_flat_pose():
    """Slightly off it is an ordinary mechanism, however small the height that rounding can tell from zero."""
    for height in (0.5, 1e-2, 1e-4):
        m = problems.parallelogram(height, gravity=False).model
        assert mb.System(m).dof == 1, height
        worst = max(difference(m, drawn(m)).values())
        print(f"parallelogram of height {height:g}: {worst:.1e}")
        assert worst < 1e-8


def test_two_point_joints_are_brought_together():
    """A slider-crank drawn with gaps: the core closes it as the reference does, and the points meet."""
    m = mb.Model("slider-crank")
    a = problems.rod(m, "crank", (0.25, 0.4, 0), 1.0, angle=1.0)
    b = problems.rod(m, "rod", (1.2, 0.4, 0.1), 2.0, angle=-0.4)
    c = m.body("slider", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(2.2, 0.05, 0))
    tip = np.array([0.25, 0.4, 0]) + 0.5 * np.array([np.cos(1.0), np.sin(1.0), 0])
    start = np.array([1.2, 0.4, 0.1]) - np.array([np.cos(0.4), -np.sin(0.4), 0])
    end = np.array([1.2, 0.4, 0.1]) + np.array([np.cos(0.4), -np.sin(0.4), 0])
    m.revolute("A", m.ground, a, at=((0, 0, 0), (-0.02, -0.02, 0)), axis="z")
    m.revolute("B", a, b, at=(tip, start), axis="z")
    m.spherical("C", b, c, at=(end, (2.2, 0.05, 0)))
    m.prismatic("D", m.ground, c, at=((0, 0, 0), (2.2, 0.05, 0)), axis="x")
    lin = mb.linearize(m)
    assert lin.n == 1
    sys = ref.System(tables(m))
    ours, theirs = reference_state(m, drawn(m), sys), ref.assemble(sys, ref.drawn_state(sys))
    gap = np.abs(ref.assembly.constraint_values(sys, ours, sys.joints)).max()
    apart = max(np.abs(ours.r - theirs.r).max(), np.abs(ours.R - theirs.R).max())
    show("slider-crank", {"gap": gap, "apart": apart})
    assert gap < 1e-13 and apart < 1e-11


def test_random_loops_drawn_with_gaps():
    """Cut joints between two points half a metre apart: closed to rounding, the same in both."""
    worst = {"gap": 0.0, "apart": 0.0}
    for seed in range(6):
        rng = np.random.default_rng([20, seed])
        m = random_loop(rng, ("spherical", "universal", "cylindrical", "spherical"), forces=False)
        for joint in m.joints:
            m.set({f"{joint.name}.at_b": m.value(f"{joint.name}.at_b") + 0.1 * rng.normal(size=3)})
        sys = ref.System(tables(m))
        ours, theirs = reference_state(m, drawn(m), sys), ref.assemble(sys, ref.drawn_state(sys))
        worst["gap"] = max(worst["gap"], np.abs(ref.assembly.constraint_values(sys, ours, sys.joints)).max())
        worst["apart"] = max(worst["apart"], np.abs(ours.r - theirs.r).max())
    show("random gaps", worst)
    assert worst["gap"] < 1e-12 and worst["apart"] < 1e-10


@pytest.mark.parametrize("side", [1, -1])
def test_first_guesses_choose_the_branch(side):
    """Two rods of 1 m drawn along a line between hinges 1.2 m apart: `pose=` says whether the apex goes up or down."""
    angle = side * np.arccos(0.6)
    m = mb.Model("apex")
    given = {"mass": 1.0, "inertia": (1e-3, 1 / 12, 1 / 12)}
    a = m.body("a", at=(0.5, 0, 0), pose=((0.3, 0.4 * side, 0), mb.rotation("z", angle)), **given)
    b = m.body("b", at=(1.5, 0, 0), pose=((0.9, 0.4 * side, 0), mb.rotation("z", -angle)), **given)
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("B", a, b, at=(1, 0, 0), axis="z")
    m.revolute("C", b, m.ground, at=((2, 0, 0), (1.2, 0, 0)), axis="z")
    position = mb.System(m) and reference_state(m, drawn(m)).r
    error = np.abs(position - [[0.3, 0.4 * side, 0], [0.9, 0.4 * side, 0]]).max()
    print(f"apex {side}: error {error:.1e}")
    assert error < 1e-12


def test_a_loop_that_cannot_close_is_an_error_with_the_gap():
    """Two rods of 1 m to supports 2.5 m apart: half a metre is missing."""
    m = mb.Model("short")
    a = problems.rod(m, "a", (0.5, 0, 0), 1.0)
    b = problems.rod(m, "b", (1.5, 0, 0), 1.0)
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("B", a, b, at=(1, 0, 0), axis="z")
    m.revolute("C", b, m.ground, at=((2, 0, 0), (2.5, 0, 0)), axis="z")
    with pytest.raises(mb.AssemblyError, match=r"cannot close at joint '[ABC]'.*0\.5\d* m"):
        mb.System(m)


def test_conflicting_joints_are_refused_with_the_gap():
    """A body welded in two places that do not agree."""
    m = mb.Model("twice welded")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.fixed("one", m.ground, b, at=(0, 0, 0))
    m.fixed("two", m.ground, b, at=((1, 0, 0), (1, 0.01, 0)))
    with pytest.raises(mb.AssemblyError, match=r"'two'.*0\.01\d* m"):
        mb.linearize(m)


def test_a_loop_of_hinges_and_a_weld_that_disagree():
    m = mb.Model("crossed")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    c = m.body("c", mass=1.0, inertia=(1, 1, 1), at=(1, 0, 0))
    m.revolute("one", m.ground, b, at=(0, 0, 0), axis="z")
    m.revolute("two", b, c, at=(1, 0, 0), axis="z")
    m.fixed("three", m.ground, c, at=((1, 0, 0), (1.0, 0.0, 0.02)))
    with pytest.raises(mb.AssemblyError, match=r"'(two|three)'.*0\.02\d* m"):
        mb.linearize(m)


def test_a_rigid_loop_is_no_mechanism_but_no_error_either():
    """Three hinges in a triangle: zero degrees of freedom."""
    m = mb.Model("triangle")
    a = problems.rod(m, "a", (0.5, 0, 0), 1.0)
    b = m.body("b", mass=1.0, inertia=(0.1, 0.1, 0.1), at=(0.75, 0.5, 0))
    m.revolute("A", m.ground, a, at=(0, 0, 0), axis="z")
    m.revolute("B", a, b, at=(1, 0, 0), axis="z")
    m.revolute("C", b, m.ground, at=(0.5, 1, 0), axis="z")
    system = mb.System(m)
    assert (system.dof, system.coordinates) == (0, ())
    lin = mb.linearize(m)
    assert lin.M.shape == (0, 0)
    eq = mb.equilibrium(m)
    assert eq.stable and eq.residual == 0.0
    with pytest.raises(mb.ModelError, match="no degrees of freedom"):
        mb.modes(m)


def test_distance_joints_alone():
    """A body on six rods, a hexapod of fixed lengths, does not move; on five it does."""
    for n, dof in ((6, 0), (5, 1)):
        m = mb.Model("rods")
        p = m.body("p", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0.1))
        for i, (a, b) in enumerate(mb.examples.cubic_hexapod_points(edge=0.2, centre=(0, 0, 0.1))[:n]):
            m.distance(f"rod{i}", m.ground, p, at=(a, b))
        assert mb.System(m).dof == dof
        if dof:
            worst = difference(m, advanced(m, np.random.default_rng(0), 0.05))
            show("five rods", worst)
            assert max(worst.values()) < TOLERANCE


@pytest.mark.parametrize(("longer", "moves"), [(3e-6, True), (3e-4, False)])
def test_a_third_parallel_link_may_be_longer_by_thirty_tolerances(longer, moves):
    """A parallelogram with a link too many, drawn longer by thirty and by three thousand times the tolerance."""
    m = mb.Model("three")
    links = [m.body(f"link{i}", mass=1.0, inertia=(0.1,) * 3, at=(i, 0.5, 0)) for i in range(3)]
    plate = m.body("plate", mass=1.0, inertia=(1, 1, 1), at=(1, 1, 0))
    for i, link in enumerate(links):
        m.revolute(f"lower{i}", m.ground, link, at=(i, 0, 0), axis="z")
        m.revolute(f"upper{i}", link, plate, at=(i, 1 + longer * (i == 1), 0), axis="z")
    if moves:
        assert mb.linearize(m).K.shape == (1, 1)
    else:
        with pytest.raises(mb.SingularError, match=r"shaky|singular pose"):
            mb.linearize(m)
