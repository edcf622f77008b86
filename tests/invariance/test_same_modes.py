"""Modes at equilibrium: the same roots, an added part has its own."""

import mbrs as mb
import numpy as np
import pytest
import zoo
from zoo import changed, rest


def roots(modes):
    """All roots by size, then by phase."""
    s = np.asarray(modes.roots)
    return s[np.lexsort((s.imag, np.round(np.log(np.abs(s)), 6)))]


def with_part(expected, change_name):
    w = zoo.PARTS.get(change_name)
    if w is None:
        return expected
    s = np.concatenate([expected, [1j * w, -1j * w]])
    return s[np.lexsort((s.imag, np.round(np.log(np.abs(s)), 6)))]


@pytest.mark.some(16)
@pytest.mark.parametrize(("name", "change"), list(zoo.cases()))
def test_roots(name, change):
    expected = with_part(roots(mb.modes(zoo.drawn(name), at=rest(name))), change)
    change, model = changed(name, change)
    modes = mb.modes(model, at=zoo.at_rest(model))
    found = roots(modes) * change.time
    assert modes.status == "converged" and found.shape == expected.shape
    assert np.max(np.abs(found - expected) / np.abs(expected)) <= zoo.allowed(change, 1e-9, 30.0)


@pytest.mark.some(12)
@pytest.mark.parametrize(
    ("name", "change"),
    list(zoo.cases(("tree", "chain", "isolator"), [c for c in zoo.CHANGES if not c.endswith("part")])),
)
def test_lowest_roots_only(name, change):
    """``n=2``: the sparse route where there is one."""
    expected = np.abs(roots(mb.modes(zoo.drawn(name), at=rest(name))))[[0, 2]]
    change, model = changed(name, change)
    found = mb.modes(model, at=zoo.at_rest(model), n=2).omega * change.time
    assert np.max(np.abs(np.sort(found) - expected) / expected) <= zoo.allowed(change, 1e-8, 30.0)
