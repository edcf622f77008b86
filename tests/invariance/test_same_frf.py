"""Transfer functions: forces on a body in three directions, its motion in three directions."""

import mbrs as mb
import numpy as np
import pytest
import zoo
from zoo import changed, close, drawn, rest

OMEGA = np.array([0.3, 1.1, 2.9, 7.3, 40.0])


def receptance(model, at, body, omega):
    ports = [model[body].force(d) for d in "xyz"], [model[body].motion(d) for d in "xyz"]
    return np.moveaxis(np.asarray(mb.frf(model, *ports, omega=omega, at=at).value), -1, 0)


@pytest.mark.some(16)
@pytest.mark.parametrize(("name", "change"), list(zoo.cases()))
def test_receptance(name, change):
    body = zoo.bodies(drawn(name))[-1]
    expected = receptance(drawn(name), rest(name), body, OMEGA)
    change, model = changed(name, change)
    found = receptance(model, zoo.at_rest(model), change.rename(body), OMEGA / change.time)
    back = change.R.T @ found @ change.R / change.unit(mass=-1, time=2)
    for one, other in zip(back, expected, strict=True):
        close(one.reshape(-1), other.reshape(-1), zoo.allowed(change, 1e-8, 1e4))
