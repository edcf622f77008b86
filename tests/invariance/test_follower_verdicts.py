"""Follower loads on models that are held, half held or not: whether there is an equilibrium does not depend on units, order or place."""

import changes
import mbrs as mb
import numpy as np
import pytest
import units
from mbrs.errors import ConvergenceError, SingularError
from random_models import add_body, add_joint

CHANGES = {
    "in millimetres": lambda rng: units.in_units(1e3, 1e-3),
    "small": lambda rng: units.in_units(1e6, 1e3),
    "reordered": changes.reordered,
    "turned": changes.turned,
    "reversed": changes.reversed_joints,
}


def half_held(seed: int) -> mb.Model:
    """One to three bodies on joints of which some have no springs, with body-fixed forces and torques, with or without weight."""
    rng = np.random.default_rng([77, seed])
    m = mb.Model("half held", gravity=rng.normal(size=3) * (1, 9, 1) if rng.random() < 0.5 else (0, 0, 0))
    handles, places = [m.ground], [np.zeros(3)]
    kinds = ("revolute", "prismatic", "cylindrical", "universal", "spherical", "planar", "free", "fixed")
    for i in range(int(rng.integers(1, 4))):
        j = int(rng.integers(len(handles)))
        kind, here = str(rng.choice(kinds)), places[j] + rng.normal(size=3)
        body = add_body(m, rng, f"b{i}", here)
        middle = 0.5 * (places[j] + here)
        add_joint(m, rng, kind, f"j{i}", handles[j], body, middle, forces=rng.random() < 0.6)
        held = rng.random()
        if held < 0.3:
            m.bushing(f"bush{i}", handles[j], body, at=middle, k=3 + rng.random(6))
        elif held < 0.6:
            m.spring_damper(
                f"s{i}", handles[j], body, at=(middle + rng.normal(size=3), middle + rng.normal(size=3)), k=8.0
            )
        if rng.random() < 0.7:
            m.force(f"f{i}", body, at=here + 0.3 * rng.normal(size=3), value=rng.normal(size=3), frame="body")
        if rng.random() < 0.4:
            m.torque(f"t{i}", body, value=rng.normal(size=3), frame="body")
        handles.append(body)
        places.append(here)
    return m


def verdict(m: mb.Model) -> tuple[str, int]:
    try:
        found = mb.equilibrium(m)
    except (SingularError, ConvergenceError) as problem:
        return type(problem).__name__, 0
    return found.status, len(found.free_directions)


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.some(16)
@pytest.mark.parametrize("seed", [101, *range(60)])
def test_the_verdict_is_the_same(seed):
    m = half_held(seed)
    here = verdict(m)
    print(here)
    for name, change in CHANGES.items():
        there = verdict(change(np.random.default_rng(seed))(m))
        assert there == here, name


def test_what_followers_do_not_restrain_is_named():
    """A body that slides freely, pushed by a force in its own axes, beside one on springs under a follower torque, in both orders."""
    for names in (("rail", "cross"), ("cross", "rail")):
        m = mb.Model("pushed")
        a = m.body("a", mass=1.3, inertia=(0.1, 0.2, 0.3), at=(0.3, 0.1, -0.2))
        b = m.body("b", mass=0.7, inertia=(0.1, 0.2, 0.3), at=(1.3, 0.4, -0.1))
        for name in names:
            if name == "rail":
                m.prismatic("rail", m.ground, a, at=(0.1, 0.2, 0.3), axis=(0.3, -0.8, 0.4))
            else:
                m.spherical("cross", m.ground, b, at=(0.8, 0.3, 0.2), k=(5.0, 6.0, 7.0))
        m.force("push", a, at=(0.5, 0.4, 0.3), value=(0.3, 0.2, -0.4), frame="body")
        m.torque("turn", b, value=(0.3, 0.2, -0.4), frame="body")
        with pytest.raises(SingularError, match=r"nothing restrains the direction rail but a force acts along it"):
            mb.equilibrium(m)
