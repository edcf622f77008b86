"""Multibody models with local nonlinear laws for harmonic balance. All data are invented."""

from __future__ import annotations

from ..model.laws import Cubic, Gap
from ..model.model import Model
from ._data import LATTICE_C
from ._lattices import ladder


def clearance_oscillator(clearance: float = 1e-3, stop: float = 4e4) -> Model:
    """A mass on a rail between two stops: 2 kg, 8 kN/m, 20 N s/m, free by ``clearance`` m to either side.

    Beyond it a stop of ``stop`` N/m. Body "mass", prismatic joint "rail" along x. All data are invented.
    """
    m = Model("clearance oscillator")
    mass = m.body("mass", mass=2.0, inertia=(1e-2, 1e-2, 1e-2))
    law = Gap(stop, clearance, bilateral=True)
    m.prismatic("rail", m.ground, mass, at=(0, 0, 0), axis="x", k=8e3, c=20.0, law=law)
    return m


def engine_on_mounts(k3: float = 4e10, gravity: float = 9.81) -> Model:
    """An engine block of 160 kg on four elastomer mounts that harden: k u + ``k3`` u^3 along each axis, 6 degrees of
    freedom.

    Body "block", bushings "mount0" to "mount3", marker "crank" on the axis of the crankshaft (x). With gravity the laws
    are displaced: analyse it at its equilibrium. All data are invented.

    >>> import mbrs as mb
    >>> m = mb.examples.engine_on_mounts()
    >>> mb.nonlinear_system(m, at=mb.equilibrium(m)).n
    6
    """
    m = Model("engine on mounts", gravity=(0.0, 0.0, -gravity))
    block = m.body("block", mass=160.0, inertia=(5.0, 9.0, 10.0), at=(0.0, 0.0, 0.25))
    m.marker("crank", block, at=(0.0, 0.0, 0.15))
    law = {axis: Cubic(k3) for axis in "xyz"}
    places = [(x, y, 0.0) for x in (-0.25, 0.3) for y in (-0.22, 0.22)]
    for i, at in enumerate(places):
        m.bushing(f"mount{i}", m.ground, block, at=at, k=(1.2e5, 1.2e5, 2.4e5, 40, 40, 40), c=(120, 120, 200, 1, 1, 1),
                  law=law)  # fmt: skip
    return m


def ladder_with_gap(layers: int = 3, gap: float = 2e-4, stop: float = 8e3) -> Model:
    """`ladder` of hinges and bushings whose top rung has play: a stop of ``stop`` N/m to either side beyond ``gap`` m.

    The stop is the element "stop" between ground and the top rung, along x. All data are invented.
    """
    # twenty times the damping of the plain ladder: with 0.2 % every resonance of every harmonic has a branch of its own
    m = ladder(layers, c=tuple(20 * v for v in LATTICE_C))
    m.name = "ladder with a gap"
    y = 0.2 * layers
    law = Gap(stop, gap, bilateral=True)
    m.spring_damper("stop", m.ground, m[f"B{layers},3"], at=((-1.0, y, 0.0), (0.0, y, 0.0)), k=0.0, law=law)
    return m
