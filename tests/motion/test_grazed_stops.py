"""A ball thrown against a stiff stop that it hardly touches: a contact much shorter than a step, wherever in it, is not passed over."""

from __future__ import annotations

import mbrs as mb
import pytest
from bouncing_balls import Thrown


@pytest.mark.parametrize("beyond", [1e-3, 1e-4, 1e-5, 1e-6])
@pytest.mark.parametrize("method", ["explicit", "radau", "bdf"])
@pytest.mark.parametrize("seed", range(5))
def test_a_contact_much_shorter_than_a_step_is_met(seed, method, beyond):
    ball = Thrown(seed, beyond)
    model = ball.model()
    for rtol in (1e-5, 1e-7, 1e-9):
        traj = mb.simulate(model, ball.end, method=method, rtol=rtol)
        off = abs((traj.position("ball")[-1] - ball.at) @ ball.axis - ball.fallen(ball.values.values()))
        off /= traj.snapshot.system.characteristic_length
        print(f"{method}, {beyond:.0e}, rtol {rtol:.0e}: error {off:.1e} in {len(traj.steps) - 1} steps")
        # a slow contact multiplies errors: what it left of v takes the ball back
        assert off < 100 * rtol or off < 3 * traj.error < 1e4 * rtol
