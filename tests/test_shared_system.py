"""The modes of equal matrices are solved for once, whichever analysis comes first."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.linear.linear_system import forget_systems


def eigensolutions(result) -> int:
    return sum(n for name, n in result.stats.counts.items() if name.endswith("eigensolutions"))


def random_system(seed: int, kind: str, n: int = 9) -> mb.MechanicalSystem:
    rng = np.random.default_rng(seed)
    a, b, c = (rng.standard_normal((n, n)) for _ in range(3))
    M, K = np.eye(n) * 0.7 + a @ a.T / n, b @ b.T + 0.3 * np.eye(n)
    C = {"undamped": None, "proportional": 0.01 * M + 0.004 * K}.get(kind, 0.02 * c @ c.T)
    G = 0.2 * (c - c.T) if kind == "gyroscopic" else None
    N = 0.05 * (a - a.T) if kind == "circulatory" else None
    return mb.MechanicalSystem(M, C, K, G=G, N=N)


KINDS = ("undamped", "proportional", "general", "gyroscopic", "circulatory")


def analyses(system: mb.MechanicalSystem) -> dict:
    t = np.linspace(0.0, 3.0, 31)
    return {
        "modes": lambda: mb.modes(system),
        "frf": lambda: mb.frf(system, 0, [1, 2], omega=[0.31, 0.77, 1.9]),
        "response": lambda: mb.response(system, t, {1: np.sin}, 0),
    }


@pytest.mark.filterwarnings("ignore:the frequency points miss")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "order", [("modes", "frf", "response"), ("frf", "modes"), ("response", "modes", "frf", "modes")]
)
def test_one_eigenproblem_for_all(kind, order):
    run = analyses(random_system(KINDS.index(kind), kind))
    forget_systems()
    counted = [eigensolutions(run[name]()) for name in order]
    assert counted[0] >= 1 and not any(counted[1:])
    forget_systems()
    assert eigensolutions(run[order[1]]()) == counted[0]


@pytest.mark.filterwarnings("ignore:the frequency points miss")
@pytest.mark.parametrize("kind", KINDS)
def test_shared_modes_give_the_same_answers(kind):
    """Whatever was computed before; transfer functions are those of direct solves."""
    system = random_system(20 + KINDS.index(kind), kind)
    run = analyses(system)
    alone = {}
    for name, work in run.items():
        forget_systems()
        alone[name] = work()
    again = {name: work() for name, work in reversed(run.items())}
    assert np.array_equal(alone["modes"].eigenvalue, again["modes"].eigenvalue)
    assert np.array_equal(alone["modes"].shape, again["modes"].shape)
    assert np.array_equal(alone["frf"].value, again["frf"].value)
    assert np.array_equal(alone["response"].displacement, again["response"].displacement)
    zero = np.zeros_like(system.M)
    C, G, N = (zero if a is None else a for a in (system.C, system.G, system.N))
    for k, w in enumerate(again["frf"].omega):
        Z = system.K + N - w * w * system.M + 1j * w * (C + G)
        assert np.allclose(again["frf"].value[:, 0, k], np.linalg.inv(Z)[[1, 2], 0], rtol=1e-11)


def test_changed_numbers_are_solved_for_anew():
    """In place as well: what counts is the contents of the matrices."""
    system = random_system(7, "general")
    forget_systems()
    first = mb.modes(system)
    assert eigensolutions(mb.modes(system)) == 0
    system.K[0, 0] *= 1.0 + 1e-13
    changed = mb.modes(system)
    assert eigensolutions(changed) >= 1 and not np.array_equal(first.eigenvalue, changed.eigenvalue)
    changed.shape[:] = 0.0  # a result is the caller's own
    assert np.any(mb.modes(system).shape)
