"""Random structures: joints repeated, models that are locked, without freedoms or without bodies, drives, knife edges. Nothing panics."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import MbrsError
from random_models import N_FREE, TREE_JOINTS, add_body, random_quaternion

pytestmark = pytest.mark.filterwarnings("ignore")


def add_random_joint(m, rng, name, ends, at):
    """A joint, some of them sprung, and up to two that repeat it or lock it; a drive of some."""
    kind = str(rng.choice(TREE_JOINTS))
    given = {"at": at, "orientation": random_quaternion(rng)}
    sprung = {"k": rng.random(N_FREE[kind]) * rng.choice([0.0, 1.0, 1e9])} if rng.random() < 0.7 else {}
    joint = getattr(m, kind)(name, *ends, **given, **(sprung if N_FREE[kind] else {}))
    for again in range(int(rng.integers(3)) if rng.random() < 0.4 else 0):
        if rng.random() < 0.5:
            given["orientation"] = random_quaternion(rng)
        getattr(m, kind)(f"{name}_again{again}", *ends, **given)
    if kind in ("revolute", "prismatic") and rng.random() < 0.2:
        m.drive(f"{name}_drive", joint, lambda t: 0.1 * np.sin(3.0 * t))


def random_structure(rng):
    """Up to three bodies, joined at random, some of them to nothing; closed by up to two joints of any kind."""
    m = mb.Model("structure", gravity=9.81 * rng.normal(size=3) * (rng.random() < 0.7))
    bodies, places = [m.ground], [np.zeros(3)]
    for i in range(int(rng.integers(4))):
        j = int(rng.integers(len(bodies)))
        here = places[j] + rng.normal(size=3) * 10 ** rng.uniform(-2, 2)
        b = add_body(m, rng, f"b{i}", here)
        if rng.random() < 0.9:
            add_random_joint(m, rng, f"j{i}", (bodies[j], b), 0.5 * (places[j] + here))
        bodies.append(b)
        places.append(here)
    for i in range(int(rng.integers(3)) if len(bodies) > 1 else 0):
        a, b = rng.choice(len(bodies), 2, replace=False)
        at, kind = places[a] + rng.normal(size=3), str(rng.choice(("distance", "knife_edge", *TREE_JOINTS[:-1])))
        if kind == "knife_edge":
            m.knife_edge(f"c{i}", m.ground, bodies[max(b, 1)], at=at, axis=rng.normal(size=3))
        elif kind == "distance":
            m.distance(f"c{i}", bodies[a], bodies[b], at=(at, places[b] - 0.4))
        else:
            getattr(m, kind)(f"c{i}", bodies[a], bodies[b], at=at, orientation=random_quaternion(rng))
    return m, bodies[-1]


def analyses(m, last):
    yield lambda: mb.equilibrium(m).reactions
    yield lambda: mb.linearize(m)
    yield lambda: mb.modes(m)
    yield lambda: mb.modes(m, n=1)
    if last is not m.ground:
        yield lambda: mb.frf(m, last.force("z"), last.motion("z"), frequency=[0.0, 1.0])
        yield lambda: mb.state_space(m, last.force("z"), last.motion("z"))
    for method in ("explicit", "radau", "bdf", "generalized-alpha"):
        yield lambda method=method: mb.simulate(m, [0.0, 0.01], method=method, rtol=1e-4)


@pytest.mark.parametrize("part", [pytest.param(n, marks=pytest.mark.slow if n > 1 else ()) for n in range(20)])
def test_random_structures(part):
    """Each analysis answers, or refuses in words."""
    done, refused = 0, 0
    for seed in range(15):
        m, last = random_structure(np.random.default_rng([71, part, seed]))
        for run in analyses(m, last):
            try:
                run()
                done += 1
            except MbrsError as error:
                assert "internal error" not in str(error), f"{part}, {seed}: {error}"
                refused += 1
    print(f"{done} answers, {refused} refusals")
    assert done > 40
