"""Follower loads beside a direction without stiffness: whether there is an equilibrium hangs on no unit and no order."""

import changes
import mbrs as mb
import numpy as np
import pytest


def neutral(seed):
    """A body on a bushing under follower loads; on it or on ground a second one that turns freely about its centre of mass."""
    rng = np.random.default_rng([141, seed])
    m = mb.Model("neutral", gravity=5 * rng.normal(size=3))
    a = m.body("a", mass=1 + rng.random(), inertia=(0.2, 0.3, 0.4), at=rng.normal(size=3))
    m.bushing("k", m.ground, a, at=rng.normal(size=3), k=20 + 20 * rng.random(6))
    m.torque("t", a, value=rng.normal(size=3), frame="body")
    m.force("f", a, at=rng.normal(size=3), value=rng.normal(size=3), frame="body")
    here, axis = rng.normal(size=3), rng.normal(size=3)
    b = m.body("b", mass=1 + rng.random(), inertia=(0.2, 0.3, 0.4), at=here)
    on = a if seed % 2 else m.ground
    if seed % 3 == 0:
        m.revolute("loose", on, b, at=here, axis=axis)
    elif seed % 3 == 1:
        m.spherical("loose", on, b, at=here)
    else:
        m.universal("loose", on, b, at=here, axis=axis, axis2=np.cross(axis, rng.normal(size=3)))
    return m


@pytest.mark.parametrize("seed", range(36))
def test_a_neutral_direction_is_no_matter_of_units_or_order(seed):
    m = neutral(seed)
    rng = np.random.default_rng(seed)
    here = mb.equilibrium(m)
    assert here.status == "converged"
    for change in (
        changes.in_units(1e-3, 1e-3),
        changes.in_units(1e3, 1.0, 1e-3),
        changes.reordered(rng),
        changes.turned(rng),
    ):
        found = mb.equilibrium(change(m))
        back = change.points_back(found.position(change.rename("a")))
        assert found.status == "converged"
        assert np.linalg.norm(back - here.position("a")) <= 1e-9 * (1 + np.linalg.norm(back))


def test_a_push_along_a_direction_without_stiffness_is_refused():
    m = neutral(0)
    m.torque("push", m.bodies[1], value=(1.0, 2.0, 3.0), frame="body")
    for change in (changes.nothing(), changes.in_units(1e-3, 1e-3), changes.reordered(np.random.default_rng(0))):
        with pytest.raises(mb.SingularError, match="restrain"):
            mb.equilibrium(change(m))
