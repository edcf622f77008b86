"""Models on which every analysis is asked the same question before and after a change.

All are first turned by one random rotation, so that nothing lies along the axes of the world; all have springs, so that they
rest somewhere, and none has torsion elements (the angle of one depends on the axes of the world, docs/tables.md).
"""

from __future__ import annotations

import warnings
from functools import lru_cache

import changes
import descriptions
import mbrs as mb
import numpy as np
import problems
import pytest
import random_models
import units


def _without_torsion(model):
    d = descriptions.Description.of(model)
    if "element" in d.data:
        d.data["element"] = [e for e in d["element"] if e["type"] != "torsion"]
    return d.model()


def tree():
    kinds = ("revolute", "cylindrical", "spherical", "universal")
    return _without_torsion(random_models.random_tree(np.random.default_rng(7), 4, kinds, each=True, followers=False))


def loop():
    kinds = ("revolute", "spherical", "universal", "cylindrical")
    return _without_torsion(random_models.random_loop(np.random.default_rng(8), kinds, followers=False))


def hanging_four_bar():
    """Gravity pulls it aside, so that it swings from the pose that is drawn."""
    m = problems.hanging_four_bar().model
    m.gravity = (4.0, -9.0, 1.0)
    return m


def damped_four_bar():
    """A planar four-bar with a spring, a damper and a point mass."""
    m = hanging_four_bar()
    m.spring_damper("strut", m.ground, "coupler", at=((-0.3, 0.2, 0.1), (0.3, -1.0, 0.0)), k=30.0, c=0.7)
    return m


def isolator():
    m = mb.examples.cubic_hexapod()
    m.gravity = (1.0, 2.0, -9.0)
    return m


def chain():
    m = mb.Model("chain", gravity=(0, -9.81, 0))
    before, rng = m.ground, np.random.default_rng(3)
    for i in range(4):
        b = m.body(f"link{i}", mass=1.0 + i / 3, inertia=(0.02, 0.03, 0.04), at=(0.2, -0.7 * i - 0.35, 0.1 * i))
        m.revolute(f"hinge{i}", before, b, at=(0, -0.7 * i, 0), axis=tuple(rng.normal(size=3)), k=3.0 + i, c=0.05)
        before = b
    return m


MODELS = {f.__name__: f for f in (tree, loop, hanging_four_bar, damped_four_bar, isolator, chain)}

CHANGES = {
    "turned": lambda rng: changes.turned(rng),
    "moved": lambda rng: changes.turned(rng, distance=1e4),
    "millimetres": lambda rng: units.in_units(1e3, 1e-3),
    "micrometres": lambda rng: units.in_units(1e6, 3.7, 11.0),
    "large": lambda rng: units.in_units(0.3e-4, 1.7e5, 0.013),
    "order": lambda rng: changes.reordered(rng),
    "names": lambda rng: changes.renamed(rng),
    "digits12": lambda rng: changes.rounded(12),
    "digits8": lambda rng: changes.rounded(8),
    "tilted": lambda rng: changes.tilted(rng, 1e-8),
    "split": lambda rng: changes.split(0.37),
    "repeated": lambda rng: changes.repeated(rng),
    "stiff part": lambda rng: changes.with_part(2.3e9, 1.0, "stiff part"),
    "soft part": lambda rng: changes.with_part(0.7e-7, 1.0, "soft part"),
    "heavy part": lambda rng: changes.with_part(2.3e9, 1e9, "heavy part"),
    "light part": lambda rng: changes.with_part(3.1e-6, 1e-8, "light part"),
}
PARTS = {
    "stiff part": np.sqrt(2.3e9),
    "soft part": np.sqrt(0.7e-7),
    "heavy part": np.sqrt(2.3),
    "light part": np.sqrt(310.0),
}


@lru_cache
def drawn(name):
    """A model of the zoo, turned by the fixed rotation. Do not change it."""
    return changes.turned(np.random.default_rng(20))(MODELS[name]())


def changed(name, change):
    """The change, and the model after it."""
    made = CHANGES[change](np.random.default_rng([21, len(name), len(change)]))
    return made, made(drawn(name))


@lru_cache
def rest(name):
    """Its equilibrium."""
    return at_rest(drawn(name))


def at_rest(model):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mb.MbrsWarning)
        return mb.equilibrium(model)


def cases(models=MODELS, which=CHANGES):
    """All pairs."""
    for model in models:
        for change in which:
            yield pytest.param(model, change, id=f"{model}-{change}")


def bodies(model):
    """Names, without those that a change may have added."""
    return [b["name"] for b in descriptions.Description.of(model)["body"]]


def allowed(change, exact=1e-9, slope=1e3):
    """Relative error of an answer: that of a calculation, and that which the change itself makes in the data."""
    return exact + slope * change.error


def close(found, expected, rtol):
    """Arrays agree, against the largest entry of a vector."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    size = np.linalg.norm(expected.reshape(-1)) if expected.ndim < 2 else np.linalg.norm(expected, axis=-1).max()
    assert np.abs(found - expected).max() <= rtol * size
