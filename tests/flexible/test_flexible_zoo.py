"""The examples with one body replaced by a flexible one: everything runs on them, and in the limit of stiff bodies they are the
examples themselves.
"""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from flexed import flexed, flexible_bodies_of

EX = mb.examples
ZOO = {
    "four-bar": EX.four_bar,
    "five-bar": EX.five_bar,
    "chain": lambda: EX.chain(3, along="x"),
    "universal chain": lambda: EX.chain(3, joint="universal", along="x"),
    "free chain": lambda: EX.chain(3, joint=None, along="x"),
    "tree": lambda: EX.tree(2),
    "ladder": lambda: EX.ladder(2),
    "quadruped": EX.quadruped,
    "stewart": EX.stewart_platform,
    "hexapod": EX.cubic_hexapod,
    "slider-crank": EX.slider_crank,
    "quarter car": EX.quarter_car,
    "engine": EX.engine_on_mounts,
}


def pairs():
    """Every example with its first and its last body that can be flexible."""
    for name, make in ZOO.items():
        bodies = flexible_bodies_of(make())
        for body in dict.fromkeys((bodies[0], bodies[-1]) if bodies else ()):
            yield pytest.param(name, body, id=f"{name}, {body}")


def balanced(model):
    """The equilibrium where there is one, else the drawn state."""
    try:
        return mb.equilibrium(model)
    except mb.ConvergenceError:
        return None


@pytest.mark.some(8)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name, body", list(pairs()))
def test_stiff_bodies_are_rigid_ones(name, body):
    rigid = ZOO[name]()
    at = balanced(rigid)
    modes = mb.modes(rigid, at=at)
    highest = max(float(np.max(modes.omega, initial=0.0)), 1.0)
    distance = []
    for factor in (30.0, 300.0):
        model = flexed(rigid, body, factor * highest)
        found = mb.modes(model, at=balanced(model) if at is not None else None)
        # what was redundant between rigid bodies may hold modal coordinates now
        lost = sum(mb.System(rigid).redundant.values()) - sum(mb.System(model).redundant.values())
        assert len(found.frequency) == len(modes.frequency) + 3 - lost
        lowest = np.sort(np.abs(found.eigenvalue))[: len(modes.frequency)]
        distance.append(np.max(np.abs(lowest - np.sort(np.abs(modes.eigenvalue)))) / highest)
    # the compliance is that of the springs 1/(factor^2): a hundredth, until rounding is reached
    assert distance[1] < max(0.02 * distance[0], 2e-7)
    assert distance[0] < 0.1


@pytest.mark.some(8)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name, body", list(pairs()))
def test_motion_and_transfer_function_run(name, body):
    rigid = ZOO[name]()
    at = balanced(rigid)
    highest = max(float(np.max(mb.modes(rigid, at=at).omega, initial=0.0)), 1.0)
    model = flexed(rigid, body, 3.0 * highest, damping=0.01)
    node = model[body].node("n0")
    here = balanced(model) if at is not None else None
    h = mb.frf(model, node.force("x"), node.motion("x"), frequency=[0.3, 0.5], at=here)
    back = mb.frf(model, node.force("z"), node.motion("x"), frequency=[0.3], at=here)
    forth = mb.frf(model, node.force("x"), node.motion("z"), frequency=[0.3], at=here)
    assert np.all(np.isfinite(h.value))
    if here is not None and mb.linearize(model, at=here).N is None:
        assert back.value == pytest.approx(forth.value, rel=1e-6, abs=1e-9 * np.max(np.abs(h.value)))  # reciprocity
    end, ends = min(0.1, 10.0 / highest), []
    for method, control in (("explicit", {"rtol": 1e-8}), ("radau", {"rtol": 1e-8}), ("bdf", {"rtol": 1e-7})):
        traj = mb.simulate(model, t=[0.0, 0.5 * end, end], method=method, **control)
        assert traj.status == "finished"
        ends.append(np.concatenate([traj.poses["position"][-1].ravel(), traj.modal(body)[-1]]))
    scale = 1.0 + np.max(np.abs(ends[0]))
    assert np.max(np.abs(ends[0] - ends[1])) < 1e-5 * scale
