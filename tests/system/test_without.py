"""`without=` of every analysis: a name, a tuple or a list mean the same, and a wrong name is told with what is known."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
FORCE, MOTION = "coupler.force.x", "coupler.motion.x"
MATRICES = mb.MechanicalSystem(np.diag([1.3, 0.7]), [[0.2, -0.1], [-0.1, 0.3]], [[3.1, -1.7], [-1.7, 2.9]])
ANALYSES = {
    "modes": lambda m, w: mb.modes(m, without=w).eigenvalue,
    "modes of matrices": lambda m, w: mb.modes(MATRICES, without=w).eigenvalue,
    "frf": lambda m, w: mb.frf(m, FORCE, MOTION, frequency=[1.0, 2.0], without=w).value,
    "frf of matrices": lambda m, w: mb.frf(MATRICES, 0, 1, frequency=[1.0, 2.0], without=w).value,
    "response": lambda m, w: mb.response(m, np.linspace(0, 1, 9), {FORCE: np.sin}, MOTION, without=w).value,
    "state_space": lambda m, w: mb.state_space(m, FORCE, MOTION, without=w).A,
    "linearize": lambda m, w: mb.linearize(m, without=w).K,
    "equilibrium": lambda m, w: mb.equilibrium(m, without=w).position("coupler"),
    "simulate": lambda m, w: mb.simulate(m, t=[0.1], without=w).position("coupler"),
    "harmonic_balance": lambda m, w: mb.harmonic_balance(m, inputs=FORCE, amplitude=0.1, frequency=2.0, without=w).X,
    "gradient": lambda m, w: (
        mb.gradient(
            m, mb.Final(lambda s: s.position("coupler")[0]), ["mount.k[0]"], t=0.02, step=0.01, without=w
        ).gradient
    ),
}


@pytest.mark.parametrize("name", ANALYSES)
def test_a_name_may_stand_without_a_list(name):
    m = mb.examples.four_bar()
    whole, one, several, more = (ANALYSES[name](m, w) for w in ((), "damping", ("damping",), ["damping"]))
    assert np.array_equal(one, several) and np.array_equal(one, more)
    if name not in ("linearize", "equilibrium"):
        assert not np.array_equal(one, whole)


@pytest.mark.parametrize("name", ANALYSES)
def test_a_wrong_name_is_told_with_what_is_known(name):
    with pytest.raises(mb.errors.ModelError, match=r"'dampng'.*damping"):
        ANALYSES[name](mb.examples.four_bar(), ["dampng"])
