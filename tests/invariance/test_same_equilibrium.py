"""Equilibrium: bodies rest at the same places, joints carry the same forces."""

import changes
import mbrs as mb
import numpy as np
import pytest
import zoo
from random_models import random_tree
from zoo import changed, close, drawn, rest


@pytest.mark.parametrize(("name", "change"), list(zoo.cases()))
def test_places(name, change):
    change, model = changed(name, change)
    found, expected = zoo.at_rest(model), rest(name)
    assert found.status == expected.status == "converged"
    for body in zoo.bodies(drawn(name)):
        back = change.points_back(found.position(change.rename(body)))
        assert np.linalg.norm(back - expected.position(body)) <= zoo.allowed(change, 1e-11, 100.0)


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


@pytest.mark.parametrize("seed", range(12))
def test_models_at_a_site_have_their_equilibria(seed):
    """10 000 lengths away, where rounding of places unbalances forces by 1e-11 of them."""
    m = random_tree(np.random.default_rng([14, seed]), n=3, followers=seed % 2 == 0)
    change = changes.turned(np.random.default_rng(seed), distance=1e4)
    there = mb.equilibrium(change(m))
    assert there.status in ("converged", "unresolved") and np.all(np.isfinite(there.position(m.bodies[-1].name)))


def test_close_can_fail():
    with pytest.raises(AssertionError):
        close([1.0, 2.0], [1.0, 2.0 + 1e-8], 1e-9)
