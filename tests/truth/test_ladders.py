"""Long ladders: closed loops by the hundred, of which the modes, the mobility and the redundant constraints are known.

A ladder of N layers whose rungs sway: stiles of mass m_s and length l turn by (x_i - x_(i-1))/l on four hinges with springs k_h
in each layer, rungs of mass m_r (the last one half) shift by x_i. Bloch waves solve it exactly:

    omega_j^2 = 2 k (1 - cos p) / (m_r + (2 m_s/3)(2 + cos p)),   p = (2 j - 1) pi/(2 N),   k = 4 k_h/l^2
"""

from __future__ import annotations

import warnings

import jitter
import mbrs as mb
import numpy as np
import pytest

Q = np.array([0.31, -0.52, 0.47, 0.64])
WORLD = Q / np.linalg.norm(Q)


def turn(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def ladder(n: int, *, m_r: float, m_s: float, k_h: float, length: float, order: bool = False) -> mb.Model:
    """Turned in space; ``order``: the upper hinges of each layer are defined before the lower ones, which cuts other joints."""
    R, width = turn(WORLD), 0.7 * length
    m, below = mb.Model("ladder"), None

    def at(x: float, y: float) -> tuple[float, ...]:
        return tuple(R @ np.array([x, y, 0.0]))

    for i in range(1, n + 1):
        around = (m_s * length**2 / 12, 0.03 * m_s * length**2, m_s * length**2 / 12)
        stiles = [
            m.body(
                f"S{i},{u}", mass=m_s, inertia=around, at=at((u - 0.5) * width, (i - 0.5) * length), orientation=WORLD
            )
            for u in (0, 1)
        ]
        mass = m_r if i < n else m_r / 2
        rung = m.body(
            f"R{i}", mass=mass, inertia=(0.02 * m_r * length**2,) * 3, at=at(0.0, i * length), orientation=WORLD
        )
        carrier = m.ground if below is None else below
        lower = [(f"a{i},{u}", carrier, stiles[u], at((u - 0.5) * width, (i - 1) * length)) for u in (0, 1)]
        upper = [(f"b{i},{u}", stiles[u], rung, at((u - 0.5) * width, i * length)) for u in (0, 1)]
        for name, a, b, point in upper + lower if order else lower + upper:
            m.revolute(name, a, b, at=point, axis=tuple(R[:, 2]), k=k_h)
        below = rung
    return m


def exact(n: int, count: int, *, m_r: float, m_s: float, k_h: float, length: float) -> np.ndarray:
    p = (2 * np.arange(1, count + 1) - 1) * np.pi / (2 * n)
    k = 4 * k_h / length**2
    return np.sqrt(4 * k * np.sin(p / 2) ** 2 / (m_r + (2 * m_s / 3) * (2 + np.cos(p))))


NUMBERS = (
    {"m_r": 1.0, "m_s": 0.5, "k_h": 10.0, "length": 0.2},
    {"m_r": 0.37, "m_s": 2.3, "k_h": 4.1e3, "length": 13.7},
)


@pytest.mark.parametrize("numbers", NUMBERS, ids=("short", "long"))
@pytest.mark.parametrize(("n", "order"), [(9, True), (160, False), (270, True), (1600, False)])
def test_modes_of_ladders(n, order, numbers):
    """Dense and sparse routes; the last has more rows and columns of loops than a dense matrix of 30 000 000 entries."""
    m = ladder(n, order=order, **numbers)
    with warnings.catch_warnings():
        # nothing carries force and no rank is doubtful in a drawing that is right to rounding
        warnings.simplefilter("error" if jitter.seed() is None else "ignore", mb.MbrsWarning)
        r = mb.modes(m, n=8)
    w = exact(n, 8, **numbers)
    print(r.stats.route, np.abs(r.omega / w - 1).max())
    # the drawing itself is right to the rounding of its longest coordinate over the length of a layer
    assert np.allclose(r.omega, w, rtol=(1e-13 + jitter.level()) * (10 + n)) and r.status == "converged"


@pytest.mark.parametrize("numbers", NUMBERS, ids=("short", "long"))
def test_estimates_of_ladders(numbers):
    """Rounding of places and of the rows of joints, which grows with the height: no estimate is below the error, none absurd."""
    for n in (3, 5, 9, 20, 60, 160, 400):
        r = mb.modes(ladder(n, **numbers), n=min(n, 8))
        error = np.abs(r.omega / exact(n, min(n, 8), **numbers) - 1)
        print(f"{n} layers, {r.stats.route}: error {error.max():.1e}, estimate {r.error.max():.1e}")
        assert np.all(error < r.error + 3 * jitter.level() * n) and r.error.max() < 1e3 * error.max()


@pytest.mark.parametrize(("n", "order"), [(7, False), (130, True), (1600, False)])
def test_mobility_of_ladders(n, order):
    system = mb.System(ladder(n, order=order, **NUMBERS[1]))
    assert system.dof == n and len(system.loops) == n
    assert sum(system.redundant.values()) == 3 * n and set(system.redundant.values()) == {3}
    around = {frozenset(loop.bodies) for loop in system.loops}
    rungs = ["ground", *(f"R{i}" for i in range(1, n + 1))]
    assert around == {frozenset((rungs[i - 1], f"S{i},0", f"S{i},1", rungs[i])) for i in range(1, n + 1)}


@pytest.mark.parametrize("n", [11, 150])
def test_mobility_of_ladders_of_balls(n):
    """Three rows for each of N loops among 9 N coordinates, none of them redundant."""
    system = mb.System(mb.examples.ladder(n, joint="spherical"))
    assert system.dof == 6 * n and not system.redundant and system.rank == 3 * n


def test_a_flat_layer_is_found_among_many():
    """One layer drawn as a flat parallelogram, where its motion branches: the message names its joints and no others."""
    m = ladder(60, **NUMBERS[0])
    R = turn(WORLD)
    top = 60 * NUMBERS[0]["length"]

    def point(x: float) -> tuple[float, ...]:
        return tuple(R @ np.array([x, top, 0.0]))

    axis = tuple(R[:, 2])
    before, names = m["R60"], []
    for k, (x0, x1) in enumerate([(0.0, 1.0), (1.0, 3.0), (3.0, 2.0)]):
        b = m.body(f"flat{k}", mass=1.0, inertia=(0.1,) * 3, at=point((x0 + x1) / 2))
        names.append(f"flat joint {k}")
        m.revolute(names[-1], before, b, at=point(x0), axis=axis)
        before = b
    m.revolute("flat joint 3", before, m["R60"], at=point(2.0), axis=axis)
    with pytest.raises(mb.SingularError, match="singular pose") as caught:
        mb.System(m)
    assert "flat joint" in str(caught.value) and "'a7,1'" not in str(caught.value)
    with pytest.raises(mb.SingularError, match="singular pose"):
        mb.modes(m, n=3)
