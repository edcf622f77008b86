"""Constraints given as functions in a model: names of motions, errors with their remedy, files, copies, redundancy by name."""

from __future__ import annotations

import pickle

import mbrs as mb
import numpy as np
import pytest
from constraint_models import ARM, PIVOT, ROD, bob, pendulum, skate

MOTIONS = ("bob.motion.x", "bob.motion.y", "bob.motion.z")


def saved_function(t, u):
    return (u + ARM) @ (u + ARM) - ROD**2


def saved_slopes(t, u):
    second = np.zeros((4, 4))
    second[1:, 1:] = 2 * np.eye(3)
    return np.r_[0, 2 * (u + ARM)], second


def test_motions_may_be_named_in_every_way():
    """Ports, their names, joints alone, with a coordinate, and in pairs; motions of one point share a free joint."""
    m, body = bob()
    swing = m.revolute(
        "swing", m.ground, m.body("arm", mass=1, inertia=(1, 1, 1), at=(2, 0, 0)), at=(2, 0.1, 0), axis=(1, 2, 3)
    )
    m.marker("eye", body, at=tuple(PIVOT))
    given = [body.motion("x"), "bob.motion.ry", "eye.motion.z", swing, ("swing", "rz"), "swing.rz", "swing"]
    for i, motion in enumerate(given):
        made = m.constraint(f"c{i}", lambda t, u: u**2 + 1e-3 * u, [motion])
        assert made.motions == [(made.model.joints[k].index, c) for k, c in made.motions]
    assert [j.name for j in m.joints] == ["swing", "bob motion", "eye motion"]
    assert [c.motions[0] for c in m.constraints] == [(1, 0), (1, 4), (2, 2), (0, 0), (0, 0), (0, 0), (0, 0)]
    assert repr(m["c0"]) == "<constraint 'c0' of 'pendulum'>" and len(m.constraints) == 7


WRONG = {
    "takes .t, u.": lambda m: m.constraint("rod", lambda u: u @ u, MOTIONS),
    "finite there": lambda m: m.constraint("rod", lambda t, u: np.sqrt(u @ u - 1.0), MOTIONS),
    "np.where": lambda m: m.constraint("rod", lambda t, u: u[0] if u[0] > 0 else u[1], MOTIONS),
    "constrains nothing": lambda m: m.constraint("rod", lambda t, u: [u[0], 2.0 - t], MOTIONS),
    "row 1, which": lambda m: m.velocity_constraint("rod", lambda t, u: [0.0, 0.0, 0.0], MOTIONS),
    "finite numbers": lambda m: m.constraint("rod", lambda t, u: [u[0], None], MOTIONS),
    "a list of motions": lambda m: m.constraint("rod", lambda t, u: u, "bob.motion.x"),
    r"got \[\]": lambda m: m.constraint("rod", lambda t, u: u, []),
    "a motion twice": lambda m: m.constraint("rod", lambda t, u: u, ["bob.motion.x", "bob.motion.x"]),
    "m.free": lambda m: m.constraint("rod", lambda t, u: u, ["bob.motion.(0.6,0,0.8)"]),
    "along x, y, z, rx": lambda m: m.constraint("rod", lambda t, u: u, ["bob.force.x"]),
    "did you mean 'bob'": lambda m: m.constraint("rod", lambda t, u: u, ["bib.motion.x"]),
    "no joint is called": lambda m: m.constraint("rod", lambda t, u: u, ["hinge.rz"]),
    "one for each motion": lambda m: m.velocity_constraint("rod", lambda t, u: [u[0]], MOTIONS[:2]),
    "d returns 2": lambda m: m.velocity_constraint(
        "rod", lambda t, u: [u[0], 1.0], MOTIONS[:2], d=lambda t, u: [0.0, t]
    ),
    "must be a function": lambda m: m.constraint("rod", 3.0, MOTIONS),
    "first, second": lambda m: m.constraint("rod", saved_function, MOTIONS, derivatives=lambda t, u: u),
    "shape": lambda m: m.constraint("rod", saved_function, MOTIONS, derivatives=lambda t, u: (u, u)),
    "already taken": lambda m: m.constraint("bob", lambda t, u: u, MOTIONS),
}


@pytest.mark.parametrize("remedy", WRONG)
def test_mistakes_are_named_and_leave_nothing_behind(remedy):
    m, _ = bob()
    before = str(m)
    with pytest.raises(mb.MbrsError, match=remedy) as found:
        WRONG[remedy](m)
    print(found.value)
    assert not m.constraints and not m.joints
    assert str(m) == before
    assert mb.System(m).dof == 6


