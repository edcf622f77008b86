"""The same model in metres and in millimetres: no rank, no frequency and no share of a redundant reaction depends on units."""

from __future__ import annotations

import warnings

import mbrs as mb
import numpy as np
import problems
import pytest
from random_models import random_loop, random_tree

# how a number changes when lengths are counted in parts of 1/u metre and mass and time are kept: force u, moment u^2
POWER = {
    "m": 1, "N": 1, "N m": 2, "kg m2": 2, "m/s": 1, "m/s2": 1, "N/m": 0, "N s/m": 0, "N m/rad": 2, "N m s/rad": 2,
    "N/rad": 1, "N m/m": 1, "N s/rad": 1, "N m s/m": 1, "kg": 0, "rad": 0, "rad/s": 0,
}  # fmt: skip


def rescaled(m, u):
    """A copy of a model without parameters, in other units of length."""
    out = m.copy()
    changes = {}
    for item in out.items.values():
        for name, field in item.fields().items():
            address = f"{item.name}.{name}"
            if field.kind in ("axis", "orientation") or (name == "at" and "at_a" in item.fields()):
                continue
            if name == "length" and not item.has("length"):
                continue
            units = set(field.units)
            factor = np.array([float(u) ** POWER[unit] for unit in field.units])
            value = out.value(address)
            if name == "inertia" or len(units) == 1:
                changes[address] = value * factor[0]
            else:
                changes[address] = value * factor.reshape(np.shape(value))
    if out.gravity is not None:
        changes["gravity"] = out.gravity * u
    out.set(changes)
    return out


def models():
    e = mb.examples
    rng = np.random.default_rng(40)
    stiff = random_loop(rng, ("spherical", "universal", "cylindrical", "spherical"), followers=False)
    for joint in stiff.joints:
        stiff.set({f"{joint.name}.k": 20 * np.asarray(stiff.value(f"{joint.name}.k"))})
    tree = random_tree(rng, 4, ("revolute", "prismatic", "universal"), followers=False)
    for joint in tree.joints:
        tree.set({f"{joint.name}.k": 20 * np.asarray(tree.value(f"{joint.name}.k"))})
    hexapod = problems.cubic_hexapod().model
    plain = mb.Model("hexapod")
    p = plain.body("payload", mass=20.0, inertia=(0.15, 0.15, 0.15), at=(0, 0, 0.1))
    for i, (a, b) in enumerate(e.cubic_hexapod_points(edge=0.2, centre=(0, 0, 0.1))):
        plain.spring_damper(f"leg{i}", plain.ground, p, at=(a, b), k=1e5, c=30.0)
    del hexapod
    return {
        "ladder R": e.ladder(3, "revolute"),
        "ladder C": e.ladder(3, "cylindrical"),
        "ladder S": e.ladder(2, "spherical"),
        "chain": e.chain(4),
        "chain along x": e.chain(4, along="x"),
        "four-bar": e.four_bar(),
        "hexapod": plain,
        "hanging four-bar": problems.hanging_four_bar().model,
        "Bricard": problems.bricard().model,
        "free pair": problems.free_pair().model,
        "random loop": stiff,
        "random tree": tree,
    }


@pytest.mark.some(8)
@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("u", [1e3, 1e-3])
@pytest.mark.parametrize("name", list(models()))
def test_nothing_depends_on_the_unit_of_length(name, u):
    m = models()[name]
    other = rescaled(m, u)
    here, there = mb.System(m), mb.System(other)
    # equivalent rows and coordinates are ties, which rounding must not decide: the names are the same
    assert (here.dof, here.rank, here.redundant) == (there.dof, there.rank, there.redundant)
    assert mb.linearize(m).coordinates == mb.linearize(other).coordinates
    assert there.characteristic_length == pytest.approx(u * here.characteristic_length, rel=1e-12)
    a, b = mb.equilibrium(m), mb.equilibrium(other)
    assert (a.stable, a.iterations, len(a.free_directions)) == (b.stable, b.iterations, len(b.free_directions))
    moved = np.abs(b.poses["position"] / u - a.poses["position"]).max() / here.characteristic_length
    f, g = mb.modes(m, at=a).roots, mb.modes(other, at=b).roots
    worst = float(np.abs(f - g).max() / max(np.abs(f).max(), 1e-300))
    print(f"{name} in units of {1 / u:g} m: equilibrium {moved:.1e}, roots {worst:.1e}")
    assert moved < 1e-10 and worst < 1e-9


def test_redundant_reactions_scale_with_the_unit():
    """Forces as u, moments as u^2, entry by entry."""
    m = mb.examples.four_bar()
    other = rescaled(m, 1e3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        a, b = mb.equilibrium(m).reactions, mb.equilibrium(other).reactions
    scale = max(np.abs(w).max() for w in a.values())
    worst = max(np.abs(b[j] / [1e3] * [1, 1, 1, 1e-3, 1e-3, 1e-3] - a[j]).max() for j in a) / scale
    print(f"reactions: {worst:.1e}")
    assert worst < 1e-10
