"""Linear response in time to a force on one body."""

import mbrs as mb
import numpy as np
import pytest
import zoo
from zoo import changed, close, drawn, rest

TIMES = np.linspace(0.0, 2.0, 81)
DIRECTION = np.array([0.36, -0.48, 0.8])


def displacement(model, at, body, change):
    """(n_t, 3), from rest, under a force that rises and falls."""
    direction = change.R @ DIRECTION * change.unit(1, 1, -2)
    loads = {
        model[body].force(axis): lambda t, size=size: size * np.sin(1.7 * t / change.time) ** 2
        for axis, size in zip("xyz", direction, strict=True)
    }
    outputs = [model[body].motion(axis) for axis in "xyz"]
    y = np.asarray(mb.response(model, TIMES * change.time, loads, outputs, at=at).value)
    return y.T if y.shape[0] == 3 else y


@pytest.mark.some(16)
@pytest.mark.parametrize(("name", "change"), list(zoo.cases()))
def test_displacement(name, change):
    body = zoo.bodies(drawn(name))[-1]
    expected = displacement(drawn(name), rest(name), body, zoo.changes.nothing())
    change, model = changed(name, change)
    found = displacement(model, zoo.at_rest(model), change.rename(body), change)
    close(change.vectors_back(found).reshape(-1), expected.reshape(-1), zoo.allowed(change, 1e-8, 1e4))
