"""Long ladders: closed loops by the hundred, of which the modes, the mobility and the redundant constraints are known."""

from __future__ import annotations

import warnings

import jitter
import mbrs as mb
import numpy as np
import pytest
from mbrs._lib.rotations import quaternion_matrix
from problems import LADDER_TURN, LADDERS, ladder


@pytest.mark.parametrize("numbers", LADDERS, ids=("short", "long"))
@pytest.mark.parametrize(
    ("n", "order"), [(9, True), (160, False), (270, True), pytest.param(1600, False, marks=pytest.mark.slow)]
)
def test_modes_of_ladders(n, order, numbers):
    """Dense and sparse routes; the last has more rows and columns of loops than a dense matrix of 30 000 000 entries."""
    problem = ladder(n, order=order, **numbers)
    with warnings.catch_warnings():
        # nothing carries force and no rank is doubtful in a drawing that is right to rounding
        warnings.simplefilter("error" if jitter.seed() is None else "ignore", mb.MbrsWarning)
        r = mb.modes(problem.model, n=8)
    w = problem.answer["omega"][:8]
    print(r.stats.route, np.abs(r.omega / w - 1).max())
    # the drawing itself is right to the rounding of its longest coordinate over the length of a layer
    assert np.allclose(r.omega, w, rtol=(1e-13 + jitter.level()) * (10 + n)) and r.status == "converged"


@pytest.mark.some(1)
@pytest.mark.parametrize("numbers", LADDERS, ids=("short", "long"))
def test_estimates_of_ladders(numbers):
    """Rounding of places and of the rows of joints, which grows with the height: no estimate is below the error, none absurd."""
    for n in (3, 5, 9, 20, 60, 160, 400):
        problem = ladder(n, **numbers)
        r = mb.modes(problem.model, n=min(n, 8))
        error = np.abs(r.omega / problem.answer["omega"][:8] - 1)
        print(f"{n} layers, {r.stats.route}: error {error.max():.1e}, estimate {r.error.max():.1e}")
        assert np.all(error < r.error + 3 * jitter.level() * n) and r.error.max() < 1e3 * error.max()


@pytest.mark.parametrize(("n", "order"), [(7, False), (130, True), pytest.param(1600, False, marks=pytest.mark.slow)])
def test_mobility_of_ladders(n, order):
    system = mb.System(ladder(n, order=order, **LADDERS[1]).model)
    assert system.dof == n and len(system.loops) == n
    assert sum(system.redundant.values()) == 3 * n and set(system.redundant.values()) == {3}
    around = {frozenset(loop.bodies) for loop in system.loops}
    rungs = ["ground", *(f"R{i}" for i in range(1, n + 1))]
    assert around == {frozenset((rungs[i - 1], f"S{i},0", f"S{i},1", rungs[i])) for i in range(1, n + 1)}


@pytest.mark.parametrize("n", [11, 150])
def test_mobility_of_ladders_of_balls(n):
    """Three rows for each of N loops among 9 N coordinates, none of them redundant."""
    system = mb.System(mb.examples.ladder(n, joint="spherical"))
    assert system.dof == 6 * n and not system.redundant and system.rank == 3 * n


def test_a_flat_layer_is_found_among_many():
    """One layer drawn as a flat parallelogram, where its motion branches: the message names its joints and no others."""
    m = ladder(60, **LADDERS[0]).model
    R = quaternion_matrix(LADDER_TURN)
    top = 60 * LADDERS[0]["length"]

    def point(x: float) -> tuple[float, ...]:
        return tuple(R @ np.array([x, top, 0.0]))

    axis = tuple(R[:, 2])
    before, names = m["R60"], []
    for k, (x0, x1) in enumerate([(0.0, 1.0), (1.0, 3.0), (3.0, 2.0)]):
        b = m.body(f"flat{k}", mass=1.0, inertia=(0.1,) * 3, at=point((x0 + x1) / 2))
        names.append(f"flat joint {k}")
        m.revolute(names[-1], before, b, at=point(x0), axis=axis)
        before = b
    m.revolute("flat joint 3", before, m["R60"], at=point(2.0), axis=axis)
    with pytest.raises(mb.SingularError, match="singular pose") as caught:
        mb.System(m)
    assert "flat joint" in str(caught.value) and "'a7,1'" not in str(caught.value)
    with pytest.raises(mb.SingularError, match="singular pose"):
        mb.modes(m, n=3)
