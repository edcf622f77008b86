"""Each effect, switched off in a model that has it, changes the result and saves work that is counted."""

from __future__ import annotations

import warnings

import mbrs as mb
import numpy as np
import pytest
from air_models import vane
from mbrs.system.effects import EFFECTS
from random_models import N_FREE, add_body, random_quaternion

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")


def loaded():
    """A loaded, moving two-link arm with everything linear that an open tree can have. Invented data."""
    m = mb.Model("arm", gravity=(0.5, -9.81, 0.3))
    a = m.body(
        "a", mass=1.0, inertia=(0.02, 0.03, 0.04), at=(0.5, 0, 0), angular_velocity=(0, 0, 4.0), velocity=(0, 2.0, 0)
    )
    b = m.body("b", mass=2.0, inertia=(0.05, 0.03, 0.04), at=(1.2, 0.2, 0), angular_velocity=(1.0, 0, 5.0))
    m.revolute("base", m.ground, a, at=(0, 0, 0), axis="z", k=50.0, c=0.3)
    m.universal("cross", a, b, at=(1, 0, 0), axis="z", axis2="x", k=(20.0, 30.0), c=(0.1, 0.1), preload=(1.0, 0.5))
    m.spring_damper("stay", m.ground, b, at=((0, 1, 0), (1.2, 0.2, 0)), k=200.0, c=1.0, preload=15.0)
    m.force("pull", b, value=(3.0, -2.0, 1.0), frame="body")
    return m


def loop():
    """The four-bar above its hinges: heavy constraint forces in a redundant loop."""
    return mb.examples.four_bar()


def rubbing():
    m = mb.Model("rubbing")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=100.0, law=mb.Jenkins(50.0, 3.0))
    return m


def touching():
    m = mb.Model("touching", gravity=(0, 0, -9.81))
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="z", k=100.0, law=mb.Gap(500.0, -0.01))
    return m


# the model that has the effect, and the counts of which at least one must fall
CASES = {
    "gravity": (loaded, ("gravity stiffness",)),
    "gyroscopic": (loaded, ()),
    "centrifugal": (loaded, ()),
    "preload-stiffness": (loaded, ("preload stiffness",)),
    "constraint-force-stiffness": (loop, ("constraint-force stiffness",)),
    "damping": (loaded, ("damper tangents",)),
    "friction": (rubbing, ()),
    "contact": (touching, ()),
    "aerodynamics": (vane, ()),
}
# tests of their own: flexible bodies, drives and nonholonomic joints change the coordinates
LATER = {"flexibility", "drives", "nonholonomic"}


def matrices(lin):
    zero = np.zeros_like(lin.M)
    return np.stack([zero if a is None else a for a in (lin.M, lin.C, lin.G, lin.K, lin.N)])


def test_every_effect_has_a_case():
    assert set(EFFECTS) == set(CASES) | LATER


@pytest.mark.parametrize("effect", list(CASES))
def test_switched_off_changes_the_result(effect):
    make, counted = CASES[effect]
    m = make()
    assert mb.effects(m)[effect].on, mb.effects(m)
    full, less = mb.linearize(m), mb.linearize(m, without=(effect,))
    change = np.abs(matrices(full) - matrices(less)).max() / np.abs(matrices(full)).max()
    print(
        f"without {effect}: matrices change by {change:.2e}, counts {dict(full.stats.counts)} -> {dict(less.stats.counts)}"
    )
    assert change > 1e-6
    assert effect in full.effects and effect not in less.effects
    for name in counted:
        assert full.stats.counts.get(name, 0) > less.stats.counts.get(name, 0)


def test_velocity_terms_are_left_out_together():
    m = loaded()
    full = mb.linearize(m).stats.counts
    less = mb.linearize(m, without=("gyroscopic", "centrifugal")).stats.counts
    assert full["velocity terms"] == 1 and "velocity terms" not in less


def test_an_absent_effect_changes_nothing():
    """Leaving out what the scene does not contain gives the same numbers, bit for bit."""
    m = mb.examples.chain(4)
    table = mb.effects(m)
    absent = [e.name for e in table if not e.on]
    assert {"gravity", "gyroscopic", "centrifugal"} <= set(absent)
    full, less = mb.linearize(m), mb.linearize(m, without=absent)
    assert np.array_equal(matrices(full), matrices(less))


