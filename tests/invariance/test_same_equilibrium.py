"""Equilibrium: bodies rest at the same places, joints carry the same forces."""

import changes
import jitter
import mbrs as mb
import numpy as np
import pytest
import zoo
from random_models import random_tree
from zoo import changed, close, drawn, rest


@pytest.mark.some(16)
@pytest.mark.parametrize(("name", "change"), list(zoo.cases()))
def test_places(name, change):
    change, model = changed(name, change)
    found, expected = zoo.at_rest(model), rest(name)
    assert found.status == expected.status == "converged"
    for body in zoo.bodies(drawn(name)):
        back = change.points_back(found.position(change.rename(body)))
        assert np.linalg.norm(back - expected.position(body)) <= zoo.allowed(change, 1e-11, 100.0)


@pytest.mark.some(12)
@pytest.mark.parametrize(
    ("name", "change"),
    list(zoo.cases(("tree", "chain", "loop"), [c for c in zoo.CHANGES if c not in ("split", "repeated")])),
)
def test_reactions(name, change):
    change, model = changed(name, change)
    found, expected = zoo.at_rest(model).reactions, rest(name).reactions
    size = max(np.linalg.norm(wrench[:3]) for wrench in expected.values())
    for joint, wrench in expected.items():
        back = change.vectors_back(found[change.rename(joint)][:3], 1, 1, -2)
        assert np.linalg.norm(back - wrench[:3]) <= zoo.allowed(change, 1e-10, 1e3) * size
        back = change.vectors_back(found[change.rename(joint)][3:], 2, 1, -2)
        assert np.linalg.norm(back - wrench[3:]) <= zoo.allowed(change, 1e-10, 1e3) * size


@pytest.mark.some(4)
@pytest.mark.parametrize("seed", range(12))
def test_models_at_a_site_have_their_equilibria(seed):
    """10 000 lengths away, where rounding of places unbalances forces by 1e-11 of them: the same places, within estimates."""
    m = random_tree(np.random.default_rng([14, seed]), n=3, followers=seed % 2 == 0)
    # both turned alike: angles of torsion springs depend on how the world axes lie
    near, far = (changes.turned(np.random.default_rng(seed), distance=d) for d in (0.0, 1e4))
    here, there = mb.equilibrium(near(m)), mb.equilibrium(far(m))
    length = mb.System(m).characteristic_length
    first = m.bodies[0].name
    off = 0.0
    for b in m.bodies:
        moved = [r.position(b.name) - r.position(first) for r in (here, there)]
        off = max(off, np.linalg.norm(moved[1] - moved[0]) / length)
    print(f"{there.status}: relative places differ by {off:.1e} lengths, estimates {here.error:.1e}, {there.error:.1e}")
    assert here.status == "converged" and there.status in ("converged", "unresolved")
    # what is read and drawn there has digits of this size
    digit = np.spacing(1e4 * length) / length
    assert off <= here.error + there.error + 2 * digit + 10 * jitter.level() * 1e4 and there.error < 10 * digit


def test_close_can_fail():
    with pytest.raises(AssertionError):
        close([1.0, 2.0], [1.0, 2.0 + 1e-8], 1e-9)
