"""Linearisation: what the bodies feel does not depend on the coordinates that were chosen.

With the map T from coordinates to motions of bodies, T M^-1 T^T and T M^-1 A M^-1 T^T (A = C, G, K, N) belong to the bodies.
"""

import mbrs as mb
import numpy as np
import pytest
import zoo
from zoo import changed, drawn, rest


def tensors(model, at, names):
    lin = mb.linearize(model, at=at)
    where = [list(lin.bodies).index(name) for name in names]
    rows = np.concatenate([np.arange(6 * i, 6 * i + 6) for i in where])
    T = np.asarray(lin.T)[rows]
    mobile = np.linalg.solve(lin.M, T.T)
    out = {"M": T @ mobile}
    for key in "CGKN":
        A = getattr(lin, key)
        out[key] = np.zeros_like(out["M"]) if A is None else mobile.T @ np.asarray(A) @ mobile
    return out


POWERS = {"M": 0, "C": 1, "G": 1, "K": 2, "N": 2}


@pytest.mark.some(16)
@pytest.mark.parametrize(("name", "change"), list(zoo.cases()))
def test_tensors_of_the_bodies(name, change):
    names = zoo.bodies(drawn(name))
    expected = tensors(drawn(name), rest(name), names)
    change, model = changed(name, change)
    found = tensors(model, zoo.at_rest(model), [change.rename(n) for n in names])
    n = len(names)
    turn = np.kron(np.eye(2 * n), change.R)
    fastest = np.abs(mb.modes(drawn(name), at=rest(name)).eigenvalue).max()
    unit = np.tile([change.length] * 3 + [1.0] * 3, n)
    for key, power in POWERS.items():
        made = turn @ expected[key] @ turn.T * np.outer(unit, unit)
        made /= change.mass * change.length**2 * change.time**power
        # entries of one unit against the largest of them
        spread = np.sqrt(np.diag(expected["M"]).reshape(-1, 3).max(axis=1).reshape(-1, 2).max(axis=0))
        size = np.tile(np.repeat(spread, 3), n) * unit / np.sqrt(change.mass) / change.length
        error = np.abs(found[key] - made) / np.outer(size, size) * (change.time / fastest) ** power
        assert error.max() <= zoo.allowed(change, 1e-7, 1e3), key
