"""Sensitivities of modes at equilibrium and gradients of a motion: relative ones do not depend on units, place or order."""

import warnings
from functools import lru_cache

import mbrs as mb
import numpy as np
import pytest
import zoo
from zoo import changed, drawn, rest

ADDRESSES = {
    "tree": "spring0.k",
    "loop": "spring0.k",
    "chain": "hinge1.k",
    "damped_four_bar": "strut.k",
    "isolator": "leg2.k",
}
CHANGES = [c for c in zoo.CHANGES if not c.endswith("part")]


def renamed(change, address):
    name, _, field = address.partition(".")
    return f"{change.rename(name)}.{field}"


def scaled_value(model, address):
    return float(np.ravel(model.value(address))[0])


@pytest.mark.some(12)
@pytest.mark.parametrize(("name", "change"), list(zoo.cases(ADDRESSES, CHANGES)))
def test_relative_sensitivities_of_roots(name, change):
    """p ds/dp, one stiffness at a time; of a group of equal roots their sum."""

    def ask(model, at, address):
        s = mb.sensitivity(mb.modes(model, at=at), address)
        return np.ravel(s.eigenvalue)[:] * scaled_value(model, address), mb.modes(model, at=at).omega

    made, omega = ask(drawn(name), rest(name), ADDRESSES[name])
    change, model = changed(name, change)
    found, _ = ask(model, zoo.at_rest(model), renamed(change, ADDRESSES[name]))
    tolerance = zoo.allowed(change, 1e-7, 1e4)
    assert abs(np.sum(made) - np.sum(found) * change.time) <= tolerance * np.abs(made).sum()
    if np.all(np.diff(omega) > 1e-3 * omega[1:]):
        assert np.abs(made - found * change.time).max() <= tolerance * np.abs(made).max()


SCHEMES = ("ali3p", "generalized-alpha")
T, STEP = 0.2, 4e-3


def gradient(model, scheme, change, body, address):
    """The way of a body along a direction, and p d(way)/dp."""
    direction = change.R @ np.array([0.6, 0.64, -0.48])
    start = np.array(model.value(f"{body}.at"), float)
    psi = mb.Final(lambda s: (s.position(body) - start) @ direction)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        value, grad = mb.gradient(model, psi, address, t=T * change.time, step=STEP * change.time, scheme=scheme)
    value, grad = float(np.ravel(value)[0]), float(np.ravel(grad)[0])
    return np.array([value, grad * scaled_value(model, address)]) / change.length


@lru_cache
def expected(name, scheme):
    return gradient(drawn(name), scheme, zoo.changes.nothing(), zoo.bodies(drawn(name))[-1], ADDRESSES[name])


def cases():
    for scheme in SCHEMES:
        for name in ADDRESSES:
            for change in zoo.CHANGES:
                yield pytest.param(scheme, name, change, id=f"{scheme}-{name}-{change}")


@pytest.mark.some(20)
@pytest.mark.parametrize(("scheme", "name", "change"), list(cases()))
def test_gradients_of_a_motion(scheme, name, change):
    change, model = changed(name, change)
    body = change.rename(zoo.bodies(drawn(name))[-1])
    found = gradient(model, scheme, change, body, renamed(change, ADDRESSES[name]))
    made = expected(name, scheme)
    # in another order a loop is cut elsewhere, and the steps of .004 s are those of other coordinates
    assert np.abs(found - made).max() <= zoo.allowed(change, 1e-5, 1e4) * np.abs(made).max()
