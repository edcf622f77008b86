"""Results of small models, for the tests of tables, figures, pages and the command line."""

from __future__ import annotations

from functools import cache

import mbrs as mb
import numpy as np
from problems import hanging_masses


@cache
def isolator_modes() -> mb.ModalResult:
    """15.9155 Hz three times, 18.3776 Hz twice, 36.7553 Hz (docs/theory.md (23.1)), along and about the axes of the world."""
    return mb.modes(mb.examples.cubic_hexapod())


@cache
def chain_modes(n: int) -> mb.ModalResult:
    """Eight modes of Bernoulli's chain."""
    return mb.modes(hanging_masses(n).model, n=8)


@cache
def row_frf(n_out: int = 1, n_in: int = 1, n: int = 800) -> mb.FrfResult:
    """Receptances along a row of masses of 2 kg on springs 1e4 N/m and dampers 6 N s/m, 1 to 60 Hz; one is 1/(k - w^2 m + i w c)."""
    m = mb.Model("row")
    before, count = m.ground, max(n_out, n_in)
    for i in range(count):
        b = m.body(f"b{i}", mass=2.0, inertia=(0.1, 0.1, 0.1), at=(0, 0, i))
        m.prismatic(f"s{i}", before, b, at=(0, 0, i), axis="z", k=1e4, c=6.0)
        before = b
    ports = [f"b{j}.force.z" for j in range(n_in)], [f"b{i}.motion.z" for i in range(n_out)]
    return mb.frf(m, *ports, frequency=np.linspace(1.0, 60.0, n))


@cache
def isolator_sensitivity() -> mb.EigenSensitivity:
    """Derivatives of the isolator's modes by the stiffness and damping of its legs and by its mass."""
    return mb.sensitivity(isolator_modes(), ["k_leg", "c_leg", "payload.mass"])
