"""Axial forces at nodes of beams: their stiffness is left out, which is said before it matters."""

import warnings

import mbrs as mb
import numpy as np
import pytest
from mbrs._lib.rotations import quaternion_matrix


def column(seed, share, frame="world", parts=1):
    """A cantilever under ``share`` of its buckling load pi^2 EI/(4 L^2) at the tip, in a random frame; and sqrt(EI/(m L^4)), rad/s."""
    rng = np.random.default_rng(seed)
    length, mass, EI = np.exp(rng.uniform([-1, -1, 2], [1, 1, 4]))
    R = mb.rotation(rng.normal(size=3), rng.uniform(0.3, 2.5))
    m, before, at = mb.Model("column"), None, rng.normal(size=3)
    for i in range(parts):
        beam = mb.flexible.beam(
            length / parts, mass=mass, EI_flap=EI, EI_edge=2.7 * EI, modes=8 if parts == 1 else 4, attach=["tip"]
        )
        part = m.flexible_body(f"beam{i}", beam, at=at, orientation=R)
        m.fixed(f"weld{i}", m.ground if before is None else before, part.node("root"))
        before, at = part.node("tip"), part.node("tip").at
    load = share * np.pi**2 * EI / (4 * length**2)
    along = np.array([-load, 0.0, 0.0])
    m.force("load", before, value=quaternion_matrix(R) @ along, frame=frame)
    return m, np.sqrt(EI / (mass * length**4))


@pytest.mark.parametrize("frame", ["world", "body"])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("share", [-0.5, 0.3, 0.9, 8.0])
def test_an_axial_load_is_named(seed, share, frame):
    with pytest.warns(mb.MbrsWarning, match=r"'beam0' is loaded by .* at 'beam0.tip'.*welded"):
        mb.modes(column(seed, share, frame)[0])


@pytest.mark.parametrize("seed", range(3))
def test_a_small_axial_load_is_named(seed):
    m, unit = column(seed, 0.02)
    with pytest.warns(mb.MbrsWarning, match="'beam0.tip'"):
        assert mb.modes(m).omega[0] == pytest.approx(3.51602 * unit, rel=0.02)
    m, unit = column(seed, 1e-5)
    with warnings.catch_warnings():
        warnings.simplefilter("error", mb.MbrsWarning)
        assert mb.modes(m).omega[0] == pytest.approx(3.51602 * unit, rel=1e-4)


def loaded_cantilever(load, n=20):
    """omega_1^2 of EI = mass = length = 1 under an axial tip load, by Hermite elements with their geometric stiffness."""
    h = 1.0 / n
    bend = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]]) / h**3
    axial = np.array([[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]]) / (30 * h)
    heavy = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) * h / 420
    units = np.outer([1, h, 1, h], [1, h, 1, h])
    K, M = np.zeros((2, 2 * n + 2, 2 * n + 2))
    for i in range(n):
        own = np.ix_(range(2 * i, 2 * i + 4), range(2 * i, 2 * i + 4))
        K[own] += (bend - load * axial) * units
        M[own] += heavy * units
    return float(np.min(np.linalg.eigvals(np.linalg.solve(M[2:, 2:], K[2:, 2:])).real))


@pytest.mark.parametrize(("parts", "within"), [(4, 0.03), (8, 0.008)])
def test_the_remedy_is_right(parts, within):
    """Welded beams leave .85/n^2 of the effect of the load out, as rigid links do."""
    assert loaded_cantilever(0.0) == pytest.approx(3.516015**2, rel=1e-6)
    share = 0.5
    m, unit = column(1, share, parts=parts)
    assert mb.modes(m).omega[0] ** 2 / unit**2 == pytest.approx(loaded_cantilever(share * np.pi**2 / 4), rel=2 * within)
