"""What rounding of drawn places adds to `ModalResult.error`."""

import mbrs as mb
import numpy as np
import pytest

OPENINGS = [0.0, 1e-15, 1e-14, 1e-13, 1e-12, 1e-10]


@pytest.mark.parametrize("seed", range(3))
def test_a_beam_that_is_drawn_off_its_bearing(seed):
    """A node that has no mass of its own is a point of its beam, however near to it the bearing is drawn."""
    rng = np.random.default_rng(seed)
    length, mass, *stiffness = np.exp(rng.uniform(-1, 1, 4))
    beam = mb.flexible.beam(
        length, mass=mass, EI_flap=stiffness[0], EI_edge=stiffness[1], EA=1e4 * max(stiffness) / length**2, modes=16
    )
    at, way = rng.normal(size=3), rng.normal(size=3)
    R = mb.rotation(rng.normal(size=3), rng.uniform(0.3, 3))
    found = []
    for opening in OPENINGS:
        m = mb.Model("propped")
        b = m.flexible_body("b", beam, at=at, orientation=R)
        m.fixed("root", m.ground, b.node("root"), at=(b.node("root").at + opening * way, b.node("root").at))
        m.spherical("tip", m.ground, b.node("tip"), at=(b.node("tip").at - opening * way, b.node("tip").at))
        found.append(mb.modes(m))
    print([(f.status, f.error.max()) for f in found])
    for f, opening in zip(found, OPENINGS, strict=True):
        assert f.status == "converged"
        # the drawing itself is off by the opening, which stretches the beam
        assert np.allclose(f.omega, found[0].omega, rtol=1e-10 + 1e5 * opening / length)
        assert f.error.max() < 1e-9
