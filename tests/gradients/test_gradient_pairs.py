"""Every number of every kind of joint, element, law, load and drive: derivatives of a short motion against differences.

All schemes walk through all scenes, in four steps of three lengths: generalised-alpha shifts its acceleration where they change.
Differences go along dx/dp through the assembly, the start and all steps of the production code, so that axes and orientations are
checked as well; the adjoint is compared with the direct result for all numbers at once.
"""

import warnings

import jitter
import mbrs as mb
import numpy as np
import pytest
from agreement import all_addresses
from gradient_scenes import SCENES
from mbrs import _core
from mbrs.model.tables import directions
from mbrs.motion.quantities import Names
from mbrs.motion.tangent import Run
from mbrs.system.compiled import compiled
from mbrs.system.snapshot import Snapshot
from mbrs.system.state import state_of
from motion_models import silent

TIMES = np.array([0.0, 0.03, 0.045, 0.09, 0.12])
# steps of "bdf": orders climb and fall, steps grow and shrink, and a history begins anew; within a difference no start of a ramp
# passes the end of a step, where the motion has no derivative
BDF_TIMES = np.cumsum([0, 1, 2, 2, 2, 3, 3, 3, 3, 2.5, 2.5, 4, 1, 1, 1.3, 1.3]) * 3.1e-3
BDF_ORDERS = [-1, 1, 1, 2, 2, 3, 3, 3, 4, 4, 3, -1, 1, 1, 2]
STEP = 1e-3
# differences in which no slider begins to slip at the end of a step, or turns within it
SHORT = {(name, scheme): 0.05 for name in ("law_iwan", "law_jenkins_sliding") for scheme in ("radau", "bdf")}
# a smoothing of zero cannot become negative
ONE_SIDED = {"law_gap": ("rail.law[2]", "link.law[2]")}


def run_of(m, x, scheme, times=TIMES):
    """The motion of a model whose number vector is x."""
    snapshot = Snapshot.of(m)
    system = snapshot.system.with_values(x)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        state = state_of(m, system, None, hold=False)
    orders = BDF_ORDERS if times is BDF_TIMES else ()
    own = Snapshot(m, system, snapshot.versions, snapshot.tables)
    return Run(m, own, state, (), times, scheme=scheme, orders=orders)


def asked_of(m):
    """Positions, velocities, accelerations and rotation of the last body, reactions of all joints."""
    names = Names(Snapshot.of(m).tables)
    body = m.bodies[-1].name
    what = [f"{body}.{k}" for k in ("position", "velocity", "acceleration", "rotation", "angular_acceleration")]
    return [names.address(w) for w in [*what, *(f"{j.name}.reaction" for j in m.joints)]]


def values(m, x, asked, scheme, times):
    return run_of(m, x, scheme, times).direct(asked, None)["values"][-1]


PAIRS = [(name, scheme) for name in SCENES for scheme in ("ali3p", "generalized-alpha", "explicit", "radau", "bdf")]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "scheme"), PAIRS)
def test_every_number(name, scheme):
    m = silent(SCENES[name])
    x = np.array(Snapshot.of(m).tables["x"], dtype=float)
    along, asked = directions(m, all_addresses(m)), asked_of(m)
    times = BDF_TIMES if scheme == "bdf" else TIMES
    run = run_of(m, x, scheme, times)
    made = run.direct(asked, along)
    exact, base = made["derivatives"][-1], made["values"][-1]
    assert np.all(np.isfinite(exact))
    seeds = np.zeros_like(made["values"])
    seeds[-1] = np.random.default_rng(1).normal(size=len(base))
    forward = _core.MotionForward(compiled(m), run.state.q, run.state.rate, [], run.options(asked, along))
    back = forward.gradient(seeds)[0]
    agreement = np.abs(back - seeds[-1] @ exact).max() / np.abs(seeds[-1] @ exact).max()
    wrong, worst = [], 0.0
    for p, label in enumerate(along.labels):
        if label in ONE_SIDED.get(name, ()):
            continue
        d = along.dense[:, p]
        if not d.any():
            # a number that no row of the tables depends on at its present value
            assert not exact[:, p].any()
            continue
        # small numbers on which a motion depends strongly
        least = 0.05 if any(part in label for part in (".inertia", ".t[", ".law[")) else 1.0
        e = STEP * SHORT.get((name, scheme), 1.0) / np.abs(d).max() * max(least, np.abs(x[d != 0]).max())

        def slope(e, d=d):
            a, b, c, f = (values(m, x + s * e * d, asked, scheme, times) for s in (1, -1, 2, -2))
            return (8 * (a - b) - (c - f)) / (12 * e)

        difference = slope(e)
        # one scale for each kind of quantity would hide small ones: what rounding leaves of every number is allowed
        floor = (1e-12 + 10 * jitter.level()) * (np.abs(base) + np.abs(base).max()) / e
        error = np.max(np.abs(exact[:, p] - difference) - floor)
        size = max(np.abs(exact[:, p]).max(), np.abs(difference).max())
        if error > 1e-6 * size:
            # what another step of the difference changes is noise or truncation of the difference itself
            error = np.max(np.abs(exact[:, p] - difference) - floor - np.abs(difference - slope(1.4 * e)))
        if error > 1e-6 * size:
            wrong.append(f"{label}: {error / size:.1e} of {size:.1e}")
        worst = max(worst, error / size if size else 0.0)
    print(f"{name}, {scheme}: {along.n} numbers, differences {worst:.1e}, adjoint - direct {agreement:.1e}")
    assert not wrong, "; ".join(wrong)
    assert agreement < 1e-9


def test_nothing_is_left_out():
    """Every kind of joint, element, law, load motion and drive is in a scene."""
    from mbrs.model.schema import JOINTS

    made = [silent(make) for make in SCENES.values()]
    assert {j.type for m in made for j in m.joints} == set(JOINTS)
    laws = {int(c) for m in made for c in Snapshot.of(m).tables["law_type"]}
    # a varying stiffness follows the phase of harmonic balance
    assert laws == set(range(15)) - {11}, laws
    motions = {int(c) for m in made for c in Snapshot.of(m).tables["motion_type"]}
    assert motions >= {0, 1, 2, 3, 4}
    assert {e.type for m in made for e in m.elements} == {"spring_damper", "bushing", "torsion"}
    assert {(load.type, load.frame) for m in made for load in m.loads} == {
        (t, f) for t in ("force", "torque") for f in ("world", "body")
    }
    assert any(m.couplers for m in made)


def test_laws_that_a_motion_cannot_have_say_so():
    m = mb.Model("varying")
    a = m.body("a", mass=0.8, inertia=(0.1, 0.2, 0.3), at=(0.2, 0, 0))
    m.prismatic("rail", m.ground, a, at=(0, 0, 0), axis="x", k=5.0, law=mb.VaryingStiffness(2.0))
    assert np.isfinite(mb.gradient(m, mb.Final(lambda s: s.position("a")[0]), "rail.k", t=0.1, step=0.01).value)
