"""Motion in time, by every integrator, from the pose that was drawn."""

import warnings
from functools import lru_cache

import mbrs as mb
import numpy as np
import pytest
import zoo
from zoo import changed, close, drawn

TIMES = np.array([0.0, 0.13, 0.29, 0.4])
METHODS = {
    "explicit": {"rtol": 1e-10, "max_steps": 1500},
    "generalized-alpha": {"step": 4e-3, "max_steps": 150},
    "radau": {"rtol": 1e-9, "max_steps": 1500},
    "bdf": {"rtol": 1e-8, "max_steps": 1500},
    "bdf-bfgs": {"step": 4e-3, "max_steps": 150},
    "ali3p": {"step": 4e-3, "max_steps": 150},
}
# a method that chooses its steps chooses others: the answer is as good as the method
EXACT = {"explicit": 1e-7, "generalized-alpha": 1e-7, "radau": 1e-6, "bdf": 1e-5, "bdf-bfgs": 1e-6, "ali3p": 1e-7}


def places(model, method, bodies, time=1.0):
    """(n_bodies, n_t, 3)."""
    given = {k: v * time if k == "step" else v for k, v in METHODS[method].items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        traj = mb.simulate(model, t=TIMES * time, method=method, **given)
    assert traj.status == "finished"
    return np.array([traj.position(body) for body in bodies])


@lru_cache
def expected(name, method):
    return places(drawn(name), method, zoo.bodies(drawn(name)))


def cases():
    for method in METHODS:
        for case in zoo.cases():
            name, change = case.values
            if method == "explicit" and change == "stiff part":
                continue  # an explicit method has to follow its vibration
            yield pytest.param(method, name, change, id=f"{method}-{name}-{change}")


@pytest.mark.some(48)
@pytest.mark.parametrize(("method", "name", "change"), list(cases()))
def test_places(method, name, change):
    change, model = changed(name, change)
    bodies = [change.rename(b) for b in zoo.bodies(drawn(name))]
    back = change.points_back(places(model, method, bodies, change.time))
    moved = expected(name, method)
    close(back.reshape(-1), moved.reshape(-1), zoo.allowed(change, EXACT[method], 100.0))