def test_an_error_in_the_function_keeps_its_type():
    with pytest.raises(ZeroDivisionError) as found:
        bob()[0].constraint("rod", lambda t, u: 1 / 0, MOTIONS)
    assert "rod" in "".join(found.value.__notes__)


def test_files_copies_and_pickles(tmp_path):
    """The text of a function is in the file, and its parameters stay parameters."""
    one, two = pendulum("function"), skate("function", 4.0)
    for m in (one, two):
        m.save(tmp_path / "m.toml")
        back = [mb.Model.load(tmp_path / "m.toml"), m.copy(), pickle.loads(pickle.dumps(m))]
        expected = mb.modes(m, at=mb.equilibrium(m)).roots
        for other in back:
            assert np.array_equal(mb.modes(other, at=mb.equilibrium(other)).roots, expected)
        again = back[0].save(tmp_path / "again.toml").read_text()
        assert again == (tmp_path / "m.toml").read_text()
    for other in (mb.Model.load(one.save(tmp_path / "m.toml")), one.copy()):
        other.set({"L": 1.2 * ROD})
        place = mb.simulate(other, t=[0.0, 1e-3]).position("bob")[0]
        assert np.linalg.norm(place - PIVOT) == pytest.approx(1.2 * ROD, rel=1e-12)
    assert float(one.value("rod.p[0]")) == pytest.approx(ROD**2)


def test_functions_of_a_file_are_called_only_where_that_is_asked_for(tmp_path):
    m, _ = bob()
    m.constraint("rod", saved_function, MOTIONS, derivatives=saved_slopes)
    m.save(tmp_path / "m.toml")
    data = mb.Model.load(tmp_path / "m.toml")
    with pytest.raises(mb.ModelError, match=r"rod.*functions=True"):
        mb.System(data)
    assert mb.System(mb.Model.load(tmp_path / "m.toml", functions=True)).dof == 5


def test_repeated_rows_are_named():
    """The distance once more as a root of squares, another function with the same zeros."""
    m = pendulum("function")
    m.constraint("again", lambda t, u: np.hypot(np.hypot(u[0] + ARM[0], u[1] + ARM[1]), u[2] + ARM[2]) - ROD, MOTIONS)
    system = mb.System(m)
    assert system.dof == 5 and dict(system.redundant) == {"again": 1}
    assert "constraint 'again': 1 row of positions on bob motion.x" in str(system)
    a, b = (mb.modes(one, at=mb.equilibrium(one)).frequency for one in (m, pendulum("rod")))
    assert a == pytest.approx(b, rel=1e-11)
    assert mb.simulate(m, t=0.2).status == "finished"


def test_the_unit_of_a_function_does_not_decide():
    """A row in 1e9 or 1e-9 of its unit: ranks, roots and motions are the same."""
    m, frequency = pendulum("rod"), []
    for factor in (1e-9, 1.0, 1e9):
        m, body = bob()
        m.bushing("soft", m.ground, body, at=tuple(PIVOT + ARM), k=(20, 30, 10, 5, 7, 9))
        m.constraint("rod", lambda t, u, f=factor: f * ((u + ARM) @ (u + ARM) - ROD**2), MOTIONS)
        frequency.append(mb.modes(m, at=mb.equilibrium(m)).frequency)
        assert mb.simulate(m, t=0.1, rtol=1e-9).residual.max() < 1e-10
    assert frequency[0] == pytest.approx(frequency[1], rel=1e-10) and frequency[2] == pytest.approx(
        frequency[1], rel=1e-10
    )


@pytest.mark.parametrize(
    "wrong", [lambda t, u: (u + ARM) @ (u + ARM) + 1.0, lambda t, u: u[0] ** 2 + u[1] ** 2 + 1e-3 * np.cos(u[2])]
)
def test_rows_that_no_place_satisfies_are_named(wrong):
    m, _ = bob()
    m.constraint("odd", wrong, MOTIONS)
    with pytest.raises(mb.AssemblyError, match="'odd' cannot be satisfied"):
        mb.System(m)


def test_contradictions_are_named():
    m = pendulum("function")
    m.constraint("longer", lambda t, u: (u + ARM) @ (u + ARM) - 1.2 * ROD**2, MOTIONS)
    with pytest.raises(mb.AssemblyError, match=r"'(longer|rod)' cannot be satisfied"):
        mb.System(m)