@pytest.mark.exact
def test_an_undamped_tree_in_vacuum_takes_the_symmetric_route():
    """No loop, damping, gravity, velocity or geometric work: the counts say so."""
    m = mb.examples.chain(4, "revolute", c=None)
    lin = mb.linearize(m)
    assert lin.C is None and lin.G is None and lin.N is None
    forbidden = {
        "loop factorisations",
        "damper tangents",
        "gravity stiffness",
        "velocity terms",
        "preload stiffness",
        "constraint-force stiffness",
    }
    assert not forbidden & set(lin.stats.counts), lin.stats.counts
    modes = mb.modes(m)
    assert modes.stats.route == "undamped"


def test_an_open_tree_has_no_multipliers_and_a_loop_has():
    assert mb.linearize(mb.examples.chain(3)).multipliers.shape == (0,)
    lin = mb.linearize(loop())
    assert lin.multipliers.shape == (5,) and lin.stats.counts["loop factorisations"] == 1


def test_unknown_effects_are_refused():
    m = mb.examples.chain(2)
    with pytest.raises(mb.ModelError, match="did you mean 'gyroscopic'"):
        mb.linearize(m, without=("gyroscopc",))
    for never in ("loops", "redundancy"):
        with pytest.raises(mb.ModelError, match="cannot be switched off"):
            mb.linearize(m, without=(never,))


def test_constraint_forces_of_a_tree_count_as_work():
    """A hanging chain: its joints carry the weight below; in vacuum they carry nothing."""

    def chain(gravity):
        m = mb.Model("chain", gravity=gravity)
        before = m.ground
        for i in range(4):
            b = m.body(f"b{i}", mass=1.0, inertia=(0.01, 0.01, 0.01), at=(0, 0, -0.5 - i))
            m.revolute(f"j{i}", before, b, at=(0, 0, -i), axis="y", k=5.0)
            before = b
        return m

    assert "constraint-force stiffness" not in mb.linearize(chain(None)).stats.counts
    hanging = chain((0, 0, -9.81))
    full, less = mb.linearize(hanging), mb.linearize(hanging, without="constraint-force-stiffness")
    assert full.stats.counts["constraint-force stiffness"] == 4
    assert "constraint-force stiffness" not in less.stats.counts
    assert np.abs(full.K - less.K).max() > 1.0


@pytest.mark.exact
def test_rounding_is_no_preload():
    """Springs at their drawn length in skew trees, also far from the origin: no preload work, and no state off balance."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        m, far = mb.Model("skew"), 10.0 ** rng.uniform(0, 5)
        before, place = m.ground, np.array([far, 0.0, 0.0])
        for i in range(4):
            here = place + rng.normal(size=3)
            b = add_body(m, rng, f"b{i}", here)
            kind = str(rng.choice(["revolute", "cylindrical", "universal", "spherical", "prismatic", "planar"]))
            turned = random_quaternion(rng)
            k = 1e4 * rng.random(N_FREE[kind])
            getattr(m, kind)(f"j{i}", before, b, at=0.5 * (place + here), orientation=turned, k=k)
            m.bushing(f"u{i}", before, b, at=0.3 * place + 0.7 * here, k=1e5 * rng.random(6), orientation=turned)
            m.spring_damper(f"s{i}", before, b, at=(place + rng.normal(size=3), here + rng.normal(size=3)), k=1e6)
            before, place = b, here
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            lin = mb.linearize(m)
        assert not {"preload stiffness", "constraint-force stiffness"} & set(lin.stats.counts)


def test_rate_laws_are_damping():
    """Dry friction and a velocity polynomial damp; the table says so, and leaving it out removes C."""
    for law in (mb.CoulombTanh(2.0, 0.1), mb.Polynomial1D([0.0], [0.0, 3.0])):
        m = mb.Model("rated")
        b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
        m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=100.0, law=law)
        assert mb.effects(m)["damping"].on
        assert mb.linearize(m).C is not None and mb.linearize(m, without="damping").C is None


def test_strain_energy_holds_the_slopes_of_laws():
    """Two equal springs in parallel, one of them a law: half of the energy each."""
    m = mb.Model("parallel")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", law=mb.Polynomial1D([0.0, 50.0]))
    m.spring_damper("spring", m.ground, b, at=((-1, 0, 0), (0, 0, 0)), k=50.0)
    shares = mb.modes(m).energy()
    named = dict(zip(shares.elements, shares.strain_element[:, 0], strict=True))
    assert named == pytest.approx({"rail": 0.5, "spring": 0.5})
